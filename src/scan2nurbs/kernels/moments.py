"""Normals at a radius, and what VDN compares: planes of sectors of a ball, from streamed sums.

For each cell the candidates within reach are gathered once, as float32 relative to the cell's centre and in units of the
radius; each point of the cell then makes one branch-free pass over them for the ten moments of its ball, and one for those
of the sectors. No neighbour is ever listed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, bounds, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges
from scan2nurbs.kernels.symmetric3 import plane_of_moments

CELLS_PER_RANGE = 128
# Nearer than this part of the radius to a dividing plane counts as on it: the rounding of float32 coordinates.
ON_PLANE = np.float32(1e-6)


class BallPlanes(NamedTuple):
    """Planes of the balls of one radius about every point, in the order of the sorted points.

    Attributes
    ----------
    normal : (N, 3) float64
        Unit normals as lines (the sign carries no meaning); NaN where the ball carries no plane.
    mean : (N, 3) float64
        Mean of the ball's points relative to the point.
    variance : (N,) float64
        Variance of the ball's points along the normal.
    n_points : (N,) int32
        Points in the ball, the point itself included.
    sector_angle : (N,) float64
        Largest angle in degrees between the planes of two sectors; NaN where fewer than two sectors carry a plane.
        Empty unless sectors were asked for.
    """

    normal: NDArray[np.float64]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    n_points: NDArray[np.int32]
    sector_angle: NDArray[np.float64]


def ball_planes(
    cells: Cells, radius: float, *, sectors: int = 0, todo: NDArray[np.bool_] | None = None, progress: Progress | None = None
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
    todo : (N,) bool, optional
        Which sorted points to compute; the others get NaN.
    progress : callable, optional
        Called with (cells done, cells).
    """
    n = len(cells.points)
    result = BallPlanes(
        normal=np.full((n, 3), np.nan),
        mean=np.full((n, 3), np.nan),
        variance=np.full(n, np.nan),
        n_points=np.zeros(n, np.int32),
        sector_angle=np.full(n if sectors else 0, np.nan),
    )
    wanted = np.ones(0, np.bool_) if todo is None else todo
    turn = 2.0 * np.pi * np.arange(sectors) / max(sectors, 1)
    borders = np.stack([np.cos(turn), np.sin(turn)], axis=1).astype(np.float32)
    run_ranges(
        lambda start, stop: _ball_planes(cells, float(radius), borders, wanted, start, stop, *result),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return result


@kernel
def _ball_planes(cells, radius, borders, todo, start, stop, normal, mean, variance, count, sector_angle):
    points = cells.points
    low, high, centre = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    x, y, z = np.empty(1024, np.float32), np.empty(1024, np.float32), np.empty(1024, np.float32)
    sums, plane = np.empty(9), np.empty(11)
    sector_normals = np.empty((len(borders), 3))
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        if len(todo) > 0 and not np.any(todo[first:end]):
            continue
        bounds(points, first, end, low, high)
        for k in range(3):
            centre[k] = 0.5 * (low[k] + high[k])
            low[k] -= radius
            high[k] += radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
            x, y, z = np.empty(2 * room, np.float32), np.empty(2 * room, np.float32), np.empty(2 * room, np.float32)
        n = points_in_box(points, runs, n_runs, low, high, indices)
        for j in range(n):
            i = indices[j]
            x[j] = (points[i, 0] - centre[0]) / radius
            y[j] = (points[i, 1] - centre[1]) / radius
            z[j] = (points[i, 2] - centre[2]) / radius
        for i in range(first, end):
            if len(todo) > 0 and not todo[i]:
                continue
            px = np.float32((points[i, 0] - centre[0]) / radius)
            py = np.float32((points[i, 1] - centre[1]) / radius)
            pz = np.float32((points[i, 2] - centre[2]) / radius)
            inside = _ball_sums(x, y, z, n, px, py, pz, sums)
            count[i] = np.int32(inside)
            if not plane_of_moments(inside, sums, plane):
                continue
            for k in range(3):
                normal[i, k] = plane[k]
                mean[i, k] = plane[6 + k] * radius
            variance[i] = plane[9] * radius * radius
            if len(borders) > 0:
                sector_angle[i] = _sector_angle(x, y, z, n, px, py, pz, plane.copy(), borders, sums, plane, sector_normals)


@kernel
def _ball_sums(x, y, z, n, px, py, pz, sums):
    """Sum the moments of the points closer than 1 to p, about p."""
    zero, one = np.float32(0.0), np.float32(1.0)
    count, sx, sy, sz = zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        w = one if dx * dx + dy * dy + dz * dz < one else zero
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
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8] = sx, sy, sz, xx, xy, xz, yy, yz, zz
    return count


@kernel
def _sector_sums(x, y, z, n, px, py, pz, u, v, sums):
    """Sum the moments, about p, of the points of the ball on the positive sides of the planes through p with normals u and v."""
    zero, one = np.float32(0.0), np.float32(1.0)
    count, sx, sy, sz = zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    ux, uy, uz, vx, vy, vz = u[0], u[1], u[2], v[0], v[1], v[2]
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        inside = dx * dx + dy * dy + dz * dz < one
        left = ux * dx + uy * dy + uz * dz > ON_PLANE
        right = vx * dx + vy * dy + vz * dz > ON_PLANE
        w = one if inside & left & right else zero
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
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8] = sx, sy, sz, xx, xy, xz, yy, yz, zz
    return count


@kernel
def _sector_angle(x, y, z, n, px, py, pz, frame, borders, sums, plane, normals):
    """Return the largest angle between the planes of two sectors (paper, Algorithm 1 and eq. 2.3), in degrees."""
    g = len(borders)
    axis = np.empty(3)
    axis[0] = frame[1] * frame[5] - frame[2] * frame[4]
    axis[1] = frame[2] * frame[3] - frame[0] * frame[5]
    axis[2] = frame[0] * frame[4] - frame[1] * frame[3]
    u, v = np.empty(3, np.float32), np.empty(3, np.float32)
    found = 0
    for s in range(g):
        a, b = borders[s], borders[(s + 1) % g]
        for k in range(3):
            # Left of the border at angle a, and right of the next one: the sector lies between them.
            u[k] = -a[1] * frame[3 + k] + a[0] * axis[k]
            v[k] = b[1] * frame[3 + k] - b[0] * axis[k]
        inside = _sector_sums(x, y, z, n, px, py, pz, u, v, sums)
        # The point itself belongs to each of its sectors; about itself it adds nothing to the sums but one to the count.
        if plane_of_moments(inside + 1.0, sums, plane):
            for k in range(3):
                normals[found, k] = plane[k]
            found += 1
    if found < 2:
        return np.nan
    least = 1.0
    for s in range(found):
        for t in range(s):
            dot = normals[s, 0] * normals[t, 0] + normals[s, 1] * normals[t, 1] + normals[s, 2] * normals[t, 2]
            least = min(least, abs(dot))
    return np.degrees(np.arccos(least))
