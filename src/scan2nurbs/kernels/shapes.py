"""Distances of plane, cylinder, cone, sphere and torus, and the normal equations of their least-squares fits, in one pass.

A shape is given by a pose and two numbers. The pose is (origin, x, y, z), 12 floats, the frame in which its parameters are increments:
shifts along x, y and z, tilts of z towards x and towards y, and two of its own (`a`, `b`):

    plane     z the normal
    cylinder  z the axis, a the radius
    cone      z the axis, a the radius at the origin, b the half angle; it widens along z
    sphere    a the radius
    torus     z the axis, a the major radius, b the minor one

Moving a distance field rigidly changes it by −n·(t + ω × (p − o)), whatever the shape: so the columns of shifts and tilts need its normal only.
"""

from __future__ import annotations

import math

from scan2nurbs.kernels.runner import kernel

PLANE, CYLINDER, CONE, SPHERE, TORUS = range(5)
N_COLUMNS = 7


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
def normal_equations(points, weights, kind, pose, a, b, cut, out, row):
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
        Receives the upper triangle of the sum of w·gᵀg, where g is the derivatives by the 7 parameters followed by the distance.
    row : (8,) float64
        Workspace.

    Returns
    -------
    (cost, total) : float
        Σ weight·ρ(d) and Σ w. ρ is d² near zero and cut²/3 beyond the cut.
    """
    for i in range(8):
        for j in range(8):
            out[i, j] = 0.0
    cost, total = 0.0, 0.0
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
        total += weight
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
    return cost, total
