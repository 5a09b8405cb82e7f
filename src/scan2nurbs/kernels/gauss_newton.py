"""Fitting a primitive to a list of points: Gauss-Newton steps of robust weighted squares.

Points are taken in blocks. Derivatives of a block are columns of numbers, and its normal equations are summed two by two columns at a
time, in registers: a third of the time of summing point by point.
"""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.primitives import CONE, CYLINDER, PATCH, PLANE, SPHERE, TORUS, fit_patch, solve_damped
from scan2nurbs.kernels.runner import kernel

BLOCK = 64
MOST = 700
"""Of more points than twice these, only some, evenly chosen, are read until a model is nearly right."""
UNKNOWNS = 8
"""Three of moving, three of turning, two of shape; the distance is the column behind them."""
_RIDGE = 1e-8


@kernel
def refine(m, points, index, n, sigma, rounds):
    """Fit a model to points[index[:n]] by Gauss-Newton steps of robust weighted squares, in place.

    Returns
    -------
    float
        Robust mean square of the distances before the last step.

    Notes
    -----
    Moving the surface by t and turning it by ω about its point changes the distance by −n·t − ((p − c) × n)·ω, whatever its shape; what
    leaves the surface in place is held by a ridge. Weights (1 + (d/3s)²)⁻² (Geman and McClure), s the larger of noise and rms.
    """
    if int(m[0]) == PATCH:
        return fit_patch(m, points, index, n, sigma, rounds)
    near, centre, size = _taken(points, index, n, max(1, n // MOST))
    return _steps(m, near, centre, size, sigma, rounds)


@kernel
def settle(m, points, index, n, sigma):
    """Fit a model that is nearly right to all points, in place.

    What a fit to one point in k leaves is k half parameters' worth of misfit more, by chance: in large regions more than what models
    compete by.
    """
    if int(m[0]) != PATCH and n >= 2 * MOST:
        near, centre, size = _taken(points, index, n, 1)
        _steps(m, near, centre, size, sigma, 2)


@kernel
def _steps(m, near, centre, size, sigma, rounds):
    kind = int(m[0])
    behind = 6 if kind == PLANE else UNKNOWNS  # the column of the distance
    columns = np.zeros((UNKNOWNS + 2, BLOCK))
    a, step = np.empty((UNKNOWNS + 2, UNKNOWNS + 2)), np.empty(UNKNOWNS)
    spread = 4.0 * sigma
    square = 0.0
    for _ in range(rounds):
        _slide(m, centre)
        a[:] = 0.0
        weights = 0.0
        for start in range(0, near.shape[1], BLOCK):
            stop = min(start + BLOCK, near.shape[1])
            _differentiate(m, near[:, start:stop], size, behind, columns)
            weights += _weigh(columns, stop - start, behind, 3.0 * spread)
            _sum_products(columns, behind, a)
        square = a[behind, behind] / max(weights, 1e-300)
        spread = max(sigma, min(spread, np.sqrt(square)))
        step[:] = 0.0
        for p in range(behind):
            step[p] = -a[behind, p]
        solve_damped(a, step, behind, _RIDGE)
        _move(m, step, size)
    return square


@kernel
def _taken(points, index, n, stride):
    """Copy the points that a fit reads; return them (3, K), their mean (3,) and their extent about it."""
    count = (n + stride - 1) // stride
    near, centre = np.empty((3, count)), np.zeros(3)
    for k in range(count):
        i = index[k * stride]
        for c in range(3):
            near[c, k] = points[i, c]
            centre[c] += points[i, c]
    centre /= count
    square = 0.0
    for k in range(count):
        square += (near[0, k] - centre[0]) ** 2 + (near[1, k] - centre[1]) ** 2 + (near[2, k] - centre[2]) ** 2
    return near, centre, max(np.sqrt(square / count), 1e-9)


@kernel
def _slide(m, centre):
    """Slide the point of a plane, cylinder or cone to amid the data."""
    kind = int(m[0])
    along = (centre[0] - m[1]) * m[4] + (centre[1] - m[2]) * m[5] + (centre[2] - m[3]) * m[6]
    if kind == PLANE:
        m[1], m[2], m[3] = centre[0] - along * m[4], centre[1] - along * m[5], centre[2] - along * m[6]
    elif kind in (CYLINDER, CONE):
        m[1] += along * m[4]
        m[2] += along * m[5]
        m[3] += along * m[6]
        if kind == CONE:
            m[7] += along * np.tan(m[8])


@kernel
def _differentiate(m, near, size, behind, columns):
    """Write the derivatives of distances by pose and shape, behind them the distances, and zeros behind the last point."""
    kind = int(m[0])
    ax, ay, az, radius, tube = m[4], m[5], m[6], m[7], m[8]
    cosine, sine = np.cos(m[8]), np.sin(m[8])
    xs, ys, zs = near[0], near[1], near[2]
    by_x, by_y, by_z, turn_x, turn_y, turn_z = columns[0], columns[1], columns[2], columns[3], columns[4], columns[5]
    by_first, by_second = columns[6], columns[7]
    distance = columns[behind]
    for k in range(len(xs)):
        x, y, z = xs[k] - m[1], ys[k] - m[2], zs[k] - m[3]
        along = x * ax + y * ay + z * az
        first, second = -1.0, 0.0
        if kind == PLANE:
            d, nx, ny, nz = along, ax, ay, az
        elif kind == SPHERE:
            length = np.sqrt(x * x + y * y + z * z) + 1e-30
            d, nx, ny, nz = length - radius, x / length, y / length, z / length
        else:
            ux, uy, uz = x - along * ax, y - along * ay, z - along * az
            rho = np.sqrt(ux * ux + uy * uy + uz * uz) + 1e-30
            ux, uy, uz = ux / rho, uy / rho, uz / rho
            across = rho - radius
            if kind == CYLINDER:
                d, nx, ny, nz = across, ux, uy, uz
            else:
                c, s = cosine, -sine
                if kind == CONE:
                    d = across * c + along * s
                    first, second = -c, (across * s - along * c) / size
                else:
                    length = np.sqrt(across * across + along * along) + 1e-30
                    c, s = across / length, along / length
                    d, first, second = length - tube, -c, -1.0
                nx, ny, nz = c * ux + s * ax, c * uy + s * ay, c * uz + s * az
        by_x[k], by_y[k], by_z[k] = -nx, -ny, -nz
        turn_x[k], turn_y[k], turn_z[k] = (z * ny - y * nz) / size, (x * nz - z * nx) / size, (y * nx - x * ny) / size
        if kind != PLANE:
            by_first[k], by_second[k] = first, second
        distance[k] = d
    columns[:, len(xs) :] = 0.0


@kernel
def _weigh(columns, n, behind, scale):
    """Multiply the rows of a block by the roots of their weights; return the sum of the weights."""
    weights = 0.0
    for k in range(n):
        t = columns[behind, k] / scale
        root = 1.0 / (1.0 + t * t)
        weights += root * root
        for p in range(behind + 1):
            columns[p, k] *= root
    return weights


@kernel
def _sum_products(columns, behind, a):
    """Add the sums of the products of every two columns, up to those of the distance, to the lower half of a matrix."""
    for p in range(0, behind + 1, 2):
        u, v = columns[p], columns[p + 1]
        for q in range(0, p + 2, 2):
            s, t = columns[q], columns[q + 1]
            us, ut, vs, vt = 0.0, 0.0, 0.0, 0.0
            for k in range(BLOCK):
                us += u[k] * s[k]
                ut += u[k] * t[k]
                vs += v[k] * s[k]
                vt += v[k] * t[k]
            a[p, q] += us
            a[p, q + 1] += ut
            a[p + 1, q] += vs
            a[p + 1, q + 1] += vt


@kernel
def _move(m, step, size):
    kind = int(m[0])
    for k in range(3):
        m[1 + k] += max(min(step[k], 5.0 * size), -5.0 * size)
    wx, wy, wz = step[3] / size, step[4] / size, step[5] / size
    turn = np.sqrt(wx * wx + wy * wy + wz * wz)
    if turn > 0.5:
        wx, wy, wz = 0.5 * wx / turn, 0.5 * wy / turn, 0.5 * wz / turn
    ax, ay, az = m[4], m[5], m[6]
    m[4], m[5], m[6] = ax + wy * az - wz * ay, ay + wz * ax - wx * az, az + wx * ay - wy * ax
    length = np.sqrt(m[4] * m[4] + m[5] * m[5] + m[6] * m[6])
    for k in range(4, 7):
        m[k] /= length
    if kind in (CYLINDER, SPHERE, TORUS):
        m[7] += max(min(step[6], 5.0 * size), -0.7 * m[7])
    if kind == TORUS:
        m[8] += max(min(step[7], 5.0 * size), -0.7 * m[8])
    if kind == CONE:
        m[7] += step[6]
        m[8] = max(min(m[8] + max(min(step[7] / size, 0.3), -0.3), 1.5), -1.5)
