"""Points summed up by small cells: what a ball of hundreds of points is made of where its points are too many."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.candidates import LANES, list_near
from scan2nurbs.kernels.cells import Cells, build_cells, runs_in_box
from scan2nurbs.kernels.runner import inlined, run_ranges, summing

_RANGE = 1 << 12
_MOST_PARTS = 8
_TINY = np.float32(1e-9)

# Rows of a table of clusters: x, y, z of the mean, four rows of shares, nine of sums about the centre of the table (x to zz), and
# behind them those of the weights.
_SHARES, _SUMS, _WEIGHTS = 3, 7, 16
CLUSTER_ROWS = _WEIGHTS + 8


class Clusters(NamedTuple):
    """What stands for the points of large balls.

    Attributes
    ----------
    cells : Cells
        The means of clusters of points.
    weights : (M, 8) float32
        Of each cluster, in the order of the sorted means, the number of its points, their summed products xx, xy, xz, yy, yz, zz
        about their mean in units of the radius, and 1 over the width of a square plate with the same variance, in radii.
    size : float
        Edge length of the clusters' cells, in the points' unit; 0 where there are no clusters.
    """

    cells: Cells
    weights: NDArray[np.float32]
    size: float


def cluster(cells: Cells, size: float, radius: float) -> Clusters:
    """Sum up the points by cubes of an edge length of at most 1.2 `size`: parts of cells, or cells of their own.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    size : float
        In the points' unit.
    radius : float
        The unit of the weights' lengths.
    """
    if not 0.75 * size <= cells.size <= _MOST_PARTS * size:
        cells = build_cells(cells.points, size)
    parts = max(math.ceil(cells.size / size - 0.2), 1)
    n = len(cells.cell_key)
    counts = np.empty(n, np.int64)
    nothing, no_weights = np.empty((0, 3)), np.empty((0, 8), np.float32)
    run_ranges(lambda start, stop: _cluster(cells, parts, radius, start, stop, counts, nothing, no_weights), n, size=_RANGE)
    starts = np.concatenate([[0], np.cumsum(counts)])
    mean, weights = np.empty((starts[-1], 3)), np.empty((starts[-1], 8), np.float32)
    run_ranges(lambda start, stop: _cluster(cells, parts, radius, start, stop, starts, mean, weights), n, size=_RANGE)
    means = cells._replace(points=mean, order=np.empty(0, np.int32), cell_start=starts)
    return Clusters(means, weights, cells.size / parts)


@summing
def _cluster(cells, parts, radius, start, stop, starts, mean, weights):
    """Count the clusters of cells; or, where there is room for them, write them from each cell's start on."""
    points, scale = cells.points, 1.0 / radius
    sums = np.empty((parts**3, 10))
    for cell in range(start, stop):
        key = cells.cell_key[cell]
        ix, iy, iz = key % cells.shape[0], key // cells.shape[0] % cells.shape[1], key // (cells.shape[0] * cells.shape[1])
        x, y, z = cells.low[0] + ix * cells.size, cells.low[1] + iy * cells.size, cells.low[2] + iz * cells.size
        for part in range(parts**3):
            for k in range(10):
                sums[part, k] = 0.0
        for i in range(cells.cell_start[cell], cells.cell_start[cell + 1]):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            px, py, pz = parts * dx / cells.size, parts * dy / cells.size, parts * dz / cells.size
            px, py, pz = min(max(int(px), 0), parts - 1), min(max(int(py), 0), parts - 1), min(max(int(pz), 0), parts - 1)
            s = sums[(pz * parts + py) * parts + px]
            dx, dy, dz = dx * scale, dy * scale, dz * scale
            s[0] += 1.0
            s[1] += dx
            s[2] += dy
            s[3] += dz
            s[4] += dx * dx
            s[5] += dx * dy
            s[6] += dx * dz
            s[7] += dy * dy
            s[8] += dy * dz
            s[9] += dz * dz
        n = 0
        for part in range(len(sums)):
            s = sums[part]
            if s[0] == 0.0:
                continue
            if len(mean) > 0:
                _describe(s, x, y, z, radius, mean[starts[cell] + n], weights[starts[cell] + n])
            n += 1
        if len(mean) == 0:
            starts[cell] = n


@inlined
def _describe(s, x, y, z, radius, mean, weights):
    count = s[0]
    mx, my, mz = s[1] / count, s[2] / count, s[3] / count
    mean[0], mean[1], mean[2] = x + radius * mx, y + radius * my, z + radius * mz
    xx, xy, xz = max(s[4] - mx * s[1], 0.0), s[5] - mx * s[2], s[6] - mx * s[3]
    yy, yz, zz = max(s[7] - my * s[2], 0.0), s[8] - my * s[3], max(s[9] - mz * s[3], 0.0)
    weights[0], weights[1], weights[2], weights[3], weights[4], weights[5], weights[6] = count, xx, xy, xz, yy, yz, zz
    weights[7] = 1.0 / (np.sqrt(6.0 * (xx + yy + zz) / count) + 1e-6)


@summing
def gather_clusters(clusters, low, high, radius, centre, runs, indices, table):
    """Copy the clusters that balls about the points of a box may hold, and their sums about its centre, in units of the radius.

    Parameters
    ----------
    clusters : Clusters
    low, high : (3,) float64
        Corners of the box; they come back moved apart by the radius.
    radius : float
        In the points' unit.
    centre : (3,) float64
        Receives the centre of the box.
    runs, indices : (K, 2), (K,) int64
        Scratch; larger arrays are returned where they are too small.
    table : (CLUSTER_ROWS, M) float32
        Receives the clusters; a larger array is returned where it is too small.

    Returns
    -------
    runs, indices, table : arrays
    n : int
        How many columns are filled: a multiple of `LANES`, the last ones with clusters of no points.
    """
    half = np.empty(3)
    reach = radius + 0.5 * clusters.size
    for k in range(3):
        centre[k] = 0.5 * (low[k] + high[k])
        half[k] = 0.5 * (high[k] - low[k])
        low[k] -= reach
        high[k] += reach
    means, weights = clusters.cells.points, clusters.weights
    runs, n_runs, room = runs_in_box(clusters.cells, low, high, runs)
    if room + LANES > len(indices):
        indices = np.empty(2 * room + LANES, np.int64)
    n = list_near(means, runs, n_runs, centre, half, reach, indices)
    if n + LANES > table.shape[1]:
        # As narrow as can be, so that all rows fit into the first-level cache.
        table = np.empty((len(table), (n // LANES + 2 | 1) * LANES), np.float32)
    scale = 1.0 / radius
    for j in range(n):
        i = indices[j]
        x = np.float32((means[i, 0] - centre[0]) * scale)
        y = np.float32((means[i, 1] - centre[1]) * scale)
        z = np.float32((means[i, 2] - centre[2]) * scale)
        w = weights[i, 0]
        wx, wy, wz = w * x, w * y, w * z
        table[0, j], table[1, j], table[2, j] = x, y, z
        table[7, j], table[8, j], table[9, j] = wx, wy, wz
        table[10, j], table[11, j], table[12, j] = wx * x + weights[i, 1], wx * y + weights[i, 2], wx * z + weights[i, 3]
        table[13, j], table[14, j], table[15, j] = wy * y + weights[i, 4], wy * z + weights[i, 5], wz * z + weights[i, 6]
        for k in range(8):
            table[_WEIGHTS + k, j] = weights[i, k]
    filled = -(-n // LANES) * LANES
    for k in range(CLUSTER_ROWS):
        for j in range(n, filled):
            table[k, j] = 0.0
    return runs, indices, table, filled


@summing
def ball_sums_of_clusters(table, n, local, m, sums):
    """Sum the clusters of the balls of radius 1 about m points (3, m), each about its own point, into (10, m).

    Notes
    -----
    Of a cluster that the sphere cuts, that share lies inside which a uniform distribution as wide, towards p, as its own would have there.
    The mean of what lies inside is nearer to p, and as far aside as the line of regression through the cluster's points: where the
    share alone is counted, normals err twice as far.
    """
    x, y, z, weight = table[0], table[1], table[2], table[_WEIGHTS]
    xx, xy, xz, yy, yz, zz = table[17], table[18], table[19], table[20], table[21], table[22]
    share, dx, dy, dz = table[_SHARES], table[_SHARES + 1], table[_SHARES + 2], table[_SHARES + 3]
    for q in range(m):
        _inside_of_ball(x, y, z, n, local[0, q], local[1, q], local[2, q], weight, xx, xy, xz, yy, yz, zz, share, dx, dy, dz)
        _sum_inside(share, weight, dx, dy, dz, n, xx, xy, xz, yy, yz, zz, sums, q)


@inlined
def _inside_of_ball(x, y, z, n, px, py, pz, weight, cxx, cxy, cxz, cyy, cyz, czz, share, to_x, to_y, to_z):
    """Write which share of each cluster is closer than 1 to p, and where, seen from p, the mean of that part is."""
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        square = dx * dx + dy * dy + dz * dz
        ax = cxx[j] * dx + cxy[j] * dy + cxz[j] * dz
        ay = cxy[j] * dx + cyy[j] * dy + cyz[j] * dz
        az = cxz[j] * dx + cyz[j] * dy + czz[j] * dz
        along = ax * dx + ay * dy + az * dz
        along = along if along > zero else zero
        # (1 − d) d = d − d², and the variance along d is dᵀCd / (w d²), of a uniform distribution width² / 12.
        spread = np.sqrt(np.float32(12.0) * along / (weight[j] + _TINY)) + _TINY
        depth = (np.sqrt(square) - square) / spread + half
        s = one if depth > one else (depth if depth > zero else zero)
        back = half * (one - s) * spread / (along + _TINY)
        share[j], to_x[j], to_y[j], to_z[j] = s, dx - back * ax, dy - back * ay, dz - back * az


@inlined
def _sum_inside(share, weight, dx, dy, dz, n, cxx, cxy, cxz, cyy, cyz, czz, sums, q):
    zero = np.float32(0.0)
    count, sx, sy, sz, xx = zero, zero, zero, zero, zero
    for j in range(n):
        w = share[j] * weight[j]
        wx = w * dx[j]
        count += w
        sx += wx
        sy += w * dy[j]
        sz += w * dz[j]
        xx += wx * dx[j] + share[j] * cxx[j]
    xy, xz, yy, yz, zz = zero, zero, zero, zero, zero
    for j in range(n):
        w = share[j] * weight[j]
        wy, wz = w * dy[j], w * dz[j]
        xy += wy * dx[j] + share[j] * cxy[j]
        xz += wz * dx[j] + share[j] * cxz[j]
        yy += wy * dy[j] + share[j] * cyy[j]
        yz += wy * dz[j] + share[j] * cyz[j]
        zz += wz * dz[j] + share[j] * czz[j]
    sums[0, q], sums[1, q], sums[2, q], sums[9, q] = sx, sy, sz, count
    sums[3, q], sums[4, q], sums[5, q], sums[6, q], sums[7, q], sums[8, q] = xx, xy, xz, yy, yz, zz


@summing
def sector_sums_of_clusters(table, n, local, planes, borders, chosen, n_chosen, sums):
    """Sum the clusters of each sector of the balls of radius 1 about some points, about the centre of the table.

    Parameters
    ----------
    table : (CLUSTER_ROWS, M) float32
        As filled by `gather_clusters`.
    n : int
        Columns filled.
    local : (3, m) float32
        The points, as the table has them.
    planes : (7, m) float64
        The planes of their balls.
    borders : (g, 2) float32
        Directions of the borders of sectors in the planes' principal frames.
    chosen : (m,) int64
        Which of the m points.
    n_chosen : int
        How many.
    sums : (10, m * g) float64
        Receives the sums of each sector of each chosen point.

    Notes
    -----
    A cluster is divided among four sectors as a square plate would be; other sectors hold the clusters whose mean they hold.
    """
    g = len(borders)
    x, y, z, weight, dense = table[0], table[1], table[2], table[16], table[23]
    wa, wb, wc, wd = table[3], table[4], table[5], table[6]
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = table[7], table[8], table[9], table[10], table[11], table[12], table[13], table[14], table[15]
    for c in range(n_chosen):
        q, first = chosen[c], g * c
        px, py, pz = local[0, q], local[1, q], local[2, q]
        ex, ey, ez = np.float32(planes[3, q]), np.float32(planes[4, q]), np.float32(planes[5, q])
        fx = np.float32(planes[1, q] * planes[5, q] - planes[2, q] * planes[4, q])
        fy = np.float32(planes[2, q] * planes[3, q] - planes[0, q] * planes[5, q])
        fz = np.float32(planes[0, q] * planes[4, q] - planes[1, q] * planes[3, q])
        if g == 4:
            _share_of_quadrants(x, y, z, dense, n, px, py, pz, ex, ey, ez, fx, fy, fz, wa, wb, wc, wd)
            _two_by_five(wa, wb, s0, s1, s2, s3, s4, n, sums, first, first + 1, 0)
            _two_by_five(wa, wb, s5, s6, s7, s8, weight, n, sums, first, first + 1, 5)
            _two_by_five(wc, wd, s0, s1, s2, s3, s4, n, sums, first + 2, first + 3, 0)
            _two_by_five(wc, wd, s5, s6, s7, s8, weight, n, sums, first + 2, first + 3, 5)
            continue
        for s in range(g):
            a, b = borders[s], borders[(s + 1) % g]
            # Left of the one border and right of the next.
            ux, uy, uz = a[0] * fx - a[1] * ex, a[0] * fy - a[1] * ey, a[0] * fz - a[1] * ez
            vx, vy, vz = b[1] * ex - b[0] * fx, b[1] * ey - b[0] * fy, b[1] * ez - b[0] * fz
            _share_of_wedge(x, y, z, dense, n, px, py, pz, ux, uy, uz, vx, vy, vz, wa)
            _two_by_five(wa, wa, s0, s1, s2, s3, s4, n, sums, first + s, first + s, 0)
            _two_by_five(wa, wa, s5, s6, s7, s8, weight, n, sums, first + s, first + s, 5)


@inlined
def _share_of_quadrants(x, y, z, dense, n, px, py, pz, ux, uy, uz, vx, vy, vz, wa, wb, wc, wd):
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        # 1 − d is (1 − d²) / 2 near the sphere.
        s = half * dense[j] * (one - dx * dx - dy * dy - dz * dz) + half
        u, v = dense[j] * (ux * dx + uy * dy + uz * dz) + half, dense[j] * (vx * dx + vy * dy + vz * dz) + half
        s = one if s > one else (s if s > zero else zero)
        u = one if u > one else (u if u > zero else zero)
        v = one if v > one else (v if v > zero else zero)
        su, sv = s * u, s * v
        suv = su * v
        wa[j], wb[j], wc[j], wd[j] = suv, su - suv, sv - suv, s - su - sv + suv


@inlined
def _share_of_wedge(x, y, z, dense, n, px, py, pz, ux, uy, uz, vx, vy, vz, share):
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        s = half * dense[j] * (one - dx * dx - dy * dy - dz * dz) + half
        s = one if s > one else (s if s > zero else zero)
        share[j] = s if min(ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz) > zero else zero


@inlined
def _two_by_five(u, v, a, b, c, d, e, n, sums, i, j, row):
    """Write the products of two rows of shares with five rows of sums into five rows of columns i and j."""
    zero = np.float32(0.0)
    ua, ub, uc, ud, ue = zero, zero, zero, zero, zero
    va, vb, vc, vd, ve = zero, zero, zero, zero, zero
    for k in range(n):
        ua += u[k] * a[k]
        ub += u[k] * b[k]
        uc += u[k] * c[k]
        ud += u[k] * d[k]
        ue += u[k] * e[k]
        va += v[k] * a[k]
        vb += v[k] * b[k]
        vc += v[k] * c[k]
        vd += v[k] * d[k]
        ve += v[k] * e[k]
    sums[row, j], sums[row + 1, j], sums[row + 2, j], sums[row + 3, j], sums[row + 4, j] = va, vb, vc, vd, ve
    sums[row, i], sums[row + 1, i], sums[row + 2, i], sums[row + 3, i], sums[row + 4, i] = ua, ub, uc, ud, ue
