"""How much normals differ about each point: a quantile of the angles to its neighbours' normals, or only whether that is large."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.candidates import COLUMNS, LANES, bounds
from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges, summing

CELLS_PER_RANGE = 128
# Position and normal of a candidate, in a table whose rows fill whole vectors with points far away.
_ROWS, _FAR = 6, np.float32(1e9)


def normal_differences(
    cells: Cells, normals: NDArray[np.float64], radius: float, quantile: float, *, progress: Progress | None = None
) -> NDArray[np.float64]:
    """Measure how much normals differ about each point: a quantile of the angles between its normal and its neighbours'.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals as lines, in sorted order; NaN where undefined.
    radius : float
        Neighbours are the points closer than that, in the points' unit.
    quantile : float
        In (0, 1]; 1 is the largest difference.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    (N,) float64
        Degrees in [0, 90]; NaN where the normal is undefined or no neighbour has one.
    """
    out = np.full(len(cells.points), np.nan)
    run_ranges(
        lambda start, stop: _differences(cells, normals, float(radius), float(quantile), start, stop, out),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return out


@kernel
def _differences(cells, normals, radius, quantile, start, stop, out):
    points = cells.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    least = np.empty(1024)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        for k in range(3):
            low[k] -= radius
            high[k] += radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
            least = np.empty(2 * room)
        n = points_in_box(points, runs, n_runs, low, high, indices)
        for i in range(first, end):
            found = 0
            for j in range(n):
                q = indices[j]
                dx, dy, dz = points[q, 0] - points[i, 0], points[q, 1] - points[i, 1], points[q, 2] - points[i, 2]
                if q == i or dx * dx + dy * dy + dz * dz >= radius * radius:
                    continue
                dot = normals[i, 0] * normals[q, 0] + normals[i, 1] * normals[q, 1] + normals[i, 2] * normals[q, 2]
                if not np.isnan(dot):
                    least[found] = min(abs(dot), 1.0)
                    found += 1
            if found > 0:
                ordered = np.sort(least[:found])
                rank = int(np.ceil(quantile * found)) - 1
                out[i] = np.degrees(np.arccos(ordered[found - 1 - rank]))


def normals_differ(
    cells: Cells, normals: NDArray[np.float64], radius: float, quantile: float, angle: float, *, progress: Progress | None = None
) -> NDArray[np.int8]:
    """Tell where `normal_differences` is larger than an angle, without measuring it: four times faster.

    Parameters
    ----------
    cells, normals, radius, quantile, progress
        As for `normal_differences`.
    angle : float
        Degrees.

    Returns
    -------
    (N,) int8
        1 where the quantile of the angles is larger, 0 where it is not, −1 where it is undefined.

    Notes
    -----
    The quantile is larger where too few of the angles are not: they are counted, branch-free, in float32. Angles within
    0.001 degrees of the threshold may fall to either side.
    """
    out = np.empty(len(cells.points), np.int8)
    cosine = np.float32(np.cos(np.radians(angle)))
    run_ranges(
        lambda start, stop: _differ(cells, normals, float(radius), float(quantile), cosine, start, stop, out),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return out


@kernel
def _differ(cells, normals, radius, quantile, cosine, start, stop, out):
    points = cells.points
    low, high, centre, p = np.empty(3), np.empty(3), np.empty(3), np.empty(_ROWS, np.float32)
    runs = np.empty((64, 2), np.int64)
    indices, table = np.empty(COLUMNS, np.int64), np.empty((_ROWS, COLUMNS), np.float32)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        for k in range(3):
            centre[k] = 0.5 * (low[k] + high[k])
            low[k] -= radius
            high[k] += radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room + LANES > len(indices):
            # An odd number of vectors a row: rows a power of two apart would share the same few lines of the cache.
            room = (2 * room // LANES | 1) * LANES
            indices, table = np.empty(room, np.int64), np.empty((_ROWS, room), np.float32)
        n = _fill(points, normals, centre, radius, points_in_box(points, runs, n_runs, low, high, indices), indices, table)
        for i in range(first, end):
            if np.isnan(normals[i, 0]):
                out[i] = -1
                continue
            for k in range(3):
                p[k] = np.float32((points[i, k] - centre[k]) / radius)
                p[3 + k] = np.float32(normals[i, k])
            near, alike = _count(table, n, p, cosine)
            # The point itself is among them.
            near, alike = near - 1, alike - 1
            out[i] = -1 if near == 0 else np.int8(alike < np.ceil(quantile * near))


@kernel
def _fill(points, normals, centre, radius, n, indices, table):
    """Write position, in units of the radius, and normal of the candidates that have one; return the number of columns."""
    kept = 0
    for j in range(n):
        i = indices[j]
        for k in range(3):
            table[k, kept] = np.float32((points[i, k] - centre[k]) / radius)
            table[3 + k, kept] = np.float32(normals[i, k])
        kept += not np.isnan(normals[i, 0])
    filled = -(-kept // LANES) * LANES
    for j in range(kept, filled):
        for k in range(_ROWS):
            table[k, j] = _FAR
    return filled


@summing
def _count(table, n, p, cosine):
    """Return how many candidates lie within the radius, and how many of these have a normal that differs by no more than the angle."""
    x, y, z, u, v, w = table[0], table[1], table[2], table[3], table[4], table[5]
    px, py, pz, pu, pv, pw = p[0], p[1], p[2], p[3], p[4], p[5]
    near, alike = np.int32(0), np.int32(0)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        inside = dx * dx + dy * dy + dz * dz < np.float32(1.0)
        same = abs(u[j] * pu + v[j] * pv + w[j] * pw) >= cosine
        near += np.int32(inside)
        alike += np.int32(inside & same)
    return near, alike
