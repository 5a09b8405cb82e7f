"""Sums over the points of balls and of their sectors: vector passes over a table of candidates."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.runner import inlined, summing

POINT_ROWS = 4
"""Rows of a table of points: x, y, z, and the sector."""
# Nearer than this part of the radius to a dividing plane counts as on it: the rounding of float32 coordinates.
ON_PLANE = np.float32(1e-6)
# A sector found as a difference of sums keeps enough digits where it holds at least this part of the ball's points.
FEW = 1.0 / 32.0


@summing
def ball_sums(table, border, filled, local, m, limit, sums):
    """Sum the moments of the balls about m points, each about its own point.

    Parameters
    ----------
    table : (POINT_ROWS, M) float32
        Points, as `gather_ball` copies them.
    border, filled : int
        Only points before `border` are tested; all balls hold those from there up to `filled`.
    local : (3, m) float32
        The balls' centres, as the table has them.
    m : int
        Number of balls.
    limit : float32
        Square of the balls' radius.
    sums : (10, m) float64
        Receives the sums of x, y, z, xx, xy, xz, yy, yz, zz, and the number of points.
    """
    x, y, z, zero, one = table[0], table[1], table[2], np.float32(0.0), np.float32(1.0)
    shared = np.zeros(10)
    if filled > border:
        _sum_all(x, y, z, border, filled, shared)
    for q in range(m):
        px, py, pz = local[0, q], local[1, q], local[2, q]
        count, sx, sy, sz = zero, zero, zero, zero
        xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
        for j in range(border):
            dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
            w = one if dx * dx + dy * dy + dz * dz < limit else zero
            wx, wy, wz = w * dx, w * dy, w * dz
            count += w
            sx += wx
            sy += wy
            sz += wz
            xx += wx * dx
            xy += wx * dy
            xz += wx * dz
            yy += wy * dy
            yz += wy * dz
            zz += wz * dz
        sums[0, q], sums[1, q], sums[2, q], sums[9, q] = sx, sy, sz, count
        sums[3, q], sums[4, q], sums[5, q], sums[6, q], sums[7, q], sums[8, q] = xx, xy, xz, yy, yz, zz
    add_shifted(shared, local, 0, m, sums)


@summing
def add_shifted(shared, local, start, stop, sums):
    """Add the same sums about the origin (10,) to the sums about each of some points (10, M)."""
    sx, sy, sz, n = shared[0], shared[1], shared[2], shared[9]
    for q in range(start, stop):
        px, py, pz = np.float64(local[0, q]), np.float64(local[1, q]), np.float64(local[2, q])
        sums[0, q] += sx - n * px
        sums[1, q] += sy - n * py
        sums[2, q] += sz - n * pz
        sums[3, q] += shared[3] - 2.0 * px * sx + n * px * px
        sums[4, q] += shared[4] - px * sy - py * sx + n * px * py
        sums[5, q] += shared[5] - px * sz - pz * sx + n * px * pz
        sums[6, q] += shared[6] - 2.0 * py * sy + n * py * py
        sums[7, q] += shared[7] - py * sz - pz * sy + n * py * pz
        sums[8, q] += shared[8] - 2.0 * pz * sz + n * pz * pz
        sums[9, q] += n


@inlined
def _sum_all(x, y, z, start, stop, sums):
    count, sx, sy, sz = np.float32(stop - start), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    xx, xy, xz, yy, yz, zz = sx, sx, sx, sx, sx, sx
    padded = np.float32(0.0)
    for j in range(start, stop):
        far = x[j] > np.float32(1e6)
        px, py, pz = (np.float32(0.0) if far else x[j]), (np.float32(0.0) if far else y[j]), (np.float32(0.0) if far else z[j])
        padded += np.float32(1.0) if far else np.float32(0.0)
        sx += px
        sy += py
        sz += pz
        xx += px * px
        xy += px * py
        xz += px * pz
        yy += py * py
        yz += py * pz
        zz += pz * pz
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8] = sx, sy, sz, xx, xy, xz, yy, yz, zz
    sums[9] = count - padded


@summing
def sector_sums(table, filled, local, planes, balls, borders, chosen, n_chosen, limit, sums):
    """Sum the moments of the sectors of the balls about some of m points, each about its own point.

    Parameters
    ----------
    table, filled, local, limit
        As for `ball_sums`; row 3 of the table is scratch.
    planes : (7, m) float64
        The balls' planes.
    balls : (10, m) float64
        The balls' sums.
    borders : (g, 2) float32
        Directions of the borders of sectors in the planes' principal frames.
    chosen, n_chosen : (m,) int64, int
        Which of the points, and how many.
    sums : (10, m * g) float64
        Receives the sums of each sector of each ball: of the points between its borders. The point itself is on all of them.
    """
    g = len(borders)
    x, y, z, sector = table[0], table[1], table[2], table[3]
    for c in range(n_chosen):
        q, first = chosen[c], g * c
        px, py, pz = local[0, q], local[1, q], local[2, q]
        on_border = _mark_sectors(x, y, z, filled, px, py, pz, limit, borders, planes, q, sector)
        few = FEW * balls[9, q]
        for k in range(10):
            sums[k, first + g - 1] = balls[k, q]
        sums[9, first + g - 1] -= 1.0  # the point itself
        for s in range(g):
            # What is left of the ball is the last sector, unless other points than p lie on borders or few digits would be left.
            if s == g - 1 and on_border == 1.0 and sums[9, first + s] >= few:
                continue
            _sum(x, y, z, filled, px, py, pz, sector, np.float32(s + 1), sums, first + s)
            if s < g - 1:
                for k in range(10):
                    sums[k, first + g - 1] -= sums[k, first + s]


@inlined
def _mark_sectors(x, y, z, n, px, py, pz, limit, borders, planes, q, sector):
    """Write the sector of each point of the ball, from 1, and 0 for all others; return how many lie on borders."""
    ex, ey, ez = np.float32(planes[3, q]), np.float32(planes[4, q]), np.float32(planes[5, q])
    fx = np.float32(planes[1, q] * planes[5, q] - planes[2, q] * planes[4, q])
    fy = np.float32(planes[2, q] * planes[3, q] - planes[0, q] * planes[5, q])
    fz = np.float32(planes[0, q] * planes[4, q] - planes[1, q] * planes[3, q])
    if len(borders) == 4:
        return _mark_quadrants(x, y, z, n, px, py, pz, limit, ex, ey, ez, fx, fy, fz, sector)
    for j in range(n):
        sector[j] = np.float32(0.0)
    for s in range(len(borders)):
        a, b = borders[s], borders[(s + 1) % len(borders)]
        # Left of the one border and right of the next.
        ux, uy, uz = a[0] * fx - a[1] * ex, a[0] * fy - a[1] * ey, a[0] * fz - a[1] * ez
        vx, vy, vz = b[1] * ex - b[0] * fx, b[1] * ey - b[0] * fy, b[1] * ez - b[0] * fz
        _mark_wedge(x, y, z, n, px, py, pz, limit, ux, uy, uz, vx, vy, vz, np.float32(s + 1), sector)
    return np.float32(-1.0)


@inlined
def _mark_quadrants(x, y, z, n, px, py, pz, limit, ux, uy, uz, vx, vy, vz, sector):
    zero, one, two, on_border = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(0.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        p, q = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        w = one if dx * dx + dy * dy + dz * dz < limit else zero
        on_plane = w if min(abs(p), abs(q)) <= ON_PLANE else zero
        sector[j] = (w - on_plane) * (one + (one if p > zero else zero) + (two if q > zero else zero))
        on_border += on_plane
    return on_border


@inlined
def _mark_wedge(x, y, z, n, px, py, pz, limit, ux, uy, uz, vx, vy, vz, number, sector):
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        p, q = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        sector[j] = number if (min(p, q) > ON_PLANE) & (dx * dx + dy * dy + dz * dz < limit) else sector[j]


@inlined
def _sum(x, y, z, n, px, py, pz, code, wanted, sums, column):
    """Sum the moments about p of the points with one code: x, y, z, xx, xy, xz, yy, yz, zz, and their number."""
    zero, one = np.float32(0.0), np.float32(1.0)
    count, sx, sy, sz = zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for j in range(n):
        w = one if code[j] == wanted else zero
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        wx, wy, wz = w * dx, w * dy, w * dz
        count += w
        sx += wx
        sy += wy
        sz += wz
        xx += wx * dx
        xy += wx * dy
        xz += wx * dz
        yy += wy * dy
        yz += wy * dz
        zz += wz * dz
    sums[0, column], sums[1, column], sums[2, column], sums[9, column] = sx, sy, sz, count
    sums[3, column], sums[4, column], sums[5, column] = xx, xy, xz
    sums[6, column], sums[7, column], sums[8, column] = yy, yz, zz
