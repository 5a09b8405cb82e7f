"""Functional surfaces as basins between the edges: parted where they narrow, joined again where no edge parts them."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.graph import basins

# How much wider, in h, a surface must be on both sides of a narrow place to be parted there at all: random sampling alone
# moves the distance to the nearest edge point by about half a spacing.
LEAST_DEPTH = 1.0
# Walls are summed in whole parts: sums of integers do not depend on their order.
PARTS = 16


def find_surfaces(
    neighbours: NDArray[np.int32],
    smooth: NDArray[np.bool_],
    level: NDArray[np.bool_],
    to_edge: NDArray[np.float64],
    wall: NDArray[np.float64],
    h: float,
) -> NDArray[np.int32]:
    """Part the points between the edges into surfaces.

    Parameters
    ----------
    neighbours : (N, k) int32
        Nearest neighbours of every point.
    smooth : (N, k) bool
        Links that run along the scanned sheet, creases or not.
    level : (N, k) bool
        Those of them that do not cross a crease.
    to_edge : (N,) float64
        Distance of every point to the nearest edge point.
    wall : (N,) float64
        How much each point parts surfaces: 0 for points on no edge, up to 1 on what is an edge beyond doubt.
    h : float
        The noise-stable spacing.

    Returns
    -------
    (N,) int32
        Surface of every point; −1 on edges. Points of a wall of less than one half within a surface belong to it.

    Notes
    -----
    The distance to the edges has a saddle in every gap of a boundary, and in every neck of a surface: both part basins. They
    are told apart by what the two basins have in common: along a wall with a gap it is mostly wall, across a neck it is mostly
    clear. Pairs are joined from the clearest on, so that the wall of a whole surface counts, not that of a part of it.
    """
    edge = wall > 0.0
    parted = basins(neighbours, level, to_edge, ~edge, LEAST_DEPTH * h)
    everywhere = grow(parted, neighbours, smooth, np.ones(len(edge), bool))
    joined = _join(everywhere, parted, neighbours, level, wall)
    return grow(joined, neighbours, level, edge & (wall < 0.5))


def grow(
    labels: NDArray[np.int32], neighbours: NDArray[np.int32], smooth: NDArray[np.bool_], allowed: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Let each unlabelled allowed point take the label of its nearest labelled neighbour, ring by ring."""
    labels = labels.copy()
    waiting = np.flatnonzero((labels < 0) & allowed)
    while len(waiting):
        offered = np.where(smooth[waiting], labels[neighbours[waiting]], -1)
        first = np.argmax(offered >= 0, axis=1)
        taken = offered[np.arange(len(waiting)), first]
        if not (taken >= 0).any():
            break
        labels[waiting] = taken
        waiting = waiting[taken < 0]
    return labels


def _join(
    everywhere: NDArray[np.int32],
    parted: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    level: NDArray[np.bool_],
    wall: NDArray[np.float64],
) -> NDArray[np.int32]:
    """Join the basins whose common border is mostly clear; `everywhere` has labels on the edge points too."""
    n = int(parted.max(initial=-1)) + 1
    contacts = _contacts(everywhere, neighbours, level, wall, n)
    parent = list(range(n))
    waiting = [(-_clearness(count), a, b) for a in range(n) for b, count in contacts[a].items() if a < b]
    heapq.heapify(waiting)
    while waiting:
        negative, a, b = heapq.heappop(waiting)
        if -negative <= 0.5:
            break
        if parent[a] != a or parent[b] != b or -negative != _clearness(contacts[a][b]):
            continue  # one of them was joined to another meanwhile, or their border has changed
        parent[b] = a
        del contacts[a][b]
        for c, (clear, walled) in contacts[b].items():
            if c != a:
                before = contacts[a].get(c, (0, 0))
                contacts[a][c] = contacts[c][a] = (before[0] + clear, before[1] + walled)
                heapq.heappush(waiting, (-_clearness(contacts[a][c]), min(a, c), max(a, c)))
            contacts[c].pop(b, None)
    roots = np.array([_root_of(parent, i) for i in range(n)] or [0])
    return np.where(parted >= 0, roots[parted], -1).astype(np.int32)


def _contacts(
    everywhere: NDArray[np.int32], neighbours: NDArray[np.int32], level: NDArray[np.bool_], wall: NDArray[np.float64], n: int
) -> list[dict[int, tuple[int, int]]]:
    """Sum over the links between basins how clear and how walled they are, in parts of `PARTS` a link."""
    height = np.rint(wall * PARTS).astype(np.int64)
    found: list[NDArray[np.int64]] = []
    for k in range(neighbours.shape[1]):
        a, b = everywhere, everywhere[neighbours[:, k]]
        meet = (neighbours[:, k] >= 0) & (a >= 0) & (b >= 0) & (a != b)
        pair = np.minimum(a, b)[meet].astype(np.int64) * n + np.maximum(a, b)[meet]
        walled = np.maximum(height, height[neighbours[:, k]])
        # A step between points of which none is on an edge is a wall that no edge point saw.
        walled = np.where(level[:, k] | (walled > 0), walled, PARTS)[meet]
        found.append((PARTS + 1) * pair + walled)
    contacts: list[dict[int, tuple[int, int]]] = [{} for _ in range(n)]
    for code, count in zip(*np.unique(np.concatenate(found), return_counts=True), strict=True):
        pair, part = divmod(int(code), PARTS + 1)
        a, b = divmod(pair, n)
        clear, walled = contacts[a].get(b, (0, 0))
        contacts[a][b] = contacts[b][a] = (clear + (PARTS - part) * int(count), walled + part * int(count))
    return contacts


def _clearness(contact: tuple[int, int]) -> float:
    clear, walled = contact
    return clear / (clear + walled)


def _root_of(parent: list[int], i: int) -> int:
    while parent[i] != i:
        i = parent[i]
    return i
