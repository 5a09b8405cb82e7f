"""Points summed up by small cells: what a ball of thousands of points is made of where its points are too many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import POINTS_PER_CELL, Cells, build_cells
from scan2nurbs.kernels.runner import kernel, run_ranges

_RANGE = 1 << 12


class Sources(NamedTuple):
    """What the sums of a ball are taken over.

    Attributes
    ----------
    cells : Cells
        The points, or the means of clusters of points.
    weights : (M, 7) float32
        Of each cluster the number of its points and their summed products xx, xy, xz, yy, yz, zz about their mean, in the order
        of the sorted means; (0, 0) where the sources are the points themselves.
    size : float
        Edge length of the clusters' cells; 0 for points.
    """

    cells: Cells
    weights: NDArray[np.float32]
    size: float


def cluster(cells: Cells, size: float, radius: float) -> Sources:
    """Sum up the points by cells of edge length `size`.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    size : float
        In the points' unit.
    radius : float
        The unit of the weights' lengths.
    """
    small = build_cells(cells.points, size)
    n = len(small.cell_key)
    mean, weights = np.empty((n, 3)), np.empty((n, 7), np.float32)
    run_ranges(lambda start, stop: _cluster(small, radius, start, stop, mean, weights), n, size=_RANGE)
    means = build_cells(mean, np.sqrt(POINTS_PER_CELL) * size)
    return Sources(means, weights[means.order], size)


@kernel
def _cluster(cells, radius, start, stop, mean, weights):
    points = cells.points
    for c in range(start, stop):
        first, end = cells.cell_start[c], cells.cell_start[c + 1]
        sx, sy, sz = 0.0, 0.0, 0.0
        for i in range(first, end):
            sx += points[i, 0] - points[first, 0]
            sy += points[i, 1] - points[first, 1]
            sz += points[i, 2] - points[first, 2]
        n = float(end - first)
        mean[c, 0], mean[c, 1], mean[c, 2] = points[first, 0] + sx / n, points[first, 1] + sy / n, points[first, 2] + sz / n
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(first, end):
            dx, dy, dz = (points[i, 0] - mean[c, 0]) / radius, (points[i, 1] - mean[c, 1]) / radius, (points[i, 2] - mean[c, 2]) / radius
            xx += dx * dx
            xy += dx * dy
            xz += dx * dz
            yy += dy * dy
            yz += dy * dz
            zz += dz * dz
        w = weights[c]
        w[0], w[1], w[2], w[3], w[4], w[5], w[6] = n, xx, xy, xz, yy, yz, zz
