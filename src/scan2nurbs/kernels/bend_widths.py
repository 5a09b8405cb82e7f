"""How widely a surface bends: how well two faces explain a neighbourhood that meet sharply, through a rounding, or are one curved face.

In the frame of a bend, t along it, s across and z upwards, two faces that meet are z = quadric(t, s) + a·|s − p(t)|, where p(t) is the
crease. A rounding replaces |s| within its half-width w by the parabola (s² + w²) / 2w; as w grows this becomes one curved face.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import inlined, kernel, run_ranges
from scan2nurbs.kernels.sides import Meetings

PLACES_PER_RANGE = 256
LEAST_POINTS = 10
# The window is grown from the crease outwards in steps of a spacing, and always this far.
BINS, SURE = 16, 2
# Noise in the position of points along the surface rounds a sharp crease: the mean of |s + σε| near 0 is that of a half-width of 1.6 σ.
ROUNDED = 1.6
# Standard deviations, a priori, of the curvature of faces that meet and of one face that bends, in 1/h: surfaces that bend in less
# than a few spacings are not sampled. Half of a curvature is a coefficient of the quadric.
FACE_CURVATURE, BEND_CURVATURE = 0.1, 0.2
# The same of the crease: its offset in h, its direction as a slope, and its curvature in 1/h.
OFFSET, SLOPE, CREASE_CURVATURE = 0.5, 0.2, 0.2
# Gauss-Newton steps that find a crease, and the rounding, in spacings, at which the last of them is left out.
STEPS, LEAST_STEP = 3, 0.4
# Standard deviations up to which a point surely belongs to the bend, and from which on it is another face's.
SURELY, HARDLY = 2.5, 4.0
# Residuals of less than this part of the spacing are no evidence: faces are no exact quadrics, and creases no parabolas.
FLOOR = 0.14


class Bends(NamedTuple):
    """What the windows about each meeting of two sides say.

    Attributes
    ----------
    misfit : (M, W + 1) float64
        Sum of squared residuals in units of the noise, and the price of the coefficients, for each half-width and for one curved face;
        NaN where too few points are left.
    n_points : (M,) int32
        Points in the window.
    foot : (M, 3) float64
        The point of the refined crease beside the place.
    turn : (M,) float64
        By how much the surface turns at the crease, in radians.
    """

    misfit: NDArray[np.float64]
    n_points: NDArray[np.int32]
    foot: NDArray[np.float64]
    turn: NDArray[np.float64]


def fit_bends(
    cells: Cells,
    places: NDArray[np.int64],
    meetings: Meetings,
    *,
    across: float,
    along: float,
    noise: float,
    spacing: float,
    widths: NDArray[np.float64],
) -> Bends:
    """Fit bends of several widths to the points about the lines in which two sides meet.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    places : (M,) int64
        The sorted points whose sides meet.
    meetings : Meetings
        Where they meet; those with a turn that is NaN are left out.
    across, along : float
        How far the window reaches across and along the crease, in the points' unit; less where other faces begin.
    noise, spacing : float
        Standard deviation of the points, and h.
    widths : (W,) float64
        Half-widths of roundings in the points' unit, the first of them 0.

    Notes
    -----
    O(M) time: about 60 µs a place at a hundred points. No neighbour is kept beyond its place.
    """
    m = len(places)
    out = Bends(np.full((m, len(widths) + 1), np.nan), np.zeros(m, np.int32), np.full((m, 3), np.nan), np.full(m, np.nan))
    lengths = np.array([across, along, noise, spacing])
    run_ranges(
        lambda start, stop: _fit_bends(cells, places, meetings, lengths, widths / across, start, stop, out), m, size=PLACES_PER_RANGE
    )
    return out


@kernel
def _fit_bends(cells, places, meetings, lengths, widths, start, stop, out):
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    x = np.empty((4, 1024))
    low, high, up, path, row = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(11)
    bins, far, A = np.empty((4, BINS, 2)), np.empty(4), np.empty((11, 11))
    quadric = np.empty((8, 8))
    unit = lengths[0]
    along, noise, spacing = lengths[1] / unit, lengths[2] / unit, lengths[3] / unit
    for i in range(start, stop):
        turn = meetings.turn[i]
        if np.isnan(turn):
            continue
        foot, t, s = meetings.foot[i], meetings.direction[i], meetings.across[i]
        up[0], up[1], up[2] = t[1] * s[2] - t[2] * s[1], t[2] * s[0] - t[0] * s[2], t[0] * s[1] - t[1] * s[0]
        cosine, slope = np.cos(0.5 * turn), np.tan(0.5 * turn)
        for k in range(3):
            reach = lengths[1] * abs(t[k]) + unit * (abs(s[k]) + abs(up[k]))
            low[k], high[k] = foot[k] - reach, foot[k] + reach
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices, x = np.empty(2 * room, np.int64), np.empty((4, 2 * room))
        n = points_in_box(cells.points, runs, n_runs, low, high, indices)
        n, height = _in_frame(cells.points, indices, n, foot, t, s, up, unit, along, cosine, x)
        n = _supported(x, n, slope if height >= 0.0 else -slope, cosine, noise, spacing, bins, far)
        out.n_points[i] = n
        if n < LEAST_POINTS:
            continue
        variance = (noise * noise + (FLOOR * spacing) ** 2) / (cosine * cosine)
        _follow(x, n, variance, max(slope, 0.05), noise, spacing, path, A, row)
        here = 0.0
        for k in range(3):
            here += (cells.points[places[i], k] - foot[k]) * t[k] / unit
        out.n_points[i] = int(np.sum(x[3, :n]))
        if out.n_points[i] < LEAST_POINTS:
            continue
        out.turn[i] = _misfits(x, n, variance, noise, spacing, path, here, widths, A, quadric, row, out.misfit[i])
        side = path[0] + path[1] * here + path[2] * here * here
        for k in range(3):
            out.foot[i, k] = foot[k] + unit * (here * t[k] + side * s[k] + row[0] * up[k])


@kernel
def _in_frame(points, indices, n, foot, t, s, up, unit, along, cosine, x):
    """Write the points of the window along t, across and up, in units of its half-width; return how many, and their mean height."""
    m, height = 0, 0.0
    for j in range(n):
        i = indices[j]
        dx, dy, dz = (points[i, 0] - foot[0]) / unit, (points[i, 1] - foot[1]) / unit, (points[i, 2] - foot[2]) / unit
        a, b = dx * t[0] + dy * t[1] + dz * t[2], dx * s[0] + dy * s[1] + dz * s[2]
        if abs(a) < along and abs(b) < cosine:
            x[0, m], x[1, m], x[2, m] = a, b, dx * up[0] + dy * up[1] + dz * up[2]
            height += x[2, m]
            m += 1
    return m, height


@kernel
def _supported(x, n, slope, cosine, noise, spacing, bins, far):
    """Keep the points of the window as far as two half-planes explain it, on either side of the crease, then either way along it."""
    cap = 4.0 * noise + spacing
    limit = (ROUNDED * noise) ** 2 + (0.3 * spacing) ** 2
    for axis in range(2):
        # Rows 0 and 1 are the two sides, 2 and 3 the two ways along.
        bins[:] = 0.0
        for j in range(n):
            side, end = (0 if x[1, j] < 0.0 else 1), (2 if x[0, j] < 0.0 else 3)
            e = min(cosine * abs(x[2, j] - slope * abs(x[1, j])), cap)
            if axis == 0 and abs(x[0, j]) < 3.0 * spacing:
                k = min(int(abs(x[1, j]) / (cosine * spacing)), BINS - 1)
                bins[side, k, 0] += e * e
                bins[side, k, 1] += 1.0
            elif axis == 1 and abs(x[1, j]) < far[side] * cosine * spacing:
                k = min(int(abs(x[0, j]) / spacing), BINS - 1)
                bins[end, k, 0] += e * e
                bins[end, k, 1] += 1.0
        for row in range(2 * axis, 2 * axis + 2):
            k = SURE
            while k < BINS and bins[row, k, 0] <= limit * bins[row, k, 1]:
                k += 1
            far[row] = k if k < BINS else np.inf
    kept = 0
    for j in range(n):
        side, end = (0 if x[1, j] < 0.0 else 1), (2 if x[0, j] < 0.0 else 3)
        e = cosine * abs(x[2, j] - slope * abs(x[1, j]))
        if e < cap and abs(x[1, j]) < far[side] * cosine * spacing and abs(x[0, j]) < far[end] * spacing:
            x[0, kept], x[1, kept], x[2, kept] = x[0, j], x[1, j], x[2, j]
            x[3, kept] = _trust(
                e / (np.sqrt(noise * noise + (0.3 * spacing) ** 2) + 0.5 * FACE_CURVATURE * x[1, j] ** 2 / (SURELY * spacing))
            )
            kept += 1
    return kept


@kernel
def _trust(deviations):
    """Return the weight of a point so many standard deviations from the model."""
    return min(max((HARDLY - deviations) / (HARDLY - SURELY), 0.0), 1.0)


@kernel
def _hinge(d, w):
    """Return |d|, rounded within the half-width w."""
    return abs(d) if abs(d) >= w else 0.5 * (d * d + w * w) / w


@kernel
def _follow(x, n, variance, slope, noise, spacing, path, A, row):
    """Fit the crease s = p(t), a parabola, by Gauss-Newton steps on bends less and less rounded; fill its coefficients."""
    path[:] = 0.0
    for step in range(STEPS):
        w = max(spacing / (1.0 + step), ROUNDED * noise)
        if step > 1 and w >= LEAST_STEP * spacing:
            break  # what noise blurs more than that is not found better by another step
        A[:] = 0.0
        for j in range(n):
            t, s = x[0, j], x[1, j]
            d = s - (path[0] + path[1] * t + path[2] * t * t)
            tilt = max(min(d / w, 1.0), -1.0)  # derivative of the hinge
            row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, s, t, t * t, t * s, s * s
            row[6], row[7], row[8], row[9], row[10] = _hinge(d, w), tilt, tilt * t, tilt * t * t, x[2, j]
            _accumulate(A, row, 11, x[3, j])
        A[5, 5] += variance / (0.5 * FACE_CURVATURE / spacing) ** 2
        A[7, 7] += variance / (slope * OFFSET * spacing) ** 2
        A[8, 8] += variance / (slope * SLOPE) ** 2
        A[9, 9] += variance / (slope * 0.5 * CREASE_CURVATURE / spacing) ** 2
        _eliminate(A, 10)
        _solve(A, 10, row)
        if abs(row[6]) < 0.3 * slope:
            break
        path[0] -= min(max(row[7] / row[6], -spacing), spacing)
        path[1] -= min(max(row[8] / row[6], -0.3), 0.3)
        path[2] -= min(max(row[9] / row[6], -0.3), 0.3)
        _reweigh(x, n, variance, path, w, row)


@kernel
def _reweigh(x, n, variance, path, w, row):
    """Weigh the points anew by their distance from the bend with these coefficients."""
    for j in range(n):
        t, s = x[0, j], x[1, j]
        d = s - (path[0] + path[1] * t + path[2] * t * t)
        z = row[0] + row[1] * s + row[2] * t + row[3] * t * t + row[4] * t * s + row[5] * s * s + row[6] * _hinge(d, w)
        x[3, j] = _trust(abs(x[2, j] - z) / np.sqrt(variance))


@kernel
def _misfits(x, n, variance, noise, spacing, path, here, widths, A, quadric, row, misfit):
    """Fill the misfit of every width and of one curved face; return the turn of the sharp bend, and its height at `here` in row[0]."""
    turn, height = 0.0, 0.0
    quadric[:] = 0.0  # what all models have in common; the hinge alone makes the difference
    for j in range(n):
        _quadric_row(x, j, row)
        row[6] = 0.0
        _accumulate(quadric, row, 8, x[3, j])
    for v in range(len(widths) + 1):
        A[:8, :8] = quadric
        face = v == len(widths)
        if not face:
            _accumulate_hinge(x, n, path, np.sqrt(widths[v] ** 2 + (ROUNDED * noise) ** 2), A, row)
        A[5, 5] += variance / (0.5 * (BEND_CURVATURE if face else FACE_CURVATURE) / spacing) ** 2
        _eliminate(A, 7)
        misfit[v] = A[7, 7] / variance
        if v == 0:
            _solve(A, 7, row)
            side = path[0] + path[1] * here + path[2] * here * here
            height = row[0] + row[1] * side + row[2] * here + row[3] * here * here + row[4] * here * side + row[5] * side * side
            tilt = row[1] + row[4] * here + 2.0 * row[5] * side
            turn = abs(np.arctan(tilt + row[6]) - np.arctan(tilt - row[6]))
    row[0] = height
    return turn


@inlined
def _quadric_row(x, j, row):
    t, s = x[0, j], x[1, j]
    row[0], row[1], row[2], row[3], row[4], row[5], row[7] = 1.0, s, t, t * t, t * s, s * s, x[2, j]


@kernel
def _accumulate_hinge(x, n, path, w, A, row):
    """Add the products of the hinge's column."""
    for j in range(n):
        _quadric_row(x, j, row)
        t, s, weight = x[0, j], x[1, j], x[3, j]
        hinge = _hinge(s - (path[0] + path[1] * t + path[2] * t * t), w)
        for p in range(6):
            A[p, 6] += weight * row[p] * hinge
        A[6, 6] += weight * hinge * hinge
        A[6, 7] += weight * hinge * row[7]


@kernel
def _accumulate(A, row, size, weight):
    for p in range(size):
        for q in range(p, size):
            A[p, q] += weight * row[p] * row[q]


@kernel
def _eliminate(A, size):
    """Eliminate the upper triangle of normal equations; the corner then holds the residual sum of squares."""
    for p in range(size):
        if not A[p, p] > 1e-9:
            A[p, p : size + 1] = 0.0
            A[p, p] = 1.0
            continue
        for a in range(p + 1, size + 1):
            f = A[p, a] / A[p, p]
            for b in range(a, size + 1):
                A[a, b] -= f * A[p, b]


@kernel
def _solve(A, size, x):
    """Write the solution of eliminated equations."""
    for p in range(size - 1, -1, -1):
        x[p] = A[p, size]
        for q in range(p + 1, size):
            x[p] -= A[p, q] * x[q]
        x[p] /= A[p, p]
