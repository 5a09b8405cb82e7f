"""One-sided normals: each point takes the plane of the flattest ball that it fits, so that no normal blurs across an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.candidates import bounds
from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.moments import BallPlanes
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges

CELLS_PER_RANGE = 128


def one_sided_planes(
    cells: Cells, balls: BallPlanes, radius: float, noise: float, *, progress: Progress | None = None
) -> NDArray[np.int32]:
    """Choose for each point p the point q closer than `radius` whose ball's plane explains p best.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    balls : BallPlanes
        Planes of the balls of that radius, in sorted order.
    radius : float
        In the points' unit.
    noise : float
        Standard deviation of the points across the surface.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    (N,) int32
        The chosen sorted point; −1 where no ball within reach has a plane.

    Notes
    -----
    A Kuwahara filter on planes: the ball with the least variance across its plane wins. A plane that passes p farther off
    than twice the noise pays the excess of the squared distance: a ball across the edge, which does not explain p.
    """
    chosen = np.full(len(cells.points), -1, np.int32)
    run_ranges(
        lambda start, stop: _one_sided(cells, balls, float(radius), np.float32((2.0 * noise / radius) ** 2), start, stop, chosen),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return chosen


@kernel
def _one_sided(cells, balls, radius, free, start, stop, chosen):
    points = cells.points
    low, high, centre = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    table = np.empty((8, 1024), np.float32)
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        bounds(points, first, end, low, high)
        for k in range(3):
            centre[k] = 0.5 * (low[k] + high[k])
            low[k] -= radius
            high[k] += radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices = np.empty(2 * room, np.int64)
            table = np.empty((8, 2 * room), np.float32)
        n = _fill(points, balls, centre, radius, points_in_box(points, runs, n_runs, low, high, indices), indices, table)
        for i in range(first, end):
            p = ((points[i] - centre) / radius).astype(np.float32)
            j = _flattest(table, n, p[0], p[1], p[2], free)
            if j >= 0:
                chosen[i] = np.int32(indices[j])


@kernel
def _fill(points, balls, centre, radius, n, indices, table):
    """Write position, plane and variance of the candidates whose ball has a plane, in units of the radius; return how many."""
    kept = 0
    for j in range(n):
        i = indices[j]
        if np.isnan(balls.variance[i]):
            continue
        offset = 0.0
        for k in range(3):
            table[k, kept] = (points[i, k] - centre[k]) / radius
            table[3 + k, kept] = balls.normal[i, k]
            offset += balls.normal[i, k] * ((points[i, k] - centre[k]) + balls.mean[i, k]) / radius
        table[6, kept] = offset
        table[7, kept] = balls.variance[i] / (radius * radius)
        indices[kept] = i
        kept += 1
    return kept


@kernel
def _flattest(table, n, px, py, pz, free):
    best, chosen = np.float32(np.inf), -1
    for j in range(n):
        dx, dy, dz = table[0, j] - px, table[1, j] - py, table[2, j] - pz
        distance = table[3, j] * px + table[4, j] * py + table[5, j] * pz - table[6, j]
        cost = table[7, j] + max(distance * distance - free, np.float32(0.0))
        if cost < best and dx * dx + dy * dy + dz * dz < np.float32(1.0):
            best, chosen = cost, j
    return chosen
