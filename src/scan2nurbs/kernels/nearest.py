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
    index, distance = np.empty((n, k), np.int32), np.empty((n, k))
    _search(cells, k, reach, index, distance, _NO_LAST, progress)
    return index, distance


def nearest_indices(cells: Cells, k: int, *, reach: float | None = None, progress: Progress | None = None) -> NDArray[np.int32]:
    """Find the k nearest other points of every point, but not how far they are; see `nearest_neighbours`."""
    index = np.empty((len(cells.points), k), np.int32)
    _search(cells, k, reach, index, _NO_DISTANCE, _NO_LAST, progress)
    return index


def nearest_kth(cells: Cells, k: int, *, reach: float | None = None, progress: Progress | None = None) -> NDArray[np.float64]:
    """Find how far the k-th nearest other point of every point is, (N,) float64; infinite where the cloud has no more points."""
    last = np.empty(len(cells.points))
    _search(cells, k, reach, _NO_INDEX, _NO_DISTANCE, last, progress)
    return last


_NO_INDEX, _NO_DISTANCE, _NO_LAST = np.empty((0, 1), np.int32), np.empty((0, 1)), np.empty(0)


def _search(
    cells: Cells,
    k: int,
    reach: float | None,
    index: NDArray[np.int32],
    distance: NDArray[np.float64],
    last: NDArray[np.float64],
    progress: Progress | None,
) -> None:
    """Fill those of the arrays that are not empty."""
    start_reach = float(reach) if reach else 0.5 * cells.size
    run_ranges(
        lambda start, stop: _nearest(cells, start_reach, start, stop, k, index, distance, last),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )


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
def _nearest(cells, start_reach, start, stop, k, index, distance, last):
    points, n_all = cells.points, len(cells.points)
    low, high = np.empty(3), np.empty(3)
    box_low, box_high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices, kept = np.empty(1024, np.int64), np.empty(1024, np.int64)
    x, y, z, square = np.empty(1024), np.empty(1024), np.empty(1024), np.empty(1024)
    near, far, done = np.empty(k, np.int32), np.empty(k), np.empty(1024, np.bool_)
    within = np.inf
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        reach, left = start_reach, end - first
        if left > len(done):
            done = np.empty(2 * left, np.bool_)
        done[:left] = False
        while left > 0:
            for a in range(3):
                box_low[a] = low[a] - reach
                box_high[a] = high[a] + reach
            runs, n_runs, room = runs_in_box(cells, box_low, box_high, runs)
            if room > len(indices):
                indices, kept = np.empty(2 * room, np.int64), np.empty(2 * room, np.int64)
                x, y, z, square = np.empty(2 * room), np.empty(2 * room), np.empty(2 * room), np.empty(2 * room)
            n = points_in_box(points, runs, n_runs, box_low, box_high, indices)
            if n <= k and n < n_all:
                reach *= 2.0
                continue
            for j in range(n):
                i = indices[j]
                x[j], y[j], z[j] = points[i, 0], points[i, 1], points[i, 2]
            # Beyond the reach a nearer point may lie outside the box: such a list does not count.
            bound = reach * reach if n < n_all else np.inf
            left = 0
            for i in range(first, end):
                if done[i - first]:
                    continue
                _k_least(x, y, z, n, points[i, 0], points[i, 1], points[i, 2], i, indices, square, kept, within, near, far)
                if far[k - 1] > bound:
                    left += 1
                    continue
                done[i - first] = True
                within = 2.0 * far[k - 1]  # the next point's neighbours are hardly farther
                _keep(i, near, far, index, distance, last)
            reach *= 2.0


@inlined
def _keep(row, near, far, index, distance, last):
    if len(index):
        index[row, :] = near
    if len(distance):
        distance[row, :] = np.sqrt(far)
    if len(last):
        last[row] = np.sqrt(far[-1])


@kernel
def _k_least(x, y, z, n, px, py, pz, leave_out, indices, square, kept, within, near, far):
    """Find the candidates nearest to p, but for one: their indices and squared distances.

    Those within a guess are picked out first, without a branch: of the many others none needs to be compared with the nearest so far.
    """
    k = len(near)
    for j in range(n):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        square[j] = dx * dx + dy * dy + dz * dz
    m = 0
    for j in range(n):
        kept[m] = j
        m += square[j] <= within
    if m <= k:
        m = n
        for j in range(n):
            kept[j] = j
    for a in range(k):
        far[a] = np.inf
        near[a] = -1
    found = 0
    worst = np.inf
    for c in range(m):
        j = kept[c]
        if square[j] >= worst or indices[j] == leave_out:
            continue
        a = min(found, k - 1)
        while a > 0 and far[a - 1] > square[j]:
            far[a] = far[a - 1]
            near[a] = near[a - 1]
            a -= 1
        far[a] = square[j]
        near[a] = np.int32(indices[j])
        found = min(found + 1, k)
        if found == k:
            worst = far[k - 1]


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
    index, distance = np.empty((len(queries), k), np.int32), np.empty((len(queries), k))
    queries = np.ascontiguousarray(queries)  # one compilation serves all
    run_ranges(lambda start, stop: _nearest_to(cells, queries, start, stop, index, distance), len(queries), size=64)
    return index, distance


@kernel
def _nearest_to(cells, queries, start, stop, index, distance):
    points, n_all, k = cells.points, len(cells.points), index.shape[1]
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices, kept = np.empty(1024, np.int64), np.empty(1024, np.int64)
    x, y, z, square = np.empty(1024), np.empty(1024), np.empty(1024), np.empty(1024)
    near, far = np.empty(k, np.int32), np.empty(k)
    for q in range(start, stop):
        reach, done = 0.5 * cells.size, False
        while not done:
            for a in range(3):
                low[a], high[a] = queries[q, a] - reach, queries[q, a] + reach
            runs, n_runs, room = runs_in_box(cells, low, high, runs)
            if room > len(indices):
                indices, kept = np.empty(2 * room, np.int64), np.empty(2 * room, np.int64)
                x, y, z, square = np.empty(2 * room), np.empty(2 * room), np.empty(2 * room), np.empty(2 * room)
            n = points_in_box(points, runs, n_runs, low, high, indices)
            if n >= k or n == n_all:
                for j in range(n):
                    i = indices[j]
                    x[j], y[j], z[j] = points[i, 0], points[i, 1], points[i, 2]
                _k_least(x, y, z, n, queries[q, 0], queries[q, 1], queries[q, 2], -1, indices, square, kept, reach * reach, near, far)
                if n == n_all or far[k - 1] <= reach * reach:
                    done = True
                    index[q, :] = near
                    distance[q, :] = np.sqrt(far)
            reach *= 2.0
