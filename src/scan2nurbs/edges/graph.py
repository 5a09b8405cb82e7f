"""Unordered points along curves put in order: chains from end to end, and closed loops."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.kernels.tracing import greedy_spanner

Points = NDArray[np.float64]
Neighbours = dict[int, list[int]]


class Chain(NamedTuple):
    """Nodes in order; a closed one does not repeat its first node."""

    nodes: list[int]
    closed: bool


def order_points(points: Points, *, link: float, gap: float, prune: float, loop: float) -> list[Chain]:
    """Put points that lie along curves in order.

    Parameters
    ----------
    points : (K, d) float64
        Thinned points.
    link : float
        Points up to this far apart may be neighbours.
    gap : float
        Ends of chains up to this far apart, facing each other, are joined.
    prune : float
        Side branches shorter than this are cut off.
    loop : float
        No shorter loop is closed.

    Returns
    -------
    list of Chain
        Split where three or more meet; each junction ends all its chains.

    Notes
    -----
    O(K log K) for points along curves. Ties of length go by index.
    """
    pairs = KDTree(points).query_pairs(link, output_type="ndarray").astype(np.int64)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    order = np.argsort(length, kind="stable")
    pairs = np.ascontiguousarray(pairs[order])
    chosen = greedy_spanner(len(points), pairs, length[order], loop)
    neighbours: Neighbours = defaultdict(list)
    for a, b in pairs[chosen].tolist():
        _connect(neighbours, a, b)
    _prune(points, neighbours, prune)
    _bridge(points, neighbours, gap, link, loop)
    # A bridge can turn a stump into a side branch.
    _prune(points, neighbours, prune)
    return list(_chains(neighbours))


def free_ends(points: Points, chains: list[Chain], reach: float) -> tuple[Points, Points]:
    """Return the ends (E, 3) of chains that end alone, and the unit directions (E, 3) in which these end, taken over `reach`."""
    count: dict[int, int] = defaultdict(int)
    for chain in chains:
        for node in () if chain.closed else (chain.nodes[0], chain.nodes[-1]):
            count[node] += 1
    ends, outward = [], []
    for chain in chains:
        for nodes in () if chain.closed else (chain.nodes, chain.nodes[::-1]):
            if count[nodes[0]] == 1 and len(nodes) > 1:
                ends.append(points[nodes[0]])
                outward.append(_end_direction(points[nodes], reach))
    return np.array(ends).reshape(-1, 3), np.array(outward).reshape(-1, 3)


def path_length(points: Points, nodes: list[int]) -> float:
    """Return the length of the polyline through some of the points."""
    return float(np.linalg.norm(np.diff(points[nodes], axis=0), axis=1).sum())


def _connect(neighbours: Neighbours, a: int, b: int) -> None:
    neighbours[a].append(b)
    neighbours[b].append(a)


def _remove(neighbours: Neighbours, nodes: Iterable[int]) -> None:
    for node in nodes:
        for other in neighbours.pop(node, []):
            if other in neighbours:
                neighbours[other].remove(node)


def _chains(neighbours: Neighbours) -> Iterator[Chain]:
    """Walk every chain once: first those between ends and junctions, then the closed loops that are left."""
    walked: set[tuple[int, int]] = set()
    for start in sorted(node for node, others in neighbours.items() if len(others) not in (0, 2)):
        for step in sorted(neighbours[start]):
            if (start, step) not in walked:
                nodes = _walk(neighbours, start, step, walked)
                loop = nodes[0] == nodes[-1]
                yield Chain(nodes[:-1] if loop else nodes, loop)
    for start in sorted(node for node, others in neighbours.items() if len(others) == 2):
        step = min(neighbours[start])
        if (start, step) not in walked and (start, max(neighbours[start])) not in walked:
            yield Chain(_walk(neighbours, start, step, walked)[:-1], closed=True)


def _walk(neighbours: Neighbours, start: int, step: int, walked: set[tuple[int, int]]) -> list[int]:
    nodes = [start, step]
    walked.update(((start, step), (step, start)))
    while len(neighbours[nodes[-1]]) == 2 and nodes[-1] != start:
        here = nodes[-1]
        a, b = neighbours[here]
        onward = b if a == nodes[-2] else a
        walked.update(((here, onward), (onward, here)))
        nodes.append(onward)
    return nodes


def _prune(points: Points, neighbours: Neighbours, shortest: float) -> None:
    """Cut off branches from a junction to a free end, the shortest first, until none is shorter than `shortest`."""
    while True:
        branches = []
        for chain in _chains(neighbours):
            nodes = chain.nodes
            ends = (len(neighbours[nodes[0]]), len(neighbours[nodes[-1]]))
            if chain.closed or min(ends) != 1 or max(ends) < 3:
                continue
            length = path_length(points, nodes)
            if length < shortest:
                branches.append((length, nodes if ends[0] == 1 else nodes[::-1]))
        cut = False
        for _, nodes in sorted(branches):
            # What is left at a former junction is no longer a branch, but part of the curve through it.
            if len(neighbours[nodes[-1]]) >= 3:
                _remove(neighbours, nodes[:-1])
                cut = True
        if not cut:
            return


def _bridge(points: Points, neighbours: Neighbours, gap: float, link: float, loop: float) -> None:
    """Join free ends across gaps, the nearest first, where both look towards each other."""
    ends, outward, partner, length = _free_ends(points, neighbours, 2.0 * link)
    if len(ends) < 2:
        return
    where = points[ends]
    candidates = []
    for i, j in KDTree(where).query_pairs(gap, output_type="ndarray").tolist():
        across = where[j] - where[i]
        distance = float(np.linalg.norm(across))
        if partner.get(i) == j and length[i] + distance < loop:
            continue
        facing = min(outward[i] @ across, -(outward[j] @ across))
        # Close ends meet under any angle, as at a corner; across a real gap both must point to the other side.
        if distance <= link or facing >= 0.5 * distance:
            candidates.append((distance, min(i, j), max(i, j)))
    used: set[int] = set()
    for _, i, j in sorted(candidates):
        if i not in used and j not in used:
            used.update((i, j))
            _connect(neighbours, int(ends[i]), int(ends[j]))


def _free_ends(points: Points, neighbours: Neighbours, reach: float) -> tuple[NDArray[np.int64], Points, dict[int, int], dict[int, float]]:
    """Return the free ends, their outward directions, and for ends of one chain each other's number and the chain's length."""
    ends: list[int] = []
    outward: list[NDArray[np.float64]] = []
    partner: dict[int, int] = {}
    length: dict[int, float] = {}
    for chain in _chains(neighbours):
        if chain.closed:
            continue
        numbers = []
        for nodes in (chain.nodes, chain.nodes[::-1]):
            if len(neighbours[nodes[0]]) == 1:
                numbers.append(len(ends))
                ends.append(nodes[0])
                outward.append(_end_direction(points[nodes], reach))
        if len(numbers) == 2:
            partner[numbers[0]], partner[numbers[1]] = numbers[1], numbers[0]
            length[numbers[0]] = length[numbers[1]] = path_length(points, chain.nodes)
    return np.array(ends, np.int64), np.array(outward), partner, length


def _end_direction(row: Points, reach: float) -> NDArray[np.float64]:
    """Return the unit direction in which a row of points ends, at its first point."""
    beyond = np.flatnonzero(np.linalg.norm(row - row[0], axis=1) > reach)
    near = row[: beyond[0]] if len(beyond) else row
    inward = near.mean(axis=0) - row[0] if len(near) > 1 else row[min(1, len(row) - 1)] - row[0]
    size = np.linalg.norm(inward)
    return -inward / size if size > 0.0 else inward
