"""Which points lie near some of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import kernel, run_ranges


def within_reach(cells: Cells, mask: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """Tell which points lie less than `reach` from one of the mask.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    mask : (N,) bool
        Sorted points; fastest where they are few.
    reach : float

    Returns
    -------
    (N,) bool
        Holds the mask.
    """
    out, rows = mask.copy(), np.flatnonzero(mask)
    # Threads may mark the same point: all write the same.
    run_ranges(lambda start, stop: _mark(cells, rows, float(reach), start, stop, out), len(rows), size=256)
    return out


@kernel
def _mark(cells, rows, reach, start, stop, out):
    points = cells.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    for r in range(start, stop):
        x, y, z = points[rows[r], 0], points[rows[r], 1], points[rows[r], 2]
        low[0], low[1], low[2] = x - reach, y - reach, z - reach
        high[0], high[1], high[2] = x + reach, y + reach, z + reach
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
        for c in range(points_in_box(points, runs, n_runs, low, high, indices)):
            i = indices[c]
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            if dx * dx + dy * dy + dz * dz < reach * reach:
                out[i] = True
