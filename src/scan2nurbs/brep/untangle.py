"""Borders of a face that cross beside a vertex: the tip between them is given up, and they meet where they cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.charts import Chart
from scan2nurbs.brep.layout import Path, unwrapped
from scan2nurbs.brep.overlay import crossings
from scan2nurbs.faces.topology import Border, Loop, Topology

Floats = NDArray[np.float64]

_STEP, _FEWEST, _MOST = 0.2, 16, 800
"""Distance of the places where borders are looked at, in h, and how many these are on one."""
_BESIDE = 12
"""Into how many parts the steps beside a vertex are divided."""
_LONGEST = 4.0
"""How far from the crossing, in h, the tip may reach."""
_SMALL = 0.5
"""A tip is small whose vertices lie so near the crossing, in h."""
_SHARE = 0.4
"""How much of a border may be given up with it."""


@dataclass(frozen=True)
class Tangle:
    """Two borders of a face that cross.

    Attributes
    ----------
    borders : (int, int)
        Which, in the order of the face's loop, the tip between them.
    within : tuple of int
        Borders of the tip that lie wholly between them.
    vertices : tuple of int
        The vertices of the tip, in order: one more than the borders within.
    place : (3,) float64
        Where they cross.
    """

    borders: tuple[int, int]
    within: tuple[int, ...]
    vertices: tuple[int, ...]
    place: Floats


def find_tangles(chart: Chart, loops: Sequence[Path], curves: Sequence[BorderCurve], h: float, least: float = 0.0) -> list[Tangle]:
    """Find where consecutive borders of a face cross in its parameters, or those beside a short one.

    Parameters
    ----------
    chart : Chart
        Of the face.
    loops : sequence of paths
        Its borders in order.
    curves : sequence of BorderCurve
    h : float
        Spacing of the cloud.
    least : float
        Tips that reach no farther are left out.
    """
    found: dict[tuple[int, ...], Tangle] = {}
    for loop in loops:
        if len(loop) < 2:
            continue
        points, which = _sampled(loop, curves, h)
        uv = unwrapped(chart.uv(points), chart)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        goes_around = any(p and abs(uv[-1, axis] - uv[0, axis]) > 0.5 * p for axis, p in enumerate(chart.period))
        for _, i, _, j in crossings([uv]):
            first, second = min(i, j), max(i, j)
            if goes_around and second == len(points) - 1:  # the way back to where it began is none of its steps
                continue
            if length[second] - length[first] > 0.5 * length[-1]:
                first, second = second, first
            tangle = _tangle(loop, curves, which[first], which[second], 0.5 * (points[first] + points[second]))
            if tangle is not None and _is_tip(tangle, curves, h, least):
                found.setdefault(tangle.vertices, tangle)
    return list(found.values())


@dataclass(frozen=True)
class Untangled:
    """A topology whose borders meet where they crossed.

    Attributes
    ----------
    topology : Topology
    kept : (K,) int64
        The number that each of its borders had.
    changed : frozenset of int
        Its borders that end elsewhere now.
    """

    topology: Topology
    kept: NDArray[np.int64]
    changed: frozenset[int]


def untangled(topology: Topology, tangles: Sequence[Tangle], h: float) -> Untangled | None:
    """Let borders meet where they cross; None where there is nothing to be done.

    Parameters
    ----------
    topology : Topology
    tangles : sequence of Tangle
        Of those that share a border only the first is looked at.
    h : float
        Spacing of the cloud.
    """
    borders, vertices, loops = list(topology.borders), topology.vertices.copy(), [list(some) for some in topology.loops]
    gone: set[int] = set()
    changed: set[int] = set()
    held = set(topology.held)
    for tangle in tangles:
        near = {k for k, border in enumerate(borders) if set(border.vertices) & set(tangle.vertices)}
        small = all(np.linalg.norm(vertices[v] - tangle.place) <= _SMALL * h for v in tangle.vertices)
        if near & (changed | gone) or not _may_meet(tangle, near, borders, loops, small):
            continue
        one = tangle.vertices[0]
        vertices[one] = tangle.place
        held.update([one] if small else [])  # else the surfaces may move it on
        gone.update(tangle.within)
        tips = {v: _tip(borders[tangle.borders[0 if k == 0 else 1]], v, tangle.place) for k, v in enumerate(tangle.vertices)}
        for k in sorted(near - gone):
            border = borders[k]
            for end in (0, 1):
                v = border.vertices[end]
                if v in tips:
                    border = _ended(border, end, one, tangle.place, () if k in tangle.borders else tips[v])
            borders[k] = border
            changed.add(k)
        for f, some in enumerate(loops):
            loops[f] = [tuple(step for step in loop if step[0] not in gone) for loop in some]
    if not changed:
        return None
    return _renumbered(replace(topology, held=frozenset(held)), borders, vertices, loops, gone, changed)


def _sampled(loop: Path, curves: Sequence[BorderCurve], h: float) -> tuple[Floats, NDArray[np.int64]]:
    """Return points (K, 3) along a loop, and to which of its steps each belongs."""
    points, which = [], []
    for step, (border, forward) in enumerate(loop):
        curve = curves[border].curve
        rough = curve(curve.samples(_FEWEST))
        length = float(np.linalg.norm(np.diff(rough, axis=0), axis=1).sum())
        t = curve.samples(int(np.clip(length / (_STEP * h), _FEWEST, _MOST)))
        ends = np.linspace(0.0, 1.0, _BESIDE + 1)[1:-1]  # beside vertices tips may be ever so short
        at = curve(np.concatenate([t[:1], t[0] + ends * (t[1] - t[0]), t[1:-1], t[-2] + ends * (t[-1] - t[-2]), t[-1:]]))
        points.append((at if forward else at[::-1])[:-1])
        which.append(np.full(len(at) - 1, step))
    return np.vstack(points), np.concatenate(which)


def _tangle(loop: Path, curves: Sequence[BorderCurve], first: int, second: int, place: Floats) -> Tangle | None:
    """Return what is between two steps of a loop; None where it is one step, or more than one lies between them."""
    between = (second - first) % len(loop)
    if between not in (1, 2) or loop[first][0] == loop[second][0]:
        return None
    steps = [(first + k) % len(loop) for k in range(between + 1)]
    vertices = tuple(curves[loop[k][0]].vertices[0 if loop[k][1] else 1] for k in steps[1:])
    return Tangle((loop[first][0], loop[second][0]), tuple(loop[k][0] for k in steps[1:-1]), vertices, place)


def _is_tip(tangle: Tangle, curves: Sequence[BorderCurve], h: float, least: float) -> bool:
    """Tell whether the tip is short, beside the borders that it is cut from, too."""
    if min(tangle.vertices) < 0:
        return False
    reach = 0.0
    for border, vertex in zip(tangle.borders, (tangle.vertices[0], tangle.vertices[-1]), strict=True):
        curve = curves[border].curve
        points = curve(curve.samples(_FEWEST))
        end = points[0] if curves[border].vertices[0] == vertex else points[-1]
        away = float(np.linalg.norm(end - tangle.place))
        if away > min(_LONGEST * h, _SHARE * float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())):
            return False
        reach = max(reach, away)
    return reach > least


def _may_meet(tangle: Tangle, near: set[int], borders: Sequence[Border], loops: Sequence[Sequence[Loop]], small: bool) -> bool:
    """Tell whether the vertices of a tip may be one: corners of three faces each, unless it is small; other borders lead elsewhere."""
    ends = [v for k in near for v in borders[k].vertices]
    if not small and any(ends.count(v) != 3 for v in tangle.vertices):  # two borders cannot both be led on along the tip
        return False
    # A border between the vertices, other than those of the tip, would become a ring, and a face touch itself.
    if any(k not in tangle.within and set(borders[k].vertices) <= set(tangle.vertices) for k in near):
        return False
    beside = {f for k in tangle.within for f in borders[k].faces if f >= 0}
    return all(len(loop) > 2 for f in beside for loop in loops[f] if any(k in tangle.within for k, _ in loop))


def _tip(border: Border, vertex: int, place: Floats) -> tuple[Floats, ...]:
    """Return the points of a border from a place near it to one of its vertices, without both."""
    points = border.points if border.vertices[1] == vertex else border.points[::-1]
    near = int(np.argmin(np.linalg.norm(points - place, axis=1)))
    return tuple(points[near + 1 : -1])


def _ended(border: Border, end: int, vertex: int, place: Floats, further: tuple[Floats, ...]) -> Border:
    """Let a border end in another place: cut off where it passes that, or led on by further points, the first nearest to the place."""
    points = border.points if end == 1 else border.points[::-1]
    if further:
        points = np.vstack([points, *further[::-1], place])
    else:
        near = int(np.argmin(np.linalg.norm(points - place, axis=1)))
        points = np.vstack([points[: max(near, 1)], place])
    vertices = (border.vertices[0], vertex) if end == 1 else (vertex, border.vertices[1])
    return replace(border, points=points if end == 1 else points[::-1].copy(), vertices=vertices)


def _renumbered(
    topology: Topology, borders: Sequence[Border], vertices: Floats, loops: Sequence[list[Loop]], gone: set[int], changed: set[int]
) -> Untangled:
    kept = np.array([k for k in range(len(borders)) if k not in gone], np.int64)
    number = {int(k): new for new, k in enumerate(kept)}
    again = replace(
        topology,
        borders=tuple(borders[k] for k in kept),
        vertices=vertices,  # those that were merged stay, and nothing ends there
        loops=tuple(tuple(tuple((number[k], forward) for k, forward in loop) for loop in some) for some in loops),
    )
    return Untangled(again, kept, frozenset(number[k] for k in changed))
