"""Set operations on closed polylines: whatever loops come in, simple loops with the region on their left go out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CHUNK = 2_000_000
_PASSES = 2
_REACH = 64.0


def overlay(loops: Sequence[Floats], keep: Callable[[Ints], bool], *, snap: float) -> list[Floats]:
    """Return the border of a region of the plane as simple closed polylines.

    The loops cut the plane into cells; `keep` decides each cell from how often each loop winds around it. Loops may cross
    themselves and each other, touch, or run on top of each other.

    Parameters
    ----------
    loops : sequence of (K, 2) float64
        Closed polylines; the last point is joined to the first.
    keep : callable
        Gets the winding number of every loop, (L,) int64, and says whether the cell belongs to the region.
    snap : float
        Points closer than this are taken for one.

    Returns
    -------
    list of (K, 2) float64
        Simple closed polylines (none repeats a point) with the region on their left: counter-clockwise around it, clockwise
        around its holes. They may touch each other in points.

    Notes
    -----
    Segments are split where they cross and their ends are snapped, so that the pieces between two nodes lie wholly on the border
    of one cell each; a piece is kept where the region lies on exactly one of its sides. O(K log K) for loops that are not wild.
    """
    points, sequences = _arrangement(loops, snap)
    for _ in range(_PASSES):
        # Snapping moves segments by up to a snap: further passes find what that made meet.
        points, sequences = _arrangement([points[ids] for ids in sequences], snap)
    border = _border(points, _chains(sequences), [points[ids] for ids in sequences], keep, snap)
    return [points[loop] for loop in _link(points, border + _bridges(points, border, _REACH * snap))]


def area(loop: Floats) -> float:
    """Return the signed area of a closed polyline: positive when it runs counter-clockwise."""
    x, y = (loop - loop[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def winding(loop: Floats, points: Floats) -> Ints:
    """Return how often the closed polyline (K, 2) winds around each of the (Q, 2) points."""
    start, end = loop, np.roll(loop, -1, axis=0)
    number = np.zeros(len(points), np.int64)
    step = max(1, _CHUNK // max(1, len(loop)))
    for first in range(0, len(points), step):
        x, y = (column[:, None] for column in points[first : first + step].T)
        side = (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (x - start[:, 0]) * (end[:, 1] - start[:, 1])
        up = (start[:, 1] <= y) & (end[:, 1] > y) & (side > 0)
        down = (start[:, 1] > y) & (end[:, 1] <= y) & (side < 0)
        number[first : first + step] = up.sum(axis=1) - down.sum(axis=1)
    return number


def crosses(loops: Sequence[Floats], snap: float) -> bool:
    """Say whether any two segments meet other than the neighbours of one loop in their common point."""
    start, end, label = _segments(loops)
    i, j = _candidates(start, end, snap)
    size = np.array([len(loop) for loop in loops])[label]
    first = np.concatenate([[0], np.cumsum([len(loop) for loop in loops])])[label]
    gap = np.abs(i - j)
    neighbours = (label[i] == label[j]) & ((gap == 1) | (gap == size[i] - 1) & (np.minimum(i, j) == first[i]))
    segment, _ = _meetings(start, end, i[~neighbours], j[~neighbours], snap)
    return len(segment) > 0


def crossings(loops: Sequence[Floats]) -> list[tuple[int, int, int, int]]:
    """Return the pairs of segments that cross within both, each as (loop, segment, loop, segment)."""
    start, end, label = _segments(loops)
    i, j = _candidates(start, end, 0.0)
    proper = _proper(start[i], end[i] - start[i], start[j], end[j] - start[j])[0]
    first = np.concatenate([[0], np.cumsum([len(loop) for loop in loops])])
    pairs = zip(i[proper].tolist(), j[proper].tolist(), strict=True)
    return [(int(label[a]), int(a - first[label[a]]), int(label[b]), int(b - first[label[b]])) for a, b in pairs]


def _segments(loops: Sequence[Floats]) -> tuple[Floats, Floats, Ints]:
    start = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    return start, end, np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])


def _candidates(start: Floats, end: Floats, snap: float) -> tuple[Ints, Ints]:
    """Return the pairs of segments whose bounding boxes, widened by `snap`, overlap."""
    low, high = np.minimum(start, end) - snap, np.maximum(start, end) + snap
    axis = int(np.argmin(np.median(high - low, axis=0) / np.maximum(np.ptp(low, axis=0), max(snap, 1e-300))))
    order = np.argsort(low[:, axis], kind="stable")
    sorted_low = low[order, axis]
    until = np.searchsorted(sorted_low, high[order, axis], side="right")
    counts = until - np.arange(len(order)) - 1
    found: list[tuple[Ints, Ints]] = []
    ends = np.cumsum(counts)
    first = 0
    while first < len(order):
        last = max(first + 1, int(np.searchsorted(ends, (ends[first - 1] if first else 0) + _CHUNK, side="right")))
        count = counts[first:last]
        i = np.repeat(np.arange(first, last), count)
        j = i + 1 + np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
        i, j = order[i], order[j]
        other = 1 - axis
        overlap = (low[i, other] <= high[j, other]) & (low[j, other] <= high[i, other])
        found.append((np.minimum(i, j)[overlap], np.maximum(i, j)[overlap]))
        first = last
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def _meetings(start: Floats, end: Floats, i: Ints, j: Ints, snap: float) -> tuple[Ints, Floats]:
    """Return where segments must be split: their index, and the parameter in (0, 1) at which another one crosses or touches."""
    segment: list[Ints] = []
    parameter: list[Floats] = []
    a, r, c, s = start[i], end[i] - start[i], start[j], end[j] - start[j]
    for base, along, owner, tips in ((a, r, i, (c, c + s)), (c, s, j, (a, a + r))):
        length = np.maximum(np.einsum("nd,nd->n", along, along), 1e-300)
        for tip in tips:
            t = np.einsum("nd,nd->n", tip - base, along) / length
            away = np.linalg.norm(base + np.clip(t, 0, 1)[:, None] * along - tip, axis=1)
            touching = away <= snap
            segment.append(owner[touching])
            parameter.append(np.clip(t[touching], 0.0, 1.0))
    proper, t, q = _proper(a, r, c, s)
    segment += [i[proper], j[proper]]
    parameter += [t[proper], q[proper]]
    return np.concatenate(segment), np.concatenate(parameter)


def _proper(a: Floats, r: Floats, c: Floats, s: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """Tell which segments from a by r and from c by s cross within both, and return the parameters at which they do."""
    det = r[:, 0] * s[:, 1] - r[:, 1] * s[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        gap = c - a
        t = (gap[:, 0] * s[:, 1] - gap[:, 1] * s[:, 0]) / det
        q = (gap[:, 0] * r[:, 1] - gap[:, 1] * r[:, 0]) / det
    return (t > 0) & (t < 1) & (q > 0) & (q < 1), t, q


def _arrangement(loops: Sequence[Floats], snap: float) -> tuple[Floats, list[Ints]]:
    """Split all segments where they meet; return the distinct points and each loop as a cyclic sequence of their indices."""
    start, end, label = _segments(loops)
    segment, parameter = _meetings(start, end, *_candidates(start, end, snap), snap)
    owner = np.concatenate([np.arange(len(start)), segment])
    along = np.concatenate([np.zeros(len(start)), parameter])
    order = np.lexsort((along, owner))
    owner, along = owner[order], along[order]
    every = start[owner] + along[:, None] * (end - start)[owner]
    pairs = KDTree(every).query_pairs(snap, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(every), len(every)))
    count, cluster = connected_components(graph, directed=False)
    points = np.empty((count, 2))
    points[cluster[::-1]] = every[::-1]  # the first point of a cluster stands for it
    sequences = []
    for loop in range(len(loops)):
        ids = cluster[label[owner] == loop].astype(np.int64)
        ids = ids[ids != np.roll(ids, 1)] if len(ids) > 1 else ids
        sequences.append(ids)
    return points, sequences


def _chains(sequences: list[Ints]) -> list[Ints]:
    """Cut the loops at their nodes, where more than two pieces meet; return each distinct chain once. A closed one repeats its start."""
    sequences = [ids for ids in sequences if len(ids) > 1]
    neighbours: dict[int, set[int]] = {}
    for ids in sequences:
        for a, b in zip(ids.tolist(), np.roll(ids, -1).tolist(), strict=True):
            neighbours.setdefault(a, set()).add(b)
            neighbours.setdefault(b, set()).add(a)
    chains: dict[tuple[int, ...], Ints] = {}
    for ids in sequences:
        cuts = [k for k, point in enumerate(ids.tolist()) if len(neighbours[point]) != 2]
        # A loop without nodes is one chain; starting at its smallest index, equal loops give equal chains.
        cuts = cuts or [int(np.argmin(ids))]
        ring = np.concatenate([ids, ids])
        for k, begin in enumerate(cuts):
            stop = cuts[k + 1] if k + 1 < len(cuts) else cuts[0] + len(ids)
            chain = ring[begin : stop + 1]
            chains.setdefault(min(tuple(chain.tolist()), tuple(chain[::-1].tolist())), chain)
    return list(chains.values())


def _border(points: Floats, chains: list[Ints], loops: Sequence[Floats], keep: Callable[[Ints], bool], snap: float) -> list[Ints]:
    """Return the chains with the region on one side only, turned so that it is the left one."""
    probes = np.empty((2 * len(chains), 2))
    for k, chain in enumerate(chains):
        step = np.diff(points[chain], axis=0)
        length = np.linalg.norm(step, axis=1)
        longest = int(np.argmax(length))
        middle = points[chain[longest]] + 0.5 * step[longest]
        # In the cell beside the chain: other segments were split and snapped where they come closer than a snap.
        left = 0.25 * snap / length[longest] * np.array([-step[longest, 1], step[longest, 0]])
        probes[2 * k : 2 * k + 2] = middle + left, middle - left
    inside = [keep(numbers) for numbers in np.stack([winding(loop, probes) for loop in loops], axis=1)]
    sides = zip(chains, inside[::2], inside[1::2], strict=True)
    return [chain if on_left else chain[::-1] for chain, on_left, on_right in sides if on_left != on_right]


def _bridges(points: Floats, chains: list[Ints], reach: float) -> list[Ints]:
    """Return what is missing for as many chains to leave every node as arrive there.

    Segments that run side by side a few snaps apart hide from each other which side of a tiny piece the region is on. The nodes at
    its ends then lack a way out or in, and are joined.
    """
    excess = np.zeros(len(points), np.int64)
    for chain in chains:
        excess[chain[0]] -= 1
        excess[chain[-1]] += 1
    stranded, awaited = (np.repeat(np.arange(len(points)), np.maximum(sign * excess, 0)) for sign in (1, -1))
    if not len(stranded):
        return []
    apart = np.linalg.norm(points[stranded][:, None] - points[awaited], axis=2)
    bridges = []
    for flat in np.argsort(apart, axis=None, kind="stable"):
        i, j = np.unravel_index(flat, apart.shape)
        if apart[i, j] > reach:
            continue
        bridges.append(np.array([stranded[i], awaited[j]]))
        apart[i], apart[:, j] = np.inf, np.inf
    return bridges


def _link(points: Floats, chains: list[Ints]) -> list[Ints]:
    """Join oriented chains to simple closed loops; chains that lead nowhere are left out."""
    leaving: dict[int, list[int]] = {}
    for k, chain in enumerate(chains):
        leaving.setdefault(int(chain[0]), []).append(k)
    loops: list[Ints] = []
    used = [False] * len(chains)
    for seed in range(len(chains)):
        path: list[int] = []
        k: int | None = seed
        while k is not None and not used[k]:
            used[k] = True
            path.append(k)
            node = int(chains[k][-1])
            begins = [int(chains[m][0]) for m in path]
            if node in begins:  # the path has come back to a node: what lies between is a loop
                first = begins.index(node)
                loops.append(np.concatenate([chains[m][:-1] for m in path[first:]]))
                del path[first:]
            k = _next(points, chains, [m for m in leaving.get(node, []) if not used[m]], chains[k])
    return [loop for loop in loops if len(loop) > 2]


def _next(points: Floats, chains: list[Ints], choices: list[int], arriving: Ints) -> int | None:
    """Choose the chain that borders the same wedge of the region: the first one clockwise from where we came."""
    if len(choices) < 2:
        return choices[0] if choices else None
    back = points[arriving[-2]] - points[arriving[-1]]
    turns = []
    for k in choices:
        ahead = points[chains[k][1]] - points[chains[k][0]]
        angle = np.arctan2(back[0] * ahead[1] - back[1] * ahead[0], back @ ahead)
        turns.append(-angle % (2.0 * np.pi))
    return choices[int(np.argmin(turns))]
