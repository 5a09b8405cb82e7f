"""First guesses of primitives from a small neighbourhood: from the principal curvatures of its quadric."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.gauss_newton import refine
from scan2nurbs.kernels.primitives import CONE, CYLINDER, PATCH, PLANE, SIZE, SPHERE, fit_patch, frame_of, solve_damped
from scan2nurbs.kernels.runner import kernel

TRIALS = (0.0, 0.5, -0.5, 1.0, -1.0)


@kernel
def curvatures(points, index, n, frame, out):
    """Fit a quadric to a neighbourhood.

    Parameters
    ----------
    points : (N, 3) float64
    index : (M,) int32
        The neighbourhood's points; the first n are read, the very first is its middle.
    frame : (SIZE,) float64
        Scratch.
    out : (14,) float64
        Receives the two principal curvatures, the larger in magnitude first, their directions (3 + 3), the normal (3) that positive
        curvatures bend towards, and the middle's foot on the quadric (3).

    Returns
    -------
    float
        Mean square of the residuals, per degree of freedom that is left.
    """
    reach = frame_of(points, index, n, frame)
    a, b, row = np.zeros((6, 6)), np.zeros(6), np.empty(6)
    nx, ny, nz = frame[4], frame[5], frame[6]
    ux, uy, uz = frame[9], frame[10], frame[11]
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    c = index[0]
    for k in range(n):
        i = index[k]
        x, y, z = points[i, 0] - points[c, 0], points[i, 1] - points[c, 1], points[i, 2] - points[c, 2]
        u, v, w = (x * ux + y * uy + z * uz) / reach, (x * vx + y * vy + z * vz) / reach, (x * nx + y * ny + z * nz) / reach
        row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, u, v, 0.5 * u * u, u * v, 0.5 * v * v
        for p in range(6):
            b[p] += row[p] * w
            for q in range(p + 1):
                a[p, q] += row[p] * row[q]
    solve_damped(a, b, 6, 1e-9)
    square = 0.0
    for k in range(n):
        i = index[k]
        x, y, z = points[i, 0] - points[c, 0], points[i, 1] - points[c, 1], points[i, 2] - points[c, 2]
        u, v, w = (x * ux + y * uy + z * uz) / reach, (x * vx + y * vy + z * vz) / reach, (x * nx + y * ny + z * nz) / reach
        off = w - b[0] - u * (b[1] + 0.5 * u * b[3] + v * b[4]) - v * (b[2] + 0.5 * v * b[5])
        square += off * off
    square *= reach * reach / max(n - 6, 1)
    fu, fv, offset = b[1], b[2], b[0] * reach
    g = 1.0 + fu * fu + fv * fv
    # Curvatures from the quadric's fundamental forms, in the frame made orthonormal along and across the slope.
    e11, e12, e22 = 1.0 + fu * fu, fu * fv, 1.0 + fv * fv
    root = np.sqrt(g)
    l11, l12, l22 = b[3] / (root * reach), b[4] / (root * reach), b[5] / (root * reach)
    # Shape operator S = E^-1 L; its eigenvectors in (u, v).
    s11, s12 = (e22 * l11 - e12 * l12) / g, (e22 * l12 - e12 * l22) / g
    s21, s22 = (e11 * l12 - e12 * l11) / g, (e11 * l22 - e12 * l12) / g
    mean, det = 0.5 * (s11 + s22), s11 * s22 - s12 * s21
    gap = np.sqrt(max(mean * mean - det, 0.0))
    k1 = mean + gap if mean >= 0.0 else mean - gap
    k2 = mean - gap if mean >= 0.0 else mean + gap
    p, q = s12, k1 - s11
    if abs(k1 - s22) + abs(s21) > abs(p) + abs(q):
        p, q = k1 - s22, s21
    if abs(p) + abs(q) < 1e-12:
        p, q = 1.0, 0.0
    ex, ey, ez = p * ux + q * vx, p * uy + q * vy, p * uz + q * vz
    slope = p * fu + q * fv
    ex, ey, ez = ex + slope * nx, ey + slope * ny, ez + slope * nz
    length = np.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / length, ey / length, ez / length
    mx, my, mz = (nx - fu * ux - fv * vx) / root, (ny - fu * uy - fv * vy) / root, (nz - fu * uz - fv * vz) / root
    out[0], out[1] = k1, k2
    out[2], out[3], out[4] = ex, ey, ez
    out[5], out[6], out[7] = my * ez - mz * ey, mz * ex - mx * ez, mx * ey - my * ex
    out[8], out[9], out[10] = mx, my, mz
    out[11], out[12], out[13] = points[c, 0] + offset * nx, points[c, 1] + offset * ny, points[c, 2] + offset * nz
    return square


@kernel
def start(kind, trial, bend, m):
    """Set a model from curvatures; `trial` chooses among the angles that curvatures leave open; False where there is no such guess."""
    k1, k2 = bend[0], bend[1]
    m[0] = kind
    flat = 1e-4
    if kind == SPHERE:
        k = 0.5 * (k1 + k2)
        if abs(k) < flat:
            return False
        for i in range(3):
            m[1 + i] = bend[11 + i] + bend[8 + i] / k
            m[4 + i] = bend[8 + i]
        m[7] = 1.0 / abs(k)
        return True
    if abs(k1) < flat:
        return False
    if kind == CYLINDER:
        for i in range(3):
            m[1 + i] = bend[11 + i] + bend[8 + i] / k1
            m[4 + i] = bend[5 + i]
        m[7] = 1.0 / abs(k1)
        return True
    # The axis leans against the generator (cone) or against the tube (torus) by an angle that curvatures do not tell.
    c, s = np.cos(TRIALS[trial]), np.sin(TRIALS[trial])
    sign = 1.0 if k1 > 0.0 else -1.0
    if kind == CONE:
        rho = c / abs(k1)
        for i in range(3):
            out = -sign * bend[8 + i]  # away from the axis
            m[4 + i] = c * bend[5 + i] - s * out
            m[1 + i] = bend[11 + i] - rho * (c * out + s * bend[5 + i])
        m[7], m[8] = rho, TRIALS[trial]
        return True
    tube = 1.0 / abs(k1)
    # κ2 = cos φ / (R + r cos φ) along the parallel, positive where it bends as the tube does.
    k2 = k2 * sign
    if abs(k2) < flat:
        k2 = flat
    parallel = c / k2  # signed distance from the axis, along the direction away from it at the tube's outer side
    for i in range(3):
        out = -sign * bend[8 + i]
        away = c * out + s * bend[2 + i]
        m[4 + i] = -s * out + c * bend[2 + i]
        m[1 + i] = bend[11 + i] - tube * out - (parallel - tube * c) * away
    m[7], m[8] = abs(parallel - tube * c), tube
    return m[7] > 0.2 * tube


@kernel
def best_start(kind, bend, points, index, n, sigma, m):
    """Fit a primitive to a neighbourhood from its curvatures; return the mean square, infinite where there is none."""
    if kind == PATCH:
        return fit_patch(m, points, index, n, sigma, 3)
    if kind == PLANE:
        m[0] = PLANE
        frame_of(points, index, n, m)
        return refine(m, points, index, n, sigma, 3)
    if kind in (CYLINDER, SPHERE):
        if not start(kind, 0, bend, m):
            return np.inf
        refine(m, points, index, n, sigma, 6)
        return refine(m, points, index, n, sigma, 2)
    best = np.inf
    trial_model = np.zeros(SIZE)
    for trial in range(5):
        if not start(kind, trial, bend, trial_model):
            continue
        square = refine(trial_model, points, index, n, sigma, 5)
        if square < best:
            best = square
            m[:] = trial_model
    if best < np.inf:
        best = refine(m, points, index, n, sigma, 4)
    return best
