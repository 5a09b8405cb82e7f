"""Eigenvectors of symmetric 3x3 matrices, by formula: the planes of neighbourhoods."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import inlined, run_ranges, summing

# Variances across and along a neighbourhood: below this ratio (a strip 3 % as wide as long) it carries no plane.
COLLINEAR = 1e-3

# cos(2/3 arccos t) on [0, 1], interpolated at Chebyshev nodes; the error is 5e-14. Even powers, then odd ones.
_EVEN = (
    0.5000000000000422, -0.11111110963396797, -0.03292110364148388, -0.017026858307058506,
    -0.010206831902026656, -0.004842133220275476, -0.0009702177097400031, -2.7342637379964194e-05,
)  # fmt: skip
_ODD = (
    0.5773502691701757, 0.05345831376940515, 0.022861462049905395, 0.013174935588843556,
    0.007492165932732558, 0.002531397653122743, 0.00023705288767814645,
)  # fmt: skip


@inlined
def _third_of_angle(cosine):
    """Return cos(1/3 arccos x) for x in [-1, 1], several times faster than by calling both functions."""
    t = np.sqrt(0.5 + 0.5 * cosine)
    t2 = t * t
    even, odd = _EVEN[7], 0.0
    for k in range(6, -1, -1):
        even = even * t2 + _EVEN[k]
        odd = odd * t2 + _ODD[k]
    return even + t * odd


@inlined
def _least_axis(xx, xy, xz, yy, yz, zz):
    """Return whether a matrix has a least eigenvalue, without branches, a unit vector of it, and the eigenvalue."""
    trace = xx + yy + zz
    q = trace / 3.0
    a, b, c = xx - q, yy - q, zz - q
    p = np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    cosine = -det / (2.0 * p * p * p)
    least = q - 2.0 * p * _third_of_angle(max(min(cosine, 1.0), -1.0))
    a, b, c = xx - least, yy - least, zz - least
    nx, ny, nz = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
    best = nx * nx + ny * ny + nz * nz
    ux, uy, uz = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
    size = ux * ux + uy * uy + uz * uz
    larger = size > best
    nx, ny, nz, best = ux if larger else nx, uy if larger else ny, uz if larger else nz, size if larger else best
    ux, uy, uz = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
    size = ux * ux + uy * uy + uz * uz
    larger = size > best
    nx, ny, nz, best = ux if larger else nx, uy if larger else ny, uz if larger else nz, size if larger else best
    scale = 1.0 / np.sqrt(best)
    good = (trace > 0.0) & (p > 1e-7 * q) & (best > 0.0)  # a ball has no least axis
    return good, nx * scale, ny * scale, nz * scale, least


@summing
def normals_of_moments(sums, n, normals):
    """Fit planes to several groups of points at once.

    Parameters
    ----------
    sums : (10, G) float64
        Of each group the sums of x, y, z, xx, xy, xz, yy, yz, zz about any fixed point, and the number of points.
    n : int
        How many groups there are, up to G.
    normals : (3, G) float64
        Receives the unit normals as lines; NaN where a group carries no plane, by the rules of `plane_of_moments`.

    Notes
    -----
    Without branches, so that the groups share vector instructions: four take about as long as one.
    """
    for g in range(n):
        count = sums[9, g]
        share = 1.0 / max(count, 1.0)
        mx, my, mz = sums[0, g] * share, sums[1, g] * share, sums[2, g] * share
        xx, xy, xz = sums[3, g] * share - mx * mx, sums[4, g] * share - mx * my, sums[5, g] * share - mx * mz
        yy, yz, zz = sums[6, g] * share - my * my, sums[7, g] * share - my * mz, sums[8, g] * share - mz * mz
        good, nx, ny, nz, least = _least_axis(xx, xy, xz, yy, yz, zz)
        half = 0.5 * (xx + yy + zz - least)
        # Product of the two larger eigenvalues, from the sum of those of all pairs.
        product = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz - 2.0 * least * half
        largest = half + np.sqrt(max(half * half - product, 0.0))
        good = good & (count >= 3.0) & (product > COLLINEAR * largest * largest)
        normals[0, g] = nx if good else np.nan
        normals[1, g] = ny if good else np.nan
        normals[2, g] = nz if good else np.nan


@summing
def planes_of_moments(sums, n, planes):
    """Fit planes to several groups of points at once, and find their principal directions.

    Parameters
    ----------
    sums : (10, G) float64
        As for `normals_of_moments`.
    n : int
        How many groups there are, up to G.
    planes : (7, G) float64
        Receives the normal (3), NaN where a group carries no plane, the principal direction in the plane (3), and the variance along
        the normal, as `plane_of_moments` defines them.
    """
    for g in range(n):
        good, nx, ny, nz, ux, uy, uz, _, _, _, least, _ = _plane(
            sums[9, g], sums[0, g], sums[1, g], sums[2, g], sums[3, g], sums[4, g], sums[5, g], sums[6, g], sums[7, g], sums[8, g]
        )
        planes[0, g] = nx if good else np.nan
        planes[1, g] = ny if good else np.nan
        planes[2, g] = nz if good else np.nan
        planes[3, g], planes[4, g], planes[5, g] = ux, uy, uz
        planes[6, g] = least


@summing
def plane_of_moments(count, s, out):
    """Fit a plane to points of which only sums are known.

    Parameters
    ----------
    count : float
        Number of points.
    s : (9,) float64
        Sums of x, y, z, xx, xy, xz, yy, yz, zz about any fixed point.
    out : (11,) float64
        Receives the normal (3), the principal direction in the plane (3), the mean (3), the variance along the normal and
        the variance across the principal direction in the plane.

    Returns
    -------
    bool
        False where the points cannot carry a plane: fewer than three, or nearly collinear; `out` is then left as it was.

    Notes
    -----
    The smallest eigenvalue comes from the characteristic polynomial in trigonometric form (Smith 1961), its vector from the
    largest cross product of rows of C − λI; the direction in the plane from a 2x2 problem, which stays defined where the two
    larger eigenvalues meet. Signs are fixed by the largest component, so that equal input gives equal output.
    """
    good, nx, ny, nz, ux, uy, uz, mx, my, mz, least, width = _plane(count, s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8])
    if not good:
        return False
    out[0], out[1], out[2], out[3], out[4], out[5] = nx, ny, nz, ux, uy, uz
    out[6], out[7], out[8], out[9], out[10] = mx, my, mz, least, width
    return True


@inlined
def _plane(count, sx, sy, sz, sxx, sxy, sxz, syy, syz, szz):
    """Return whether sums carry a plane, without branches, and its description (see `plane_of_moments`)."""
    share = 1.0 / max(count, 1.0)
    mx, my, mz = sx * share, sy * share, sz * share
    xx, xy, xz = sxx * share - mx * mx, sxy * share - mx * my, sxz * share - mx * mz
    yy, yz, zz = syy * share - my * my, syz * share - my * mz, szz * share - mz * mz
    good, nx, ny, nz, least = _least_axis(xx, xy, xz, yy, yz, zz)
    largest = ny if abs(ny) >= abs(nx) else nx
    largest = nz if abs(nz) >= abs(largest) else largest
    flip = -1.0 if largest < 0.0 else 1.0
    nx, ny, nz = flip * nx, flip * ny, flip * nz
    # A basis of the plane (Duff et al. 2017), then the 2x2 problem in it.
    sign = 1.0 if nz >= 0.0 else -1.0
    f = -1.0 / (sign + nz)
    g = nx * ny * f
    e1x, e1y, e1z = 1.0 + sign * nx * nx * f, sign * g, -sign * nx
    e2x, e2y, e2z = g, sign + ny * ny * f, -ny
    ax, ay, az = xx * e1x + xy * e1y + xz * e1z, xy * e1x + yy * e1y + yz * e1z, xz * e1x + yz * e1y + zz * e1z
    bx, by, bz = xx * e2x + xy * e2y + xz * e2z, xy * e2x + yy * e2y + yz * e2z, xz * e2x + yz * e2y + zz * e2z
    c11, c12, c22 = ax * e1x + ay * e1y + az * e1z, ax * e2x + ay * e2y + az * e2z, bx * e2x + by * e2y + bz * e2z
    half, radius = 0.5 * (c11 + c22), np.sqrt(0.25 * (c11 - c22) * (c11 - c22) + c12 * c12)
    # Half of the angle whose cosine is (c11 − c22) / 2R and whose sine is c12 / R.
    round_ = radius <= 0.0
    double = 1.0 if round_ else (c11 - c22) / (2.0 * (1.0 if round_ else radius))
    cosine, sine = np.sqrt(max(0.5 + 0.5 * double, 0.0)), np.sqrt(max(0.5 - 0.5 * double, 0.0))
    sine = -sine if c12 < 0.0 else sine
    good = good & (count >= 3.0) & (half - radius > COLLINEAR * (half + radius))
    ux, uy, uz = cosine * e1x + sine * e2x, cosine * e1y + sine * e2y, cosine * e1z + sine * e2z
    return good, nx, ny, nz, ux, uy, uz, mx, my, mz, max(least, 0.0), half - radius


def line_angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles (N,) between lines of unit directions (N, 3), in degrees in [0, 90]; NaN where either is NaN."""
    out = np.empty(len(a))
    run_ranges(lambda start, stop: _line_angles(a, b, start, stop, out), len(a), size=1 << 15)
    return out


@summing
def _line_angles(a, b, start, stop, out):
    for i in range(start, stop):
        x = a[i, 1] * b[i, 2] - a[i, 2] * b[i, 1]
        y = a[i, 2] * b[i, 0] - a[i, 0] * b[i, 2]
        z = a[i, 0] * b[i, 1] - a[i, 1] * b[i, 0]
        dot = a[i, 0] * b[i, 0] + a[i, 1] * b[i, 1] + a[i, 2] * b[i, 2]
        # The arc tangent keeps small angles, where the arc cosine of a number near 1 loses half of its digits.
        out[i] = np.degrees(np.arctan2(np.sqrt(x * x + y * y + z * z), abs(dot)))


def weighted_angles(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    """Return ``alpha * a + (1 - alpha) * max(b, c)`` (N,); NaN takes no part in the maximum, nor does a term whose weight is 0."""
    out = np.empty(len(a))
    run_ranges(lambda start, stop: _weighted_angles(a, b, c, float(alpha), start, stop, out), len(a), size=1 << 15)
    return out


@summing
def _weighted_angles(a, b, c, alpha, start, stop, out):
    for i in range(start, stop):
        larger = b[i] if b[i] > c[i] or np.isnan(c[i]) else c[i]
        first = alpha * a[i] if alpha > 0.0 else 0.0
        out[i] = first + ((1.0 - alpha) * larger if alpha < 1.0 else 0.0)
