"""The k nearest neighbours of every point, from the cell index."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.candidates import COLUMNS, bounds, gather
from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import Progress, inlined, kernel, run_ranges

CELLS_PER_RANGE = 128


def nearest_neighbours(
    cells: Cells, k: int, *, reach: float | None = None, progress: Progress | None = None
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Find the k nearest other points of every point.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    k : int
        Neighbours a point.
    reach : float, optional
        First guess of the distance within which they lie; half a cell by default. It changes the time, not the result.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    index : (N, k) int32
        Sorted points by increasing distance, ties by index; −1 where the cloud has no more points.
    distance : (N, k) float64
        Their distances; infinite where there is none.
    """
    n = len(cells.points)
    index = np.full((n, k), -1, np.int32)
    distance = np.full((n, k), np.inf)
    start_reach = float(reach) if reach else 0.5 * cells.size
    run_ranges(
        lambda start, stop: _nearest(cells, start_reach, start, stop, index, distance),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return index, distance


def nearest_distance(cells: Cells, *, reach: float, progress: Progress | None = None) -> NDArray[np.float64]:
    """Find how far the nearest other point of every point is: the terms of eq. 2.1, many times faster than their neighbours.

    Parameters
    ----------
    cells : Cells
        At least two distinct sorted points.
    reach : float
        First guess of the distance; it changes the time, not the result.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    (N,) float64
        Distances, in the order of the sorted points.
    """
    out = np.empty(len(cells.points))
    run_ranges(
        lambda start, stop: _nearest_distance(cells, float(reach), start, stop, out),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return out


@kernel
def _nearest_distance(cells, start_reach, start, stop, out):
    points = cells.points
    most = 4.0 * cells.size * max(cells.shape[0], cells.shape[1], cells.shape[2])
    centre, low, high = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    table = np.empty((3, COLUMNS))
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        out[first:end] = np.inf
        reach, left = start_reach, end - first
        while left > 0:
            scale = 1.0 / reach
            bounds(points, first, end, low, high)
            runs, table, n = gather(cells, low, high, reach, scale, centre, runs, table)
            x, y, z = table[0], table[1], table[2]
            left = 0
            for i in range(first, end):
                if out[i] == np.inf:
                    px, py, pz = (points[i, 0] - centre[0]) * scale, (points[i, 1] - centre[1]) * scale, (points[i, 2] - centre[2]) * scale
                    square = _least_square(x, y, z, n, px, py, pz)
                    if square <= 1.0:
                        out[i] = np.sqrt(square) * reach
                    elif reach > most:
                        out[i] = 0.0  # closer than rounding can tell
                    else:
                        left += 1
            reach *= 2.0


@inlined
def _least_square(x, y, z, n, px, py, pz):
    """Return the least squared distance that is not 0."""
    # Positive numbers are ordered as the integers of the same bits; only minima of integers become vector instructions here.
    most = np.float64(np.inf).view(np.int64)
    least = most
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        square = dx * dx + dy * dy + dz * dz
        bits = np.float64(square).view(np.int64)
        bits = bits if square > 0.0 else most
        least = bits if bits < least else least
    return np.int64(least).view(np.float64)


@kernel
def _nearest(cells, start_reach, start, stop, index, distance):
    points, n_all, k = cells.points, len(cells.points), index.shape[1]
    low, high = np.empty(3), np.empty(3)
    box_low, box_high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    x, y, z, square = np.empty(1024), np.empty(1024), np.empty(1024), np.empty(1024)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        reach, left = start_reach, end - first
        while left > 0:
            for a in range(3):
                box_low[a] = low[a] - reach
                box_high[a] = high[a] + reach
            runs, n_runs, room = runs_in_box(cells, box_low, box_high, runs)
            if room > len(indices):
                indices = np.empty(2 * room, np.int64)
                x, y, z, square = np.empty(2 * room), np.empty(2 * room), np.empty(2 * room), np.empty(2 * room)
            n = points_in_box(points, runs, n_runs, box_low, box_high, indices)
            if n <= k and n < n_all:
                reach *= 2.0
                continue
            for j in range(n):
                i = indices[j]
                x[j], y[j], z[j] = points[i, 0], points[i, 1], points[i, 2]
            bound = reach * reach if n < n_all else np.inf
            left = 0
            for i in range(first, end):
                if index[i, k - 1] >= 0:
                    continue
                found = _k_least(x, y, z, n, points[i, 0], points[i, 1], points[i, 2], i, i, indices, square, index, distance)
                # Beyond the reach a nearer point may lie outside the box: such a list does not count yet.
                if distance[i, k - 1] > bound and n < n_all:
                    index[i, k - 1] = -1
                    left += 1
                else:
                    for a in range(found):
                        distance[i, a] = np.sqrt(distance[i, a])
            reach *= 2.0


@kernel
def _k_least(x, y, z, n, px, py, pz, row, leave_out, indices, square, index, distance):
    """Write the candidates nearest to p, but for one, and their squared distances into a row; return how many there are."""
    k = index.shape[1]
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        square[j] = dx * dx + dy * dy + dz * dz
    for a in range(k):
        distance[row, a] = np.inf
        index[row, a] = -1
    found = 0
    worst = np.inf
    for j in range(n):
        if square[j] >= worst or indices[j] == leave_out:
            continue
        a = min(found, k - 1)
        while a > 0 and distance[row, a - 1] > square[j]:
            distance[row, a] = distance[row, a - 1]
            index[row, a] = index[row, a - 1]
            a -= 1
        distance[row, a] = square[j]
        index[row, a] = np.int32(indices[j])
        found = min(found + 1, k)
        if found == k:
            worst = distance[row, k - 1]
    return found


def nearest_to(cells: Cells, queries: NDArray[np.float64], k: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Find the k points of the cloud nearest to each of a few places.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    queries : (Q, 3) float64
        Places; a place that is itself a point finds itself first.
    k : int
        Points a place.

    Returns
    -------
    index : (Q, k) int32
        Sorted points by increasing distance; −1 where the cloud has no more points.
    distance : (Q, k) float64
        Their distances; infinite where there is none.
    """
    index = np.full((len(queries), k), -1, np.int32)
    distance = np.full((len(queries), k), np.inf)
    queries = np.ascontiguousarray(queries)  # one compilation serves all
    run_ranges(lambda start, stop: _nearest_to(cells, queries, start, stop, index, distance), len(queries), size=64)
    return index, distance


@kernel
def _nearest_to(cells, queries, start, stop, index, distance):
    points, n_all, k = cells.points, len(cells.points), index.shape[1]
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    x, y, z, square = np.empty(1024), np.empty(1024), np.empty(1024), np.empty(1024)
    for q in range(start, stop):
        reach, done = 0.5 * cells.size, False
        while not done:
            for a in range(3):
                low[a], high[a] = queries[q, a] - reach, queries[q, a] + reach
            runs, n_runs, room = runs_in_box(cells, low, high, runs)
            if room > len(indices):
                indices = np.empty(2 * room, np.int64)
                x, y, z, square = np.empty(2 * room), np.empty(2 * room), np.empty(2 * room), np.empty(2 * room)
            n = points_in_box(points, runs, n_runs, low, high, indices)
            if n >= k or n == n_all:
                for j in range(n):
                    i = indices[j]
                    x[j], y[j], z[j] = points[i, 0], points[i, 1], points[i, 2]
                found = _k_least(x, y, z, n, queries[q, 0], queries[q, 1], queries[q, 2], q, -1, indices, square, index, distance)
                if n == n_all or distance[q, k - 1] <= reach * reach:
                    done = True
                    for a in range(found):
                        distance[q, a] = np.sqrt(distance[q, a])
            reach *= 2.0
