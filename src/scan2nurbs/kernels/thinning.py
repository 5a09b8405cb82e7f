"""Sums over balls of boundary points: Algorithm 2 of the paper, groups joined over gaps, middle lines of bands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, runs_in_box
from scan2nurbs.kernels.pieces import root_of
from scan2nurbs.kernels.runner import kernel, run_ranges

QUERIES_PER_RANGE = 1024


def centroid_cover(cells: Cells, pops: NDArray[np.int64], radius: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Replace points by the centroids of balls (paper, Algorithm 2).

    Parameters
    ----------
    cells : Cells
        The sorted points B.
    pops : (M,) int64
        Sorted points in the order in which they are popped.
    radius : float
        r_u; a ball holds the points of B that are left and closer than this.

    Returns
    -------
    centroids : (K, 3) float64
        In the order of the pops.
    taken_by : (M,) int64
        For each sorted point the centroid whose ball took it out of B.

    Notes
    -----
    One pop depends on those before it, so this runs in one thread; O(M) balls at worst.
    """
    centroids = np.empty((len(pops), 3))
    taken_by = np.full(len(pops), -1, np.int64)
    n = _centroid_cover(cells, pops, float(radius), centroids, taken_by)
    return centroids[:n].copy(), taken_by


def join_groups(cells: Cells, gap: float) -> NDArray[np.int64]:
    """Return for each sorted point the first sorted point of its group; points at most `gap` apart share a group."""
    parent = np.arange(len(cells.points))
    _join_groups(cells, float(gap), parent)
    return parent


def ball_covariances(
    cells: Cells, queries: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return mean (M, 3), relative to its query, covariance (M, 3, 3) and number (M,) of the points closer than `radius` to each query."""
    m = len(queries)
    mean, covariance, count = np.zeros((m, 3)), np.zeros((m, 3, 3)), np.zeros(m, np.int64)
    run_ranges(
        lambda start, stop: _ball_covariances(cells, queries, float(radius), start, stop, mean, covariance, count),
        m,
        size=QUERIES_PER_RANGE,
    )
    return mean, covariance, count


@kernel
def _ball_covariances(cells, queries, radius, start, stop, mean, covariance, count):
    points = cells.points
    low, high, d = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    for i in range(start, stop):
        for k in range(3):
            low[k], high[k] = queries[i, k] - radius, queries[i, k] + radius
        runs, n_runs, _ = runs_in_box(cells, low, high, runs)
        for r in range(n_runs):
            for j in range(runs[r, 0], runs[r, 1]):
                for k in range(3):
                    d[k] = points[j, k] - queries[i, k]
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < radius * radius:
                    count[i] += 1
                    for a in range(3):
                        mean[i, a] += d[a]
                        for b in range(3):
                            covariance[i, a, b] += d[a] * d[b]
        if count[i] > 0:
            for a in range(3):
                mean[i, a] /= count[i]
            for a in range(3):
                for b in range(3):
                    covariance[i, a, b] = covariance[i, a, b] / count[i] - mean[i, a] * mean[i, b]


@kernel
def _centroid_cover(cells, pops, radius, centroids, taken_by):
    points = cells.points
    low, high, total = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    square = radius * radius
    n = 0
    for p in pops:
        if taken_by[p] >= 0:
            continue
        for k in range(3):
            low[k], high[k], total[k] = points[p, k] - radius, points[p, k] + radius, 0.0
        runs, n_runs, _ = runs_in_box(cells, low, high, runs)
        count = 0
        for r in range(n_runs):
            for j in range(runs[r, 0], runs[r, 1]):
                dx, dy, dz = points[j, 0] - points[p, 0], points[j, 1] - points[p, 1], points[j, 2] - points[p, 2]
                if taken_by[j] < 0 and dx * dx + dy * dy + dz * dz < square:
                    taken_by[j] = n
                    count += 1
                    total[0] += dx
                    total[1] += dy
                    total[2] += dz
        for k in range(3):
            centroids[n, k] = points[p, k] + total[k] / count
        n += 1
    return n


@kernel
def _join_groups(cells, gap, parent):
    points = cells.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    square = gap * gap
    for i in range(len(points)):
        for k in range(3):
            low[k], high[k] = points[i, k] - gap, points[i, k] + gap
        runs, n_runs, _ = runs_in_box(cells, low, high, runs)
        a = root_of(parent, i)
        for r in range(n_runs):
            for j in range(runs[r, 0], min(runs[r, 1], i)):
                b = root_of(parent, j)
                if a == b:
                    continue
                dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                if dx * dx + dy * dy + dz * dz <= square:
                    # The smaller index stays the root, so that the result has one form.
                    a, b = min(a, b), max(a, b)
                    parent[b] = a
    for i in range(len(points)):
        parent[i] = root_of(parent, i)
