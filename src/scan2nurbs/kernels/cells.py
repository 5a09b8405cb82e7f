"""Points sorted into cells: the index under every neighbourhood sum.

Cells are cubes of one size on a grid; only those that hold points are stored, sorted by (z, y, x), with the rows of cells
that share (z, y) listed beside them. All points within a box are then a few contiguous runs of the sorted points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges
from scan2nurbs.kernels.sorting import radix_argsort

CELLS_PER_AXIS = 1 << 20
POINTS_PER_CELL = 32
_RANGE = 1 << 16


class Cells(NamedTuple):
    """The cell index; a plain tuple of arrays, so that kernels take it as one argument.

    Attributes
    ----------
    points : (N, 3) float64
        The points sorted by cell.
    order : (N,) int32
        Row of the original points that each sorted point came from.
    low : (3,) float64
        Lowest corner of the grid.
    size : float
        Edge length of a cell.
    shape : (3,) int64
        Number of cells along x, y, z.
    cell_key : (C,) int64
        ``(z * shape[1] + y) * shape[0] + x`` of each occupied cell, ascending.
    cell_start : (C + 1,) int64
        First sorted point of each cell.
    row_key : (R,) int64
        ``z * shape[1] + y`` of each occupied row of cells, ascending.
    row_start : (R + 1,) int64
        First cell of each row.
    """

    points: NDArray[np.float64]
    order: NDArray[np.int32]
    low: NDArray[np.float64]
    size: float
    shape: NDArray[np.int64]
    cell_key: NDArray[np.int64]
    cell_start: NDArray[np.int64]
    row_key: NDArray[np.int64]
    row_start: NDArray[np.int64]


def build_cells(points: NDArray[np.float64], size: float) -> Cells:
    """Sort points into cells of about `size`.

    Parameters
    ----------
    points : (N, 3) float64
        Finite coordinates.
    size : float
        Edge length of a cell, in the points' unit; enlarged where the extent would need more than 2^20 cells along an axis.

    Notes
    -----
    O(N) by a radix sort; the result depends on the points and their order alone.
    """
    low, high = extremes(points)[:2]
    extent = high - low
    size = max(float(size), float(extent.max()) / (CELLS_PER_AXIS - 1), np.finfo(np.float64).tiny)
    shape = (extent / size).astype(np.int64) + 1
    keys = np.empty(len(points), np.int64)
    run_ranges(lambda start, stop: _cell_keys(points, low, size, shape, start, stop, keys), len(points), size=_RANGE)
    order, keys = radix_argsort(keys, int(shape.prod()))
    arranged = np.empty_like(points)
    run_ranges(lambda start, stop: _take(points, order, start, stop, arranged), len(points), size=_RANGE)
    cell_key, cell_start = _runs(keys)
    row_key, row_start = _runs(cell_key // shape[0])
    return Cells(arranged, order, low, size, shape, cell_key, cell_start, row_key, row_start)


def extremes(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return the least and the largest coordinates (3,) of the rows (N, 3) that are finite, and how many rows are not."""
    n_ranges = -(-len(points) // _RANGE)
    low, high, bad = np.empty((n_ranges, 3)), np.empty((n_ranges, 3)), np.empty(n_ranges, np.int64)

    def work(start: int, stop: int) -> None:
        r = start // _RANGE
        bad[r] = _extremes(points, start, stop, low[r], high[r])

    run_ranges(work, len(points), size=_RANGE)
    return low.min(axis=0, initial=np.inf), high.max(axis=0, initial=-np.inf), int(bad.sum())


@kernel
def _extremes(points, start, stop, low, high):
    for k in range(3):
        low[k], high[k] = np.inf, -np.inf
    bad = 0
    for i in range(start, stop):
        finite = np.isfinite(points[i, 0]) & np.isfinite(points[i, 1]) & np.isfinite(points[i, 2])
        if finite:
            for k in range(3):
                low[k], high[k] = min(low[k], points[i, k]), max(high[k], points[i, k])
        bad += not finite
    return bad


def _runs(keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    starts = np.r_[0, np.flatnonzero(keys[1:] != keys[:-1]) + 1].astype(np.int64)
    return keys[starts], np.r_[starts, len(keys)].astype(np.int64)


@kernel
def _cell_keys(points, low, size, shape, start, stop, keys):
    for i in range(start, stop):
        x = min(np.int64((points[i, 0] - low[0]) / size), shape[0] - 1)
        y = min(np.int64((points[i, 1] - low[1]) / size), shape[1] - 1)
        z = min(np.int64((points[i, 2] - low[2]) / size), shape[2] - 1)
        keys[i] = (z * shape[1] + y) * shape[0] + x


@kernel
def _take(values, order, start, stop, out):
    for i in range(start, stop):
        for k in range(3):
            out[i, k] = values[order[i], k]


def sorted_rows(cells: Cells, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put rows (N, 3), in the order of the points that the cells were built from, into that of the sorted points."""
    out = np.empty_like(values)
    run_ranges(lambda start, stop: _take(values, cells.order, start, stop, out), len(values), size=_RANGE)
    return out


def unsorted(cells: Cells, values: NDArray[Any]) -> NDArray[Any]:
    """Put values (N,) or (N, K) of the sorted points into the order of the points that the cells were built from."""
    out = np.empty_like(values)
    rows, target = values.reshape(len(values), -1), out.reshape(len(out), -1)
    run_ranges(lambda start, stop: _spread(rows, cells.order, start, stop, target), len(rows), size=_RANGE)
    return out


@kernel
def _spread(values, order, start, stop, out):
    for i in range(start, stop):
        for k in range(values.shape[1]):
            out[order[i], k] = values[i, k]


@kernel
def row_after(row_key, key):
    """Return the first row whose key is at least `key`."""
    a, b = 0, len(row_key)
    while a < b:
        m = (a + b) // 2
        if row_key[m] < key:
            a = m + 1
        else:
            b = m
    return a


@kernel
def runs_in_box(cells, low, high, runs):
    """Find the runs of sorted points in the cells that meet a box.

    Parameters
    ----------
    cells : Cells
    low, high : (3,) float64
        The box's corners.
    runs : (K, 2) int64
        Room for the runs; a larger array is returned where it is too small.

    Returns
    -------
    runs : (K, 2) int64
        First and one-past-last sorted point of each run.
    n_runs, n_points : int
        How many runs, and how many points they hold (points of the cells, a superset of those in the box).
    """
    shape = cells.shape
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        first[k] = min(max(np.floor((low[k] - cells.low[k]) / cells.size), 0.0), np.float64(shape[k]))
        last[k] = max(min(np.floor((high[k] - cells.low[k]) / cells.size), np.float64(shape[k] - 1)), -1.0)
    n_runs, n_points = 0, 0
    for z in range(first[2], last[2] + 1):
        row = row_after(cells.row_key, z * shape[1] + first[1])
        while row < len(cells.row_key) and cells.row_key[row] <= z * shape[1] + last[1]:
            base = cells.row_key[row] * shape[0]
            a, end = cells.row_start[row], cells.row_start[row + 1]
            if end - a > 8:
                a += row_after(cells.cell_key[a:end], base + first[0])
            else:
                while a < end and cells.cell_key[a] < base + first[0]:
                    a += 1
            b = a
            while b < end and cells.cell_key[b] <= base + last[0]:
                b += 1
            if b > a:
                if n_runs == len(runs):
                    larger = np.empty((2 * n_runs, 2), np.int64)
                    for k in range(n_runs):
                        larger[k, 0], larger[k, 1] = runs[k, 0], runs[k, 1]
                    runs = larger
                runs[n_runs, 0], runs[n_runs, 1] = cells.cell_start[a], cells.cell_start[b]
                n_points += runs[n_runs, 1] - runs[n_runs, 0]
                n_runs += 1
            row += 1
    return runs, n_runs, n_points


@kernel
def points_in_box(points, runs, n_runs, low, high, indices):
    """List the sorted points of the runs that lie in the box; `indices` has room for all of the runs' points."""
    n = 0
    for r in range(n_runs):
        for i in range(runs[r, 0], runs[r, 1]):
            indices[n] = i
            inside = (
                (points[i, 0] >= low[0])
                & (points[i, 0] <= high[0])
                & (points[i, 1] >= low[1])
                & (points[i, 1] <= high[1])
                & (points[i, 2] >= low[2])
                & (points[i, 2] <= high[2])
            )
            n += inside
    return n
