"""Corners of four faces and more: vertices that lie so close that one place serves them all are one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.complex import Loop, length_of
from scan2nurbs.faces.draw import Drawn, settle
from scan2nurbs.faces.place import measure
from scan2nurbs.faces.trace import Traced
from scan2nurbs.surfaces.shape import Floats, Shape

Ends = NDArray[np.int32]

SHORT = 4.0
"""Length, in h, of a border that may vanish."""
GAP = 0.25
"""Farthest, in h, that the one vertex may lie from the surfaces of all faces that meet there."""


def merge_vertices(traced: Traced, drawn: Drawn, shapes: Sequence[Shape], h: float) -> tuple[Traced, Drawn]:
    """Take short borders out whose two vertices may as well be one, the shortest first.

    Parameters
    ----------
    traced, drawn : Traced, Drawn
        The complex and its places.
    shapes : sequence of Shape
        Surface of each face.
    h : float
        Spacing of the points.

    Notes
    -----
    A border stays if a loop would be left with none, if a face would touch itself at the vertex, or if one place lies on all surfaces
    no better than `GAP`.
    """
    ends = traced.ends.copy()
    loops: list[list[Loop]] = [list(some) for some in traced.loops]
    vertices, lines = drawn.vertices.copy(), list(drawn.lines)
    faces = [set(f) for f in drawn.faces]
    gone = np.zeros(len(ends), bool)
    at: list[list[int]] = [[] for _ in vertices]
    for b, (u, v) in enumerate(ends):
        if u >= 0:
            at[u].append(b)
            at[v].append(b)
    length = np.array([length_of(line) for line in lines])
    for b in np.argsort(length, kind="stable"):
        u, v = (int(x) for x in ends[b])
        if length[b] > SHORT * h:
            break
        if u < 0 or u == v or not _may_go(int(b), (u, v), ends, at, faces, traced, loops):
            continue
        both = faces[u] | faces[v]
        place, gap = _one_place(0.5 * (vertices[u] + vertices[v]), both, shapes, h)
        if gap > GAP * h or max(np.linalg.norm(place - vertices[u]), np.linalg.norm(place - vertices[v])) > SHORT * h:
            continue
        gone[b] = True
        vertices[u], faces[u], faces[v] = place, both, set()
        at[u] = [c for c in at[u] + at[v] if c != b]
        at[v] = []
        for c in at[u]:
            ends[c][ends[c] == v] = u
        for f in traced.sides[b]:
            if f >= 0:
                loops[f] = [tuple(x for x in loop if x[0] != b) for loop in loops[f]]
    return without_borders(traced, ends, loops, vertices, lines, faces, gone)


def _may_go(
    b: int, pair: tuple[int, int], ends: Ends, at: list[list[int]], faces: list[set[int]], traced: Traced, loops: list[list[Loop]]
) -> bool:
    u, v = pair
    sides = {int(f) for f in traced.sides[b]}
    # Faces other than its sides that lie at both ends would touch themselves.
    if (faces[u] & faces[v]) - sides:
        return False
    # So would the sides, if another border ran between the same two vertices.
    if any(c != b and set(ends[c]) == {u, v} for c in at[u]):
        return False
    return all(len(loop) > 2 for f in sides if f >= 0 for loop in loops[f] if any(x[0] == b for x in loop))


def _one_place(place: Floats, faces: set[int], shapes: Sequence[Shape], h: float) -> tuple[Floats, float]:
    meeting = np.array([sorted(faces)], np.int32)
    found = settle(place[None], meeting, shapes, h)
    return found[0], float(np.abs(measure(found, meeting, shapes)[0]).max())


def without_borders(
    traced: Traced,
    ends: Ends,
    loops: list[list[Loop]],
    vertices: Floats,
    lines: list[Floats],
    faces: list[set[int]],
    gone: NDArray[np.bool_],
) -> tuple[Traced, Drawn]:
    """Renumber borders and vertices without those that are gone."""
    number = np.where(gone, -1, np.cumsum(~gone) - 1)
    used = np.zeros(len(vertices), bool)
    kept = ends[~gone]
    used[kept[kept >= 0]] = True
    rank = np.append(np.where(used, np.cumsum(used) - 1, -1), -1)  # the last one for closed borders
    for b in np.flatnonzero(~gone):
        if ends[b][0] >= 0:
            lines[b] = np.concatenate([vertices[ends[b][:1]], lines[b][1:-1], vertices[ends[b][1:]]])
    new = replace(
        traced,
        borders=tuple(x for x, g in zip(traced.borders, gone, strict=True) if not g),
        sides=traced.sides[~gone],
        ends=rank[kept].astype(np.int32),
        corners=traced.corners[used],
        loops=tuple(tuple(tuple((int(number[b]), way) for b, way in loop) for loop in group) for group in loops),
    )
    places = Drawn(
        vertices[used],
        [x for x, g in zip(lines, gone, strict=True) if not g],
        [tuple(sorted(f)) for f, k in zip(faces, used, strict=True) if k],
    )
    return new, places
