"""Normals at a radius, and what VDN compares: planes of sectors of a ball, from streamed sums.

For each block of points, those of a cell, the candidates within reach are gathered once, as float32 relative to the block's centre
and in units of the radius. What all balls of the block hold is summed once; each point then makes branch-free passes over the rest.
The planes of all balls of a block, and of all their sectors, are found at once, so that they share vector instructions. No neighbour
is ever listed. Where balls hold hundreds of points the candidates of sectors are clusters of them, and of balls where they hold
thousands.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.balls import POINT_ROWS, ball_sums, sector_sums
from scan2nurbs.kernels.candidates import COLUMNS, LANES, bounds, gather_ball
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.clusters import CLUSTER_ROWS, Clusters, ball_sums_of_clusters, cluster, gather_clusters, sector_sums_of_clusters
from scan2nurbs.kernels.runner import Progress, run_ranges, summing
from scan2nurbs.kernels.symmetric3 import normals_of_moments, planes_of_moments

CELLS_PER_RANGE = 256
UNDEFINED = 255
BLOCK = 64
"""Most points that share a table of candidates."""
WIDENING = 2.0**0.5
# Where fewer points than this are expected in a ball, the table serves two widenings too.
SPARSE = 12.0
# Where a cube of this part of the radius would hold so many points on average, it takes their place in the sectors of a ball (about
# 500 points a ball), or in the ball as well (about 2,500).
SECTOR_CLUSTER, SECTOR_CLUSTERED = 1.0 / 5.5, 5.0
BALL_CLUSTER, BALL_CLUSTERED = 1.0 / 9.0, 10.0


class BallPlanes(NamedTuple):
    """Planes of the balls of one radius about every point, in the order of the sorted points unless that of the input was asked for.

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
        How many times the radius was multiplied by √2 before the ball carried a plane; `UNDEFINED` where none did.
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
    input_order: bool = False,
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
        Whether each point of a ball is summed, however many there are; else small cells stand for the points of its sectors where it
        holds more than about 500, and for its own where it holds more than about 2,500.
    input_order : bool
        Whether results stand in the order of the points that the cells were built from. Written as they are found, they cost no
        pass of their own over memory.
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
    density = n / len(cells.cell_key) / cells.size**2
    whole = not exact and density * (BALL_CLUSTER * radius) ** 2 >= BALL_CLUSTERED
    parts = not exact and sectors > 0 and density * (SECTOR_CLUSTER * radius) ** 2 >= SECTOR_CLUSTERED
    clusters = Clusters(cells, np.empty((0, 8), np.float32), 0.0)
    if whole or parts:
        clusters = cluster(cells, (BALL_CLUSTER if whole else SECTOR_CLUSTER) * radius, radius)
    ahead = 2 if widenings >= 2 and np.pi * density * radius**2 < SPARSE else 0
    wanted = np.ones(0, np.bool_) if todo is None else todo
    place = cells.order if input_order else np.empty(0, np.int32)
    turn = 2.0 * np.pi * np.arange(sectors) / max(sectors, 1)
    borders = np.stack([np.cos(turn), np.sin(turn)], axis=1).astype(np.float32)

    def work(start: int, stop: int) -> None:
        _ball_planes(cells, clusters, whole, float(radius), widenings, ahead, borders, wanted, place, start, stop, result)

    run_ranges(work, len(cells.cell_key), size=CELLS_PER_RANGE, progress=progress)
    return result


@summing
def _ball_planes(cells, clusters, whole, radius, widenings, ahead, borders, todo, place, start, stop, out):
    g = len(borders)
    centre, low, high = np.empty(3), np.empty(3), np.empty(3)
    runs, indices = np.empty((64, 2), np.int64), np.empty(COLUMNS, np.int64)
    table, heap = np.empty((POINT_ROWS, COLUMNS), np.float32), np.empty((CLUSTER_ROWS, LANES), np.float32)
    pending, chosen, local = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int64), np.empty((3, BLOCK), np.float32)
    # Rows a power of two apart would share the same few lines of the cache.
    sums, planes = np.empty((10, BLOCK + 8)), np.empty((7, BLOCK + 8))
    sectors, normals = np.empty((10, BLOCK * g + 8)), np.empty((3, BLOCK * g + 8))
    for cell in range(start, stop):
        for first in range(cells.cell_start[cell], cells.cell_start[cell + 1], BLOCK):
            end = min(first + BLOCK, cells.cell_start[cell + 1])
            m = _begin(first, end, todo, place, pending, out)
            reach, unit, border, filled, n_clusters = radius, 0.0, 0, 0, 0
            for step in range(widenings + 1):
                if m == 0:
                    break
                by_clusters = whole and step == 0
                if step == 0 and clusters.size > 0.0 and (whole or g > 0):
                    bounds(cells.points, first, end, low, high)
                    runs, indices, heap, n_clusters = gather_clusters(clusters, low, high, radius, centre, runs, indices, heap)
                if not by_clusters and reach > 1.0001 * unit:
                    unit = reach * WIDENING ** min(ahead, widenings - step)
                    bounds(cells.points, first, end, low, high)
                    runs, table, border, filled = gather_ball(cells, low, high, reach, unit, 1.0 / unit, centre, runs, table)
                scale = 1.0 / (radius if by_clusters else unit)
                limit = np.float32((reach * scale) * (reach * scale))
                _localize(cells.points, pending, m, centre, scale, local)
                if by_clusters:
                    ball_sums_of_clusters(heap, n_clusters, local, m, sums)
                else:
                    ball_sums(table, border, filled, local, m, limit, sums)
                planes_of_moments(sums, m, planes)
                if step == 0 and g > 0:
                    n_chosen = _choose(sums, planes, m, chosen)
                    if clusters.size > 0.0:
                        sector_sums_of_clusters(heap, n_clusters, local, planes, borders, chosen, n_chosen, sectors)
                    else:
                        sector_sums(table, filled, local, planes, sums, borders, chosen, n_chosen, limit, sectors)
                    _add_the_point(local, chosen, n_chosen, clusters.size > 0.0, g, sectors)
                    normals_of_moments(sectors, n_chosen * g, normals)
                    _write_sector_angles(pending, place, chosen, n_chosen, normals, g, out)
                m = _write_planes(pending, m, place, step, 1.0 / scale, sums, planes, out)
                reach *= WIDENING


@summing
def _begin(first, end, todo, place, pending, out):
    """Clear the results of a block of points and list those to compute; return how many there are."""
    m = 0
    for i in range(first, end):
        row = place[i] if len(place) > 0 else i
        out.n_points[row] = 0
        out.widened[row] = UNDEFINED
        for k in range(3):
            out.normal[row, k] = np.nan
        if len(out.variance) > 0:
            out.variance[row] = np.nan
            for k in range(3):
                out.mean[row, k] = np.nan
        if len(out.sector_angle) > 0:
            out.sector_angle[row] = np.nan
        pending[m] = i
        m += len(todo) == 0 or todo[i]
    return m


@summing
def _localize(points, pending, m, centre, scale, local):
    for q in range(m):
        for k in range(3):
            local[k, q] = (points[pending[q], k] - centre[k]) * scale


@summing
def _choose(sums, planes, m, chosen):
    """List the balls with a plane that may hold two sectors with a plane, each of which holds two points besides its own."""
    n = 0
    for q in range(m):
        chosen[n] = q
        n += (sums[9, q] >= 5.0) & (not np.isnan(planes[0, q]))
    return n


@summing
def _add_the_point(local, chosen, n_chosen, about_centre, g, sectors):
    """Add each point to all of its sectors: about itself it adds nothing but one to their counts."""
    for c in range(n_chosen):
        q = chosen[c]
        x, y, z = np.float64(local[0, q]), np.float64(local[1, q]), np.float64(local[2, q])
        for s in range(g * c, g * c + g):
            sectors[9, s] += 1.0
            if about_centre:
                sectors[0, s] += x
                sectors[1, s] += y
                sectors[2, s] += z
                sectors[3, s] += x * x
                sectors[4, s] += x * y
                sectors[5, s] += x * z
                sectors[6, s] += y * y
                sectors[7, s] += y * z
                sectors[8, s] += z * z


@summing
def _write_sector_angles(pending, place, chosen, n_chosen, normals, g, out):
    """Write the largest angle between the planes of two sectors (paper, Algorithm 1 and eq. 2.3), in degrees."""
    for c in range(n_chosen):
        least = np.inf
        for s in range(g * c, g * c + g):
            for t in range(g * c, s):
                dot = abs(normals[0, s] * normals[0, t] + normals[1, s] * normals[1, t] + normals[2, s] * normals[2, t])
                least = dot if dot < least else least  # false for NaN
        if least < np.inf:
            i = pending[chosen[c]]
            out.sector_angle[place[i] if len(place) > 0 else i] = np.degrees(np.arccos(min(least, 1.0)))


@summing
def _write_planes(pending, m, place, step, unit, sums, planes, out):
    """Write the planes that there are; return how many points are still without one, moved to the front of `pending`."""
    left = 0
    for q in range(m):
        i = pending[q]
        row = place[i] if len(place) > 0 else i
        if step == 0:
            out.n_points[row] = np.int32(sums[9, q])
        if np.isnan(planes[0, q]):
            pending[left] = i
            left += 1
            continue
        out.widened[row] = step
        for k in range(3):
            out.normal[row, k] = planes[k, q]
        if len(out.variance) > 0:
            out.variance[row] = planes[6, q] * unit * unit
            for k in range(3):
                out.mean[row, k] = sums[k, q] / sums[9, q] * unit
    return left
