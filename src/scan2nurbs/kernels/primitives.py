"""Planes, cylinders, cones, spheres, tori and cubic patches as plain numbers: their distances, and patches through lists of points.

A model is a row of `SIZE` numbers, in units of h: kind, point (3), axis (3), two shape numbers (radius; half-angle or minor radius),
and for patches the direction of u (3), the reach and ten coefficients of w(u, v) / reach.
"""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.runner import kernel

PLANE, CYLINDER, CONE, SPHERE, TORUS, PATCH = range(6)
FREEDOM = (3, 5, 6, 4, 7, 10)
KIND_NAMES = ("plane", "cylinder", "cone", "sphere", "torus", "bspline")
SIZE = 24


@kernel
def distance_of(m, px, py, pz):
    """Return the signed distance of a point from a model and the gradient's three components."""
    kind = int(m[0])
    x, y, z = px - m[1], py - m[2], pz - m[3]
    ax, ay, az = m[4], m[5], m[6]
    if kind == PLANE:
        return x * ax + y * ay + z * az, ax, ay, az
    if kind == SPHERE:
        length = np.sqrt(x * x + y * y + z * z) + 1e-30
        return length - m[7], x / length, y / length, z / length
    along = x * ax + y * ay + z * az
    if kind == PATCH:
        return _patch_distance(m, x, y, z, along)
    x, y, z = x - along * ax, y - along * ay, z - along * az
    rho = np.sqrt(x * x + y * y + z * z) + 1e-30
    x, y, z = x / rho, y / rho, z / rho
    if kind == CYLINDER:
        return rho - m[7], x, y, z
    if kind == CONE:
        c, s = np.cos(m[8]), np.sin(m[8])
        return (rho - m[7]) * c - along * s, c * x - s * ax, c * y - s * ay, c * z - s * az
    across = rho - m[7]
    length = np.sqrt(across * across + along * along) + 1e-30
    c, s = across / length, along / length
    return length - m[8], c * x + s * ax, c * y + s * ay, c * z + s * az


@kernel
def _patch_distance(m, x, y, z, w):
    reach = m[12]
    u = (x * m[9] + y * m[10] + z * m[11]) / reach
    yx, yy, yz = m[5] * m[11] - m[6] * m[10], m[6] * m[9] - m[4] * m[11], m[4] * m[10] - m[5] * m[9]
    v = (x * yx + y * yy + z * yz) / reach
    f = m[13] + u * (m[14] + u * (m[16] + u * m[19])) + v * (m[15] + v * (m[18] + v * m[22])) + u * v * (m[17] + u * m[20] + v * m[21])
    fu = m[14] + u * (2.0 * m[16] + 3.0 * u * m[19]) + v * (m[17] + 2.0 * u * m[20] + v * m[21])
    fv = m[15] + v * (2.0 * m[18] + 3.0 * v * m[22]) + u * (m[17] + u * m[20] + 2.0 * v * m[21])
    scale = 1.0 / np.sqrt(1.0 + fu * fu + fv * fv)
    outside = max(u * u + v * v - 1.5, 0.0) * reach
    d = (w - f * reach) * scale
    d += np.copysign(outside, d)
    return d, scale * (m[4] - fu * m[9] - fv * yx), scale * (m[5] - fu * m[10] - fv * yy), scale * (m[6] - fu * m[11] - fv * yz)


@kernel
def solve_damped(a, b, n, ridge):
    """Solve the symmetric system of the first n rows in place by Cholesky with a ridge; b receives the solution."""
    trace = 0.0
    for i in range(n):
        trace += a[i, i]
    for i in range(n):
        a[i, i] += ridge * trace + 1e-300
    for i in range(n):
        for j in range(i + 1):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            if i == j:
                a[i, i] = np.sqrt(max(s, 1e-300))
            else:
                a[i, j] = s / a[j, j]
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= a[k, i] * b[k]
        b[i] = s / a[i, i]


@kernel
def frame_of(points, index, n, m):
    """Set a model's point to the mean, its axis to the plane's normal and u to any direction across; return the extent along it."""
    cx, cy, cz = 0.0, 0.0, 0.0
    for k in range(n):
        i = index[k]
        cx, cy, cz = cx + points[i, 0], cy + points[i, 1], cz + points[i, 2]
    cx, cy, cz = cx / n, cy / n, cz / n
    c = np.zeros((3, 3))
    reach = 0.0
    for k in range(n):
        i = index[k]
        x, y, z = points[i, 0] - cx, points[i, 1] - cy, points[i, 2] - cz
        c[0, 0] += x * x
        c[0, 1] += x * y
        c[0, 2] += x * z
        c[1, 1] += y * y
        c[1, 2] += y * z
        c[2, 2] += z * z
        reach = max(reach, x * x + y * y + z * z)
    least_vector(c, m[4:7])
    ax, ay, az = m[4], m[5], m[6]
    sign = 1.0 if az >= 0.0 else -1.0
    f = -1.0 / (sign + az)
    m[1], m[2], m[3] = cx, cy, cz
    m[9], m[10], m[11] = 1.0 + sign * ax * ax * f, sign * ax * ay * f, -sign * ax
    return np.sqrt(reach)


@kernel
def least_vector(c, out):
    """Write the unit eigenvector of the least eigenvalue of a symmetric matrix, whose upper half is read, by inverse iteration."""
    trace = c[0, 0] + c[1, 1] + c[2, 2]
    xx, yy, zz = c[0, 0] + 1e-9 * trace + 1e-300, c[1, 1] + 1e-9 * trace + 1e-300, c[2, 2] + 1e-9 * trace + 1e-300
    xy, xz, yz = c[0, 1], c[0, 2], c[1, 2]
    p, q, r = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    s, t, u = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    x, y, z = 0.577, 0.576, 0.579
    for _ in range(40):
        x, y, z = p * x + q * y + r * z, q * x + s * y + t * z, r * x + t * y + u * z
        length = np.sqrt(x * x + y * y + z * z) + 1e-300
        x, y, z = x / length, y / length, z / length
    out[0], out[1], out[2] = x, y, z


@kernel
def fit_patch(m, points, index, n, sigma, rounds):
    """Fit a cubic height field over the points' plane; return the robust mean square."""
    stride = max(1, n // 700)
    m[0] = PATCH
    reach = frame_of(points, index, n, m)
    m[12] = max(reach, 1e-9)
    m[13:23] = 0.0
    terms = 10 if n >= 40 else 6
    a, b, row = np.empty((10, 10)), np.empty(10), np.empty(10)
    vx, vy, vz = m[5] * m[11] - m[6] * m[10], m[6] * m[9] - m[4] * m[11], m[4] * m[10] - m[5] * m[9]
    square = 0.0
    for step in range(max(2, min(rounds, 3))):
        a[:] = 0.0
        b[:] = 0.0
        square, weights = 0.0, 0.0
        for k in range(0, n, stride):
            i = index[k]
            x, y, z = points[i, 0] - m[1], points[i, 1] - m[2], points[i, 2] - m[3]
            w = (x * m[4] + y * m[5] + z * m[6]) / reach
            u, v = (x * m[9] + y * m[10] + z * m[11]) / reach, (x * vx + y * vy + z * vz) / reach
            row[0], row[1], row[2], row[3], row[4] = 1.0, u, v, u * u, u * v
            row[5], row[6], row[7], row[8], row[9] = v * v, u * u * u, u * u * v, u * v * v, v * v * v
            weight = 1.0
            if step > 0:
                d, _, _, _ = distance_of(m, points[i, 0], points[i, 1], points[i, 2])
                t = d / (3.0 * sigma)
                weight = 1.0 / ((1.0 + t * t) * (1.0 + t * t))
                square += weight * d * d
                weights += weight
            for p in range(terms):
                f = weight * row[p]
                b[p] += f * w
                for q in range(p + 1):
                    a[p, q] += f * row[q]
        solve_damped(a, b, terms, 1e-9)
        m[13:23] = 0.0
        for p in range(terms):
            m[13 + p] = b[p]
        if step > 0:
            square /= max(weights, 1e-300)
    return square
