"""Creases that carry on each other: means along them, and the points beside them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, bounds, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import kernel, run_ranges

CELLS_PER_RANGE = 128
# Pieces of crease carry on each other where they run the same way and bend to the same side, within these cosines,
SAME_WAY, SAME_BEND = 0.85, 0.8
# and lie in one line but for this part of the spacing and of the distance.
BESIDE, ASIDE = 0.4, 0.1


def mean_along(
    feet: Cells, direction: NDArray[np.float64], up: NDArray[np.float64], values: NDArray[np.float64], reach: float, spacing: float
) -> NDArray[np.float64]:
    """Average values over the pieces of crease that carry on each.

    Parameters
    ----------
    feet : Cells
        Points of creases, sorted.
    direction, up : (K, 3) float64
        Unit vectors of each, in sorted order: along the crease, and in the middle of its two faces; as lines.
    values : (K, V) float64
        What to average.
    reach : float
        How far apart pieces may be, in the points' unit.
    spacing : float
        h.

    Notes
    -----
    Repeated, the means reach as far as the square root of the number of repetitions, around the bends of a crease.
    """
    out = np.empty_like(values)
    run_ranges(
        lambda start, stop: _mean_along(feet, direction, up, values, reach, spacing, start, stop, out),
        len(feet.cell_key),
        size=CELLS_PER_RANGE,
    )
    return out


@kernel
def _mean_along(feet, direction, up, values, reach, spacing, start, stop, out):
    points = feet.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    for cell in range(start, stop):
        first, end = feet.cell_start[cell], feet.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        for k in range(3):
            low[k] -= reach
            high[k] += reach
        runs, n_runs, room = runs_in_box(feet, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
        n = points_in_box(points, runs, n_runs, low, high, indices)
        for i in range(first, end):
            out[i] = 0.0
            total = 0.0
            for a in range(n):
                j = indices[a]
                dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                square = dx * dx + dy * dy + dz * dz
                if square >= reach * reach or abs(_dot(direction[i], direction[j])) < SAME_WAY or abs(_dot(up[i], up[j])) < SAME_BEND:
                    continue
                along = abs(dx * direction[i, 0] + dy * direction[i, 1] + dz * direction[i, 2])
                w = np.exp(-0.5 * max(square - along * along, 0.0) / (BESIDE * spacing + ASIDE * along) ** 2)
                total += w
                for v in range(values.shape[1]):
                    out[i, v] += w * values[j, v]
            for v in range(values.shape[1]):
                out[i, v] /= total  # a piece carries on itself: the sum is at least 1


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def nearest_piece(cells: Cells, feet: Cells, direction: NDArray[np.float64], half: float, reach: float) -> NDArray[np.int32]:
    """Find for each point of a cloud the nearest piece of crease closer than `reach`.

    Parameters
    ----------
    cells : Cells
        The sorted points of the cloud.
    feet : Cells
        Points of creases, sorted.
    direction : (K, 3) float64
        Unit direction of each, in sorted order.
    half : float
        Half the length of a piece, in the points' unit.
    reach : float
        In the points' unit.

    Returns
    -------
    (N,) int32
        The sorted foot; −1 where none is near.
    """
    out = np.full(len(cells.points), -1, np.int32)
    run_ranges(
        lambda start, stop: _nearest_piece(cells, feet, direction, half, reach, start, stop, out),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
    )
    return out


@kernel
def _nearest_piece(cells, feet, direction, half, reach, start, stop, out):
    points = cells.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        for k in range(3):
            low[k] -= reach + half
            high[k] += reach + half
        runs, n_runs, room = runs_in_box(feet, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
        n = points_in_box(feet.points, runs, n_runs, low, high, indices)
        for i in range(first, end):
            best = reach * reach
            for a in range(n):
                j = indices[a]
                dx, dy, dz = points[i, 0] - feet.points[j, 0], points[i, 1] - feet.points[j, 1], points[i, 2] - feet.points[j, 2]
                along = dx * direction[j, 0] + dy * direction[j, 1] + dz * direction[j, 2]
                on = max(min(along, half), -half)
                square = dx * dx + dy * dy + dz * dz - along * along + (along - on) ** 2
                if square < best:
                    best = square
                    out[i] = np.int32(j)
