"""Faces of a part trimmed along shared borders, by one set of curves for all of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.borders import BorderCurve, lay_borders, without_faces
from scan2nurbs.brep.charts import chart_of
from scan2nurbs.brep.check import is_valid, is_valid_meshed
from scan2nurbs.brep.crossing import borders_cross
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.layout import Layout, cuts, lay_out
from scan2nurbs.brep.occ import kernel_errors
from scan2nurbs.brep.regions import regions
from scan2nurbs.brep.sharing import KernelPart, Piece, steps_of
from scan2nurbs.brep.untangle import Tangle, find_tangles
from scan2nurbs.brep.wide import widened
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.topology import Topology
from scan2nurbs.surfaces.shape import Shape

Floats = NDArray[np.float64]

_NEAR = 0.02
_LOOP = 2.0
"""Loops between borders that cross, shorter than this, in h, vanish between triangles."""


@dataclass(frozen=True)
class SharedFaces:
    """Faces on shared edges.

    Attributes
    ----------
    faces : tuple of tuples of TopoDS_Face
        Of each face of the topology; usually one, none where it failed.
    failures : dict of int to str
        Why a face failed.
    curves : tuple of BorderCurve
        One a border.
    left_out : set of int
        Faces that were not tried.
    layouts : tuple of Layout or None
        How the faces lie in their parameters.
    """

    faces: tuple[tuple[Any, ...], ...]
    failures: dict[int, str]
    curves: tuple[BorderCurve, ...]
    left_out: frozenset[int] = frozenset()
    layouts: tuple[Layout | None, ...] = ()

    def tangles(self, topology: Topology, faces: Iterable[int], h: float, least: float = 0.0) -> list[Tangle]:
        """Find where borders of some faces of a topology cross beside a vertex, no nearer to it than `least`; see `find_tangles`."""
        laid = [(f, layout) for f in faces if (layout := self.layouts[f]) is not None]
        return [tangle for f, layout in laid for tangle in find_tangles(layout.chart, _loops(topology, f), self.curves, h, least)]


@dataclass
class _Work:
    curves: list[BorderCurve]
    vertices: Floats
    marks: list[list[float]]
    pieces: list[Piece] = field(default_factory=list)
    of_border: list[list[int]] = field(default_factory=list)
    failures: dict[int, str] = field(default_factory=dict)


def trim_faces(
    shapes: Sequence[Shape],
    topology: Topology,
    h: float,
    scale: float,
    caution: Sequence[int] | None = None,
    without: Mapping[int, str] | None = None,
    known: Known | None = None,
    fine: bool = False,
) -> SharedFaces:
    """Trim the faces of a topology along curves that are laid once a border.

    Parameters
    ----------
    shapes : sequence of Shape
        Of each face.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    caution : sequence of int, optional
        As in `lay_borders`.
    without : mapping of int to str, optional
        Faces to leave out, and why: where they were, their neighbours end freely.
    known : Known, optional
        What attempts to trim the faces of the same topology have computed.
    fine : bool
        Whether a face that coarse triangles fit, but no fine ones, has failed.
    """
    skipped, known = dict(without or {}), known or Known()
    if skipped:
        topology = replace(topology, borders=tuple(without_faces(border, skipped, known) for border in topology.borders))
    shapes = [known(("wide", f, s), lambda f=f, s=s: widened(s, border_points(topology, f), h)) for f, s in enumerate(shapes)]
    curves, vertices = lay_borders(topology.borders, topology.vertices, shapes, h, caution, known, topology.held)
    work = _Work(curves, vertices, [[] for _ in curves], failures=dict(skipped))
    layouts = [None if f in skipped else _layout(work, shape, _loops(topology, f), f, h, scale, known) for f, shape in enumerate(shapes)]
    _cut(work, known)
    kernel = KernelPart(work.vertices, work.pieces, scale, 0.0, known)
    faces: list[list[Any]] = [[] for _ in shapes]
    for f, layout in enumerate(layouts):
        if layout is None:
            continue
        try:
            loops = [[p for k, forward in loop for p in _pieces_of(work, k, forward)] for loop in _loops(topology, f)]
            for wires in regions(layout, [steps_of(layout, loop, work.pieces, known) for loop in loops]):
                with kernel_errors("make the face"):
                    faces[f].append(kernel.face(layout, wires, topology.outward[f] < 0))
        except (NoResultError, ValueError, IndexError) as error:
            work.failures[f], faces[f] = str(error), []
    for f, made in enumerate(faces):
        if made:
            outline = _outline(work, kernel, [step for loop in _loops(topology, f) for step in loop])
            fault = known(("fault", f, shapes[f], fine, len(made), *outline), lambda m=made: _fault(m, fine, _LOOP * h * scale))
            work.failures.update({f: fault} if fault else {})
    return SharedFaces(tuple(map(tuple, faces)), work.failures, tuple(work.curves), frozenset(skipped), tuple(layouts))


def _fault(made: Sequence[Any], fine: bool, least: float) -> str:
    """Return what is wrong with the faces that a face was made into, nothing if nothing is; see `borders_cross` for `least`."""
    if not all(is_valid(face) for face in made):
        return "The CAD kernel's check finds it invalid."
    if fine and any(borders_cross(face, least) for face in made):  # fine triangles might take the kernel minutes
        return "Its borders cross."
    return "" if all(is_valid_meshed(face, every=fine) for face in made) else "It cannot be triangulated."


def _outline(work: _Work, kernel: KernelPart, loop: Sequence[tuple[int, bool]]) -> list[object]:
    """List all that the kernel is told of the edges and vertices around a face."""
    out: list[object] = []
    for border, forward in loop:
        for number, _ in _pieces_of(work, border, forward):
            piece = work.pieces[number]
            ends = work.vertices[list(piece.nodes)].tobytes()
            out += [piece.curve, *piece.domain, piece.gap, forward, ends, *(kernel.tolerance(node) for node in piece.nodes)]
    return out


def border_points(topology: Topology, f: int) -> Floats:
    """Return the points of all borders of a face, (N, 3)."""
    return np.vstack([np.empty((0, 3)), *(topology.borders[k].points for loop in topology.loops[f] for k, _ in loop)])


def _layout(work: _Work, shape: Shape, loops: list[Any], f: int, h: float, scale: float, known: Known) -> Layout | None:
    """Lay a face out, and mark where its seams cut its borders."""
    around = list(dict.fromkeys(k for loop in loops for k, _ in loop))

    def lay() -> tuple[Layout | None, list[list[float]], str]:
        try:
            chart = chart_of(shape, scale, towards=sphere_axis(shape, loops, work.curves))
            layout = lay_out(chart, loops, work.curves, work.marks, h)
            return layout, [cuts(layout, work.curves[k], h) if any(layout.cut) else [] for k in around], ""
        except (NoResultError, ValueError) as error:
            return None, [], str(error)

    borders = [given for loop in loops for k, forward in loop for given in (len(loop), work.curves[k], forward)]
    marks = [np.array(work.marks[k]).tobytes() for k in around]
    layout, found, why_not = known(("layout", f, shape, *borders, *marks), lay)
    if layout is None:
        work.failures[f] = why_not
        return None
    for k, at in zip(around, found, strict=True):
        _mark(work.marks[k], at, work.curves[k], h)
    return layout


def _loops(topology: Topology, f: int) -> list[tuple[tuple[int, bool], ...]]:
    loops = topology.loops[f]
    if topology.outward[f] > 0:
        return list(loops)
    return [tuple((k, not forward) for k, forward in reversed(loop)) for loop in loops]


def _pieces_of(work: _Work, border: int, forward: bool) -> list[tuple[int, bool]]:
    numbers = work.of_border[border]
    return [(p, forward) for p in (numbers if forward else numbers[::-1])]


def _mark(marks: list[float], found: list[float], curve: BorderCurve, h: float) -> None:
    for t in found:
        here = curve.curve(np.array([t, *marks]))
        if not marks or np.linalg.norm(here[1:] - here[0], axis=1).min() > _NEAR * h:
            marks.append(t)


def _cut(work: _Work, known: Known) -> None:
    vertices = list(work.vertices)

    def vertex(point: Floats) -> int:
        vertices.append(point)
        return len(vertices) - 1

    for k in range(len(work.curves)):
        given, marks = work.curves[k], sorted(work.marks[k])
        border, at = known(("started", given, *marks), lambda g=given, m=marks: _started(g, m))
        work.curves[k] = border
        nodes = [vertex(point) for point in border.curve(np.array(at))] if at else []
        first, last = border.vertices
        if border.closed:
            first = last = vertex(border.curve(np.array(border.curve.domain[:1]))[0])
        places = [border.curve.domain[0], *at, border.curve.domain[1]]
        ends = [first, *nodes, last]
        numbers = []
        for i in range(len(places) - 1):
            numbers.append(len(work.pieces))
            work.pieces.append(Piece(k, border.curve, (places[i], places[i + 1]), (ends[i], ends[i + 1]), border.gap))
        work.of_border.append(numbers)
    work.vertices = np.array(vertices).reshape(-1, 3)


def _started(border: BorderCurve, marks: list[float]) -> tuple[BorderCurve, list[float]]:
    """Let a ring start at the first of its marks; return it with the others, in order."""
    if not border.closed or not marks:
        return border, marks
    curve = border.curve.started_at(marks[0])
    if border.curve.kind == "circle":
        return replace(border, curve=curve), [t - marks[0] for t in marks[1:]]
    points = border.curve(np.array(marks[1:]))
    return replace(border, curve=curve), sorted(_nearest(curve, point) for point in points)


def sphere_axis(shape: Any, loops: Any, curves: Sequence[BorderCurve]) -> Floats | None:
    """Return a direction for the axis of a sphere whose poles lie far from all borders; that of a circle of it, if there is one."""
    if shape.kind != "sphere" or not loops:
        return None
    lines = [curves[k].curve(curves[k].curve.samples(32)) for loop in loops for k, _ in loop]
    away = np.vstack(lines) - shape.center
    away /= np.linalg.norm(away, axis=1)[:, None]
    k = np.arange(200) + 0.5
    tilt, turn = np.arccos(1 - k / 200), np.pi * (1 + 5**0.5) * k
    directions = np.column_stack([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
    clear = 1.0 - np.abs(directions @ away.T).max(axis=1)
    best, bonus = directions[int(np.argmax(clear))], float(clear.max())
    for loop in loops:
        for b, _ in loop:
            c = curves[b].curve
            if c.kind == "circle":
                z = np.cross(c.x, c.y)
                room = 1.0 - float(np.abs(away @ z).max())
                if room > 0.2 * bonus:
                    return z
    return best


def _nearest(curve: Any, point: Floats) -> float:
    t = np.linspace(curve.domain[0], curve.domain[1], 4096)
    for _ in range(4):
        k = int(np.argmin(np.linalg.norm(curve(t) - point, axis=1)))
        t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)], 64)
    return float(t[len(t) // 2])
