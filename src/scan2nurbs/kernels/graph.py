"""Basins of a height over a graph of nearest neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.pieces import root_of
from scan2nurbs.kernels.runner import kernel


def basins(
    neighbours: NDArray[np.int32],
    linked: NDArray[np.bool_],
    height: NDArray[np.float64],
    keep: NDArray[np.bool_],
    least_depth: float,
) -> NDArray[np.int32]:
    """Part the kept points into the basins of attraction of the peaks of a height.

    Parameters
    ----------
    neighbours : (N, k) int32
        Neighbours of every point, the nearest first; −1 where there is none.
    linked : (N, k) bool
        Which of the links may be followed.
    height : (N,) float64
        The height; its peaks are the middles of basins, its saddles part them.
    keep : (N,) bool
        Points that take part.
    least_depth : float
        A basin whose peak rises less than this above the saddle to a higher one belongs to it.

    Returns
    -------
    (N,) int32
        Basin of each point, numbered in the order of their peaks' heights; −1 for points that take no part.

    Notes
    -----
    A watershed by flooding from the top (Vincent and Soille 1991, on a graph): points are visited by falling height, ties by
    index, and joined by union-find. O(N log N + N k).
    """
    order = np.argsort(-height, kind="stable").astype(np.int32)
    parent = np.full(len(height), -1, np.int32)
    _flood(order, neighbours, linked, height, keep, least_depth, parent)
    labels = np.full(len(height), -1, np.int32)
    _number(order, parent, labels)
    return labels


@kernel
def _flood(order, neighbours, linked, height, keep, least_depth, parent):
    """Let each point join the basin of its nearest visited neighbour; the root of a basin is its peak."""
    for i in order:
        if not keep[i]:
            continue
        own, highest = -1, -1
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0 or not linked[i, k] or parent[j] < 0:
                continue
            root = root_of(parent, j)
            if own < 0:
                own = root
            if highest < 0 or height[root] > height[highest] or (height[root] == height[highest] and root < highest):
                highest = root
        if own < 0:
            parent[i] = i
            continue
        parent[i] = own
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0 or not linked[i, k] or parent[j] < 0:
                continue
            root = root_of(parent, j)
            if root != highest and height[root] - height[i] < least_depth:
                parent[root] = highest


@kernel
def _number(order, parent, labels):
    n = 0
    for i in order:
        if parent[i] >= 0:
            root = root_of(parent, i)
            if labels[root] < 0:
                labels[root] = n
                n += 1
            labels[i] = labels[root]
