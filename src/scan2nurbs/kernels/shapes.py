"""Distances of plane, cylinder, cone, sphere and torus, and the normal equations of their least-squares fits, in one pass.

A shape is given by a pose and two numbers. The pose is (origin, x, y, z), 12 floats, the frame in which its parameters are increments:
shifts along x, y and z, tilts of z towards x and towards y, and two of its own (`a`, `b`):

    plane     z the normal
    cylinder  z the axis, a the radius
    cone      z the axis, a the radius at the origin, b the half angle; it widens along z
    sphere    a the radius
    torus     z the axis, a the major radius, b the minor one

Moving a distance field rigidly changes it by −n·(t + ω × (p − o)), whatever
the shape: the columns of shifts and tilts need its normal only.
"""

from __future__ import annotations

import math

import numpy as np

from scan2nurbs.kernels.runner import kernel

PLANE, CYLINDER, CONE, SPHERE, TORUS = range(5)

# Which of the seven increments are parameters of each kind; the others move it along itself.
FREE = np.array(
    [
        [0, 0, 1, 1, 1, 0, 0],
        [1, 1, 0, 1, 1, 1, 0],
        [1, 1, 0, 1, 1, 1, 1],
        [1, 1, 1, 0, 0, 1, 0],
        [1, 1, 1, 1, 1, 1, 1],
    ],
    dtype=np.bool_,
)
_LARGEST_GROWTH = 3.0


@kernel
def _distance(kind, u, v, w, a, b):
    """Return distance, normal (in the pose's frame) and the derivatives by a and b at a point (u, v, w) of the pose's frame."""
    if kind == PLANE:
        return w, 0.0, 0.0, 1.0, 0.0, 0.0
    if kind == SPHERE:
        length = math.sqrt(u * u + v * v + w * w)
        s = 1.0 / max(length, 1e-300)
        return length - a, u * s, v * s, w * s, -1.0, 0.0
    radius = math.sqrt(u * u + v * v)
    s = 1.0 / max(radius, 1e-300)
    x, y = (u * s, v * s) if radius > 0.0 else (1.0, 0.0)
    if kind == CYLINDER:
        return radius - a, x, y, 0.0, -1.0, 0.0
    if kind == CONE:
        sine, cosine = math.sin(b), math.cos(b)
        along = (radius - a) * sine + w * cosine  # from the circle at the origin, up the surface
        down = a / max(sine, 1e-300)  # the apex lies so far down
        if along > -down:
            return (radius - a) * cosine - w * sine, x * cosine, y * cosine, -sine, -cosine, -along
        below = w + down * cosine
        far = max(math.sqrt(radius * radius + below * below), 1e-300)
        return far, x * radius / far, y * radius / far, below / far, below * cosine / (far * sine), 0.0
    across = radius - a
    length = math.sqrt(across * across + w * w)
    s = 1.0 / max(length, 1e-300)
    return length - b, x * across * s, y * across * s, w * s, -across * s, -1.0


@kernel
def distances_range(points, kind, pose, a, b, start, stop, out):
    """Write the signed distances of points[start:stop] to out (N,)."""
    for i in range(start, stop):
        p, q, r = points[i, 0] - pose[0], points[i, 1] - pose[1], points[i, 2] - pose[2]
        u = p * pose[3] + q * pose[4] + r * pose[5]
        v = p * pose[6] + q * pose[7] + r * pose[8]
        w = p * pose[9] + q * pose[10] + r * pose[11]
        out[i] = _distance(kind, u, v, w, a, b)[0]


@kernel
def normal_equations(points, weights, kind, pose, a, b, cut, out):
    """Add up the normal equations of a robust fit, weighted by Tukey's biweight.

    Parameters
    ----------
    points : (N, 3) float64
    weights : (N,) float64
    kind : int
    pose : (12,) float64
    a, b : float
    cut : float
        Distance from which on a point has no weight; infinite for plain least squares.
    out : (8, 8) float64
        Receives the upper triangle of the sum of w·gᵀg, where g is the derivatives by the 7 increments followed by the distance.

    Returns
    -------
    float
        Σ weight·ρ(d); ρ is d² near zero and cut²/3 beyond the cut.
    """
    row = np.empty(8)
    out[:] = 0.0
    cost = 0.0
    for k in range(len(points)):
        p, q, r = points[k, 0] - pose[0], points[k, 1] - pose[1], points[k, 2] - pose[2]
        u = p * pose[3] + q * pose[4] + r * pose[5]
        v = p * pose[6] + q * pose[7] + r * pose[8]
        w = p * pose[9] + q * pose[10] + r * pose[11]
        d, nx, ny, nz, da, db = _distance(kind, u, v, w, a, b)
        t = d / cut
        inside = max(1.0 - t * t, 0.0)
        weight = weights[k] * inside * inside
        cost += weights[k] * (cut * cut / 3.0 * (1.0 - inside * inside * inside) if t * t > 1e-8 else d * d)
        if weight == 0.0:
            continue
        row[0], row[1], row[2] = -nx, -ny, -nz
        row[3] = u * nz - w * nx  # a tilt towards x turns about y
        row[4] = v * nz - w * ny
        row[5], row[6], row[7] = da, db, d
        for i in range(8):
            g = weight * row[i]
            for j in range(i, 8):
                out[i, j] += g * row[j]
    return cost


@kernel
def minimise(points, weights, kind, start, anchor, cut, rounds, least, best):
    """Write to `best` the shape (pose, a, b) that minimises Σ w·ρ(d), from a start, by Levenberg-Marquardt steps.

    `anchor` (3,) is a point amid the data: radii change as curvatures do, with the surface kept in place there, or else a weakly curved
    patch would take hundreds of steps. It ends when a step promises to lower the cost by no more than `least`. Returns the cost.

    References
    ----------
    D. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963; damping after H. Nielsen, 1999.
    """
    matrix, trial_matrix, trial, step = np.empty((8, 8)), np.empty((8, 8)), np.empty(14), np.empty(7)
    best[:] = start
    cost = normal_equations(points, weights, kind, best[:12], best[12], best[13], cut, matrix)
    damping, worse = 1e-3, 2.0
    for _ in range(rounds):
        expected = _solve_damped(matrix, FREE[kind], damping, step)
        if not expected > least:
            break
        good = _move(kind, best, step, anchor, trial)
        trial_cost = normal_equations(points, weights, kind, trial[:12], trial[12], trial[13], cut, trial_matrix) if good else np.inf
        if trial_cost < cost:
            gain = cost - trial_cost
            ratio = min(gain / expected, 1.0)
            damping = max(damping * max(1.0 / 9.0, 1.0 - (2.0 * ratio - 1.0) ** 3), 1e-12)
            worse = 2.0
            cost = trial_cost
            best[:] = trial
            matrix[:] = trial_matrix
            if gain <= least:
                break
        else:
            damping *= worse
            worse *= 2.0
            if damping > 1e12:
                break
    return cost


@kernel
def _solve_damped(matrix, free, damping, step):
    """Write the damped step by Cholesky's method on the scaled normal equations; return the decrease that it promises."""
    n = 0
    index, scale, x = np.empty(7, np.int64), np.empty(7), np.empty(7)
    factor = np.empty((7, 7))
    for i in range(7):
        step[i] = 0.0
        if free[i]:
            index[n] = i
            scale[n] = 1.0 / math.sqrt(max(matrix[i, i], 1e-300))
            n += 1
    for j in range(n):
        for i in range(j, n):
            value = matrix[index[j], index[i]] * scale[i] * scale[j] + (damping if i == j else 0.0)
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(max(value, 1e-15)) if i == j else value / factor[j, j]
    for i in range(n):
        value = -matrix[index[i], 7] * scale[i]
        for k in range(i):
            value -= factor[i, k] * x[k]
        x[i] = value / factor[i, i]
    for i in range(n - 1, -1, -1):
        value = x[i]
        for k in range(i + 1, n):
            value -= factor[k, i] * x[k]
        x[i] = value / factor[i, i]
    promise = 0.0
    for i in range(n):
        promise += x[i] * (damping * x[i] - matrix[index[i], 7] * scale[i])
        step[index[i]] = x[i] * scale[i]
    return promise


@kernel
def _move(kind, shape, step, anchor, out):
    """Write the shape after a step; return whether there is one."""
    s0, s1, s2 = step[0], step[1], step[2]
    da, db = step[5], step[6]
    if kind in (CYLINDER, SPHERE, TORUS):
        radius, change = (shape[13], db) if kind == TORUS else (shape[12], da)
        share = change / radius
        grown = 1.0 / (1.0 - share) if share < 1.0 - 1.0 / _LARGEST_GROWTH else _LARGEST_GROWTH
        extra = radius * (grown - 1.0) - change
        p, q, r = anchor[0] - shape[0], anchor[1] - shape[1], anchor[2] - shape[2]
        u = p * shape[3] + q * shape[4] + r * shape[5]
        v = p * shape[6] + q * shape[7] + r * shape[8]
        w = p * shape[9] + q * shape[10] + r * shape[11]
        _, nx, ny, nz, _, _ = _distance(kind, u, v, w, shape[12], shape[13])
        s0, s1, s2 = s0 - extra * nx, s1 - extra * ny, s2 - extra * nz
        da, db = (da, db + extra) if kind == TORUS else (da + extra, db)
    for c in range(3):
        out[c] = shape[c] + s0 * shape[3 + c] + s1 * shape[6 + c] + s2 * shape[9 + c]
        out[9 + c] = shape[9 + c] + step[3] * shape[3 + c] + step[4] * shape[6 + c]
    _make_frame(shape, out)
    out[12], out[13] = shape[12] + da, shape[13] + db
    if kind == CONE and out[13] < 0.0:  # it would narrow along its axis: turn that round
        out[13] = -out[13]
        out[6:12] *= -1.0
    if kind == CONE:
        return out[12] > 0.0 and 0.0 < out[13] < 0.5 * math.pi
    return kind == PLANE or (out[12] > 0.0 and (kind != TORUS or out[13] > 0.0))


@kernel
def _make_frame(shape, out):
    """Make x and y of the frame perpendicular to its new z, and all of length one."""
    length = math.sqrt(out[9] * out[9] + out[10] * out[10] + out[11] * out[11])
    for c in range(9, 12):
        out[c] /= length
    along = shape[3] * out[9] + shape[4] * out[10] + shape[5] * out[11]
    for c in range(3):
        out[3 + c] = shape[3 + c] - along * out[9 + c]
    length = math.sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5])
    for c in range(3, 6):
        out[c] /= length
    out[6] = out[10] * out[5] - out[11] * out[4]
    out[7] = out[11] * out[3] - out[9] * out[5]
    out[8] = out[9] * out[4] - out[10] * out[3]
