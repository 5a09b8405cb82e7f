"""Normals at a radius, and what VDN compares: planes of sectors of a ball, from streamed sums.

For each cell the candidates within reach are gathered once, as float32 relative to the cell's centre and in units of the
radius; each point of the cell then makes branch-free passes over them: which lie in its ball, in which sector of it, and the
sums of each sector. No neighbour is ever listed. Where balls hold thousands of points the candidates are clusters of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import COLUMNS, Cells, bounds, gather
from scan2nurbs.kernels.clusters import Sources, cluster
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges
from scan2nurbs.kernels.symmetric3 import normals_of_moments, plane_of_moments

CELLS_PER_RANGE = 256
WIDENING = 2.0**0.5
# Nearer than this part of the radius to a dividing plane counts as on it: the rounding of float32 coordinates.
ON_PLANE = np.float32(1e-6)
# A sector found as a difference of sums keeps enough digits where it holds at least this part of the ball's points.
FEW = 1.0 / 32.0
# Rows of a table of candidates: x, y, z, share of the ball, code; behind them those of the weights of clusters.
POINT_ROWS = 5
TINY = np.float32(1e-9)


# Where a cell of this part of the radius would hold so many points on average, it takes their place: about 2,000 a ball.
CLUSTER = 1.0 / 10.0
CLUSTERED = 5.0


class BallPlanes(NamedTuple):
    """Planes of the balls of one radius about every point, in the order of the sorted points.

    Attributes
    ----------
    normal : (N, 3) float64
        Unit normals as lines (the sign carries no meaning); NaN where the ball carries no plane.
    mean : (N, 3) float64
        Mean of the ball's points relative to the point. Empty where only normals were asked for, as is the variance.
    variance : (N,) float64
        Variance of the ball's points along the normal.
    n_points : (N,) int32
        Points in the ball, the point itself included.
    sector_angle : (N,) float64
        Largest angle in degrees between the planes of two sectors; NaN where fewer than two sectors carry a plane.
        Empty unless sectors were asked for.
    widened : (N,) uint8
        How many times the radius was multiplied by √2 before the ball carried a plane.
    """

    normal: NDArray[np.float64]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    n_points: NDArray[np.int32]
    sector_angle: NDArray[np.float64]
    widened: NDArray[np.uint8]


def ball_planes(
    cells: Cells,
    radius: float,
    *,
    sectors: int = 0,
    widenings: int = 0,
    only_normals: bool = False,
    exact: bool = False,
    todo: NDArray[np.bool_] | None = None,
    progress: Progress | None = None,
) -> BallPlanes:
    """Fit a plane to the points closer than `radius` to each point; with sectors, compare the planes of each ball's parts.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    radius : float
        In the points' unit.
    sectors : int
        0, or the number g >= 2 of sectors around the normal (paper, eq. 2.3; Algorithm 1 for 4).
    widenings : int
        How many times a ball without a plane is widened by √2. Its `n_points` stays that of the narrowest ball, and it has no
        sectors.
    only_normals : bool
        Whether to leave out `mean` and `variance`.
    exact : bool
        Whether each point of a ball is summed, however many there are; else thousands of them are summed up by small cells.
    todo : (N,) bool, optional
        Which sorted points to compute; the others get NaN.
    progress : callable, optional
        Called with (cells done, cells).
    """
    n = len(cells.points)
    described = 0 if only_normals else n
    result = BallPlanes(
        normal=np.empty((n, 3)),
        mean=np.empty((described, 3)),
        variance=np.empty(described),
        n_points=np.empty(n, np.int32),
        sector_angle=np.empty(n if sectors else 0),
        widened=np.empty(n, np.uint8),
    )
    sources = Sources(cells, np.empty((0, 0), np.float32), 0.0)
    density = n / len(cells.cell_key) / cells.size**2
    if not exact and density * (CLUSTER * radius) ** 2 >= CLUSTERED:
        sources = cluster(cells, CLUSTER * radius, radius)
    wanted = np.ones(0, np.bool_) if todo is None else todo
    turn = 2.0 * np.pi * np.arange(sectors) / max(sectors, 1)
    borders = np.stack([np.cos(turn), np.sin(turn)], axis=1).astype(np.float32)
    run_ranges(
        lambda start, stop: _ball_planes(cells, sources, float(radius), widenings, borders, wanted, start, stop, result),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return result


@kernel
def _ball_planes(cells, sources, radius, widenings, borders, todo, start, stop, out):
    centre, low, high = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    table = np.empty((POINT_ROWS + sources.weights.shape[1], COLUMNS), np.float32)
    pending = np.empty(64, np.int64)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        if end - first > len(pending):
            pending = np.empty(2 * (end - first), np.int64)
        n_pending = 0
        for i in range(first, end):
            _clear(out, i)
            if len(todo) == 0 or todo[i]:
                pending[n_pending] = i
                n_pending += 1
        reach = radius
        for step in range(widenings + 1):
            if n_pending == 0:
                break
            bounds(cells.points, first, end, low, high)
            runs, table, n = gather(sources.cells, sources.weights, low, high, reach + 0.5 * sources.size, 1.0 / reach, centre, runs, table)
            # Products of lengths shrink with the square of the unit.
            for k in range(POINT_ROWS + 1, len(table)):
                table[k, :n] *= np.float32((radius / reach) ** 2)
            n_pending = _fit_cell(cells, reach, step, centre, table, n, pending, n_pending, borders, out)
            reach *= WIDENING


@kernel
def _clear(out, i):
    out.n_points[i] = 0
    out.widened[i] = 0
    for k in range(3):
        out.normal[i, k] = np.nan
    if len(out.variance) > 0:
        out.variance[i] = np.nan
        for k in range(3):
            out.mean[i, k] = np.nan
    if len(out.sector_angle) > 0:
        out.sector_angle[i] = np.nan


@kernel
def _fit_cell(cells, reach, step, centre, table, n, pending, n_pending, borders, out):
    """Fit the planes of one cell's pending points; return how many are still without one, moved to the front of `pending`."""
    sums, plane = np.empty(10), np.empty(11)
    scratch, sectors, normals = np.empty(10), np.empty((10, len(borders))), np.empty((3, len(borders)))
    left, scale = 0, 1.0 / reach
    for waiting in range(n_pending):
        i = pending[waiting]
        px = np.float32((cells.points[i, 0] - centre[0]) * scale)
        py = np.float32((cells.points[i, 1] - centre[1]) * scale)
        pz = np.float32((cells.points[i, 2] - centre[2]) * scale)
        _ball_sums(table, n, px, py, pz, sums)
        count = sums[9]
        if step == 0:
            out.n_points[i] = np.int32(count)
        if not plane_of_moments(count, sums, plane):
            pending[left] = i
            left += 1
            continue
        out.widened[i] = step
        for k in range(3):
            out.normal[i, k] = plane[k]
        if len(out.variance) > 0:
            out.variance[i] = plane[9] * reach * reach
            for k in range(3):
                out.mean[i, k] = plane[6 + k] * reach
        if step == 0 and len(borders) > 0:
            out.sector_angle[i] = _sector_angle(table, n, px, py, pz, borders, sums, plane, scratch, sectors, normals)
    return left


@kernel
def _ball_sums(table, n, px, py, pz, sums):
    """Write how much of each candidate lies in the ball about p into row 3 of the table, and sum its moments."""
    x, y, z, inside, code = table[0], table[1], table[2], table[3], table[4]
    if len(table) == POINT_ROWS:
        sums[9] = _ball(x, y, z, n, px, py, pz, inside)
        if sums[9] >= 3.0:
            _sum(x, y, z, n, px, py, pz, inside, 1, sums)
    else:
        w, xx, xy, xz, yy, yz, zz = table[5], table[6], table[7], table[8], table[9], table[10], table[11]
        _ball_of_clusters(x, y, z, n, px, py, pz, w, xx, xy, xz, yy, yz, zz, inside, code)
        _sums(table, n, px, py, pz, 1, sums)


@kernel
def _ball(x, y, z, n, px, py, pz, inside):
    """Write 1 for each point closer than 1 to p, else 0; return how many are."""
    zero, one, count = np.float32(0.0), np.float32(1.0), np.float32(0.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        w = one if dx * dx + dy * dy + dz * dz < one else zero
        inside[j] = w
        count += w
    return count


@kernel
def _ball_of_clusters(x, y, z, n, px, py, pz, weight, cxx, cxy, cxz, cyy, cyz, czz, share, code):
    """Write which share of each cluster is closer than 1 to p, and as its code 1.

    The share is that of a uniform distribution as wide, towards p, as the cluster's own.
    """
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        square = dx * dx + dy * dy + dz * dz
        ax = cxx[j] * dx + cxy[j] * dy + cxz[j] * dz
        ay = cxy[j] * dx + cyy[j] * dy + cyz[j] * dz
        az = cxz[j] * dx + cyz[j] * dy + czz[j] * dz
        # (1 − d) d = d − d², and the variance along d is dᵀCd / (w d²), of a uniform distribution width² / 12.
        spread = np.sqrt(np.float32(12.0) * (ax * dx + ay * dy + az * dz) / (weight[j] + TINY)) + TINY
        depth = (np.sqrt(square) - square) / spread + half
        share[j] = one if depth > one else (depth if depth > zero else zero)
        code[j] = one


@kernel
def _sector_angle(table, n, px, py, pz, borders, ball, plane, sums, sectors, normals):
    """Return the largest angle between the planes of two sectors (paper, Algorithm 1 and eq. 2.3), in degrees.

    `ball` are the sums of the ball that row 3 of the table marks, and lose what the sectors take; `plane` is its plane, which is
    lost as well; `sums`, `sectors` and `normals` are scratch.
    """
    g = len(borders)
    if ball[9] < 5.0:
        return np.nan  # two sectors with a plane hold two points each besides p
    own = 1.0 if len(table) == POINT_ROWS else 0.0  # p is one of the points, but none of the clusters
    on_border = _mark_sectors(table, n, px, py, pz, borders, plane)
    few = FEW * ball[9]
    for s in range(g):
        # What is left of the ball is the last sector, unless other points than p lie on borders or few digits would be left.
        if s == g - 1 and on_border == own and ball[9] - own >= few:
            ball[9] -= own
            sectors[:, s] = ball
        else:
            _sums(table, n, px, py, pz, s + 1, sums)
            for k in range(10):
                ball[k] -= sums[k]
                sectors[k, s] = sums[k]
        # The point itself belongs to each of its sectors; about itself it adds nothing to the sums but one to the count.
        sectors[9, s] += 1.0
    normals_of_moments(sectors, normals)
    least = np.inf
    for s in range(g):
        for t in range(s):
            dot = normals[0, s] * normals[0, t] + normals[1, s] * normals[1, t] + normals[2, s] * normals[2, t]
            least = abs(dot) if abs(dot) < least else least  # false for NaN
    if least == np.inf:
        return np.nan
    return np.degrees(np.arccos(min(least, 1.0)))


@kernel
def _mark_sectors(table, n, px, py, pz, borders, plane):
    """Write the sector of each point of the ball, from 1, into row 4 of the table, and 0 for all others; return how many lie on borders."""
    x, y, z, inside, sector = table[0], table[1], table[2], table[3], table[4]
    ex, ey, ez = np.float32(plane[3]), np.float32(plane[4]), np.float32(plane[5])
    fx = np.float32(plane[1] * plane[5] - plane[2] * plane[4])
    fy = np.float32(plane[2] * plane[3] - plane[0] * plane[5])
    fz = np.float32(plane[0] * plane[4] - plane[1] * plane[3])
    if len(borders) == 4:
        return _mark_quadrants(x, y, z, n, px, py, pz, ex, ey, ez, fx, fy, fz, inside, sector)
    sector[:n] = np.float32(0.0)
    for s in range(len(borders)):
        a, b = borders[s], borders[(s + 1) % len(borders)]
        # Left of the one border and right of the next.
        ux, uy, uz = a[0] * fx - a[1] * ex, a[0] * fy - a[1] * ey, a[0] * fz - a[1] * ez
        vx, vy, vz = b[1] * ex - b[0] * fx, b[1] * ey - b[0] * fy, b[1] * ez - b[0] * fz
        _mark_wedge(x, y, z, n, px, py, pz, ux, uy, uz, vx, vy, vz, inside, np.float32(s + 1), sector)
    return np.float32(-1.0)


@kernel
def _mark_quadrants(x, y, z, n, px, py, pz, ux, uy, uz, vx, vy, vz, inside, sector):
    zero, one, two, on_border = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(0.0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        p, q, w = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz, one if inside[j] > zero else zero
        on_plane = w if min(abs(p), abs(q)) <= ON_PLANE else zero
        sector[j] = (w - on_plane) * (one + (one if p > zero else zero) + (two if q > zero else zero))
        on_border += on_plane
    return on_border


@kernel
def _mark_wedge(x, y, z, n, px, py, pz, ux, uy, uz, vx, vy, vz, inside, number, sector):
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        p, q = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        sector[j] = number if (min(p, q) > ON_PLANE) & (inside[j] > np.float32(0.0)) else sector[j]


@kernel
def _sums(table, n, px, py, pz, which, sums):
    """Sum the moments about p of the points, or of the shares of clusters, with one code in row 4."""
    x, y, z, share, code = table[0], table[1], table[2], table[3], table[4]
    if len(table) == POINT_ROWS:
        _sum(x, y, z, n, px, py, pz, code, which, sums)
    else:
        w, xx, xy, xz, yy, yz, zz = table[5], table[6], table[7], table[8], table[9], table[10], table[11]
        _sum_clusters(x, y, z, n, px, py, pz, code, which, share, w, xx, xy, xz, yy, yz, zz, sums)


@kernel
def _sum(x, y, z, n, px, py, pz, code, which, sums):
    """Sum the moments about p of the points with one code: x, y, z, xx, xy, xz, yy, yz, zz, and their number."""
    zero, one, wanted = np.float32(0.0), np.float32(1.0), np.float32(which)
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
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8], sums[9] = sx, sy, sz, xx, xy, xz, yy, yz, zz, count


@kernel
def _sum_clusters(x, y, z, n, px, py, pz, code, which, share, weight, cxx, cxy, cxz, cyy, cyz, czz, sums):
    """Sum the moments about p of the clusters with one code: those of their means and those about their means."""
    zero, wanted = np.float32(0.0), np.float32(which)
    count, sx, sy, sz = zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for j in range(n):
        m = share[j] if code[j] == wanted else zero
        w = m * weight[j]
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        wx, wy, wz = w * dx, w * dy, w * dz
        count += w
        sx += wx
        sy += wy
        sz += wz
        xx += wx * dx + m * cxx[j]
        xy += wx * dy + m * cxy[j]
        xz += wx * dz + m * cxz[j]
        yy += wy * dy + m * cyy[j]
        yz += wy * dz + m * cyz[j]
        zz += wz * dz + m * czz[j]
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8], sums[9] = sx, sy, sz, xx, xy, xz, yy, yz, zz, count
