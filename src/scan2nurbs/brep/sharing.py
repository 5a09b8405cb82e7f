"""Vertices, edges and faces of the CAD kernel that share their borders."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from scan2nurbs.brep.charts import Chart
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.layout import Layout
from scan2nurbs.brep.occ import CONFUSION, to_knots, to_points
from scan2nurbs.brep.regions import Side, Step, Wire
from scan2nurbs.brep.space import SpaceCurve

Floats = NDArray[np.float64]

_SAMPLES = 24
_MOST = 384
_STRAIGHT = 1e-9
_MARGIN = 1.25
_SHORTEST = 1e-4


@dataclass(frozen=True)
class Piece:
    """A piece of a border between two vertices.

    Attributes
    ----------
    border : int
    curve : SpaceCurve
    domain : (float, float)
        Its part of the curve.
    nodes : (int, int)
        First and last vertex.
    gap : float
        Largest distance of the border's curve to its surfaces.
    """

    border: int
    curve: SpaceCurve
    domain: tuple[float, float]
    nodes: tuple[int, int]
    gap: float

    def samples(self) -> Floats:
        """Return parameters along the piece."""
        t = self.curve.samples(_SAMPLES)
        low, high = self.domain
        inner = t[(t > low) & (t < high)]
        return np.concatenate([[low], inner, [high]]) if len(inner) >= _SAMPLES // 2 else np.linspace(low, high, _SAMPLES + 1)


class KernelPart:
    """Kernel objects in the making: vertices and edges are made once and shared by the faces.

    Parameters
    ----------
    vertices : (V, 3) float64
    pieces : sequence of Piece
    scale : float
        Kernel lengths over the model's.
    least : float
        Smallest tolerance, in the kernel's lengths.
    known : Known, optional
        What was computed for pieces of the same curves in the same layouts.
    """

    def __init__(self, vertices: Floats, pieces: Sequence[Piece], scale: float, least: float, known: Known | None = None) -> None:
        from OCP.BRep import BRep_Builder

        self.build = BRep_Builder()
        self.points, self.pieces, self.scale = vertices, pieces, scale
        self.least, self.known = max(CONFUSION, least), known or Known()
        self._geometries: dict[int, Any] = {}
        self.vertices = [self._vertex(point) for point in vertices]
        self.edges = [self._edge(piece) for piece in pieces]

    def face(self, layout: Layout, wires: Sequence[Wire], reverse: bool) -> Any:
        """Return the face within wires, the outer one first; `reverse` where the surface's normal points into the body."""
        from OCP.TopAbs import TopAbs_REVERSED
        from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Wire

        face = TopoDS_Face()
        geometry = layout.chart.geometry()
        self.build.MakeFace(face, geometry, self.least)
        seams: dict[tuple[int, int, int], Any] = {}
        extra: dict[int, Any] = {}
        for parts in wires:
            wire = TopoDS_Wire()
            self.build.MakeWire(wire)
            for part in parts:
                if isinstance(part, Step):
                    self.build.Add(wire, self._use(layout, geometry, part))
                else:
                    self.build.Add(wire, self._side(layout.chart, geometry, part, seams, extra))
            wire.Closed(True)
            self.build.Add(face, wire)
        return TopoDS.Face(face.Oriented(TopAbs_REVERSED)) if reverse else face

    def tolerance(self, node: int) -> float:
        """Return the tolerance of a vertex, in the kernel's lengths."""
        from OCP.BRep import BRep_Tool

        return float(BRep_Tool.Tolerance_s(self.vertices[node]))

    def _vertex(self, point: Floats) -> Any:
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        vertex = TopoDS_Vertex()
        self.build.MakeVertex(vertex, gp_Pnt(*(point * self.scale).tolist()), self.least)
        return vertex

    def _edge(self, piece: Piece) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopoDS import TopoDS_Edge

        if piece.border not in self._geometries:
            self._geometries[piece.border] = piece.curve.geometry(self.scale)
        edge = TopoDS_Edge()
        tolerance = max(self.least, _MARGIN * piece.gap * self.scale)
        self.build.MakeEdge(edge, self._geometries[piece.border], tolerance)
        ends = piece.curve(np.array(piece.domain))
        for node, end, side in zip(piece.nodes, ends, (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
            self._widen(self.vertices[node], self.points[node], end, tolerance)
            self.build.Add(edge, self.vertices[node].Oriented(side))
        self.build.Range(edge, *(piece.curve.in_kernel(t, self.scale) for t in piece.domain))
        self.build.SameRange(edge, True)
        self.build.SameParameter(edge, True)
        return edge

    def _widen(self, vertex: Any, point: Floats, end: Floats, tolerance: float) -> None:
        apart = float(np.linalg.norm(point - end)) * self.scale
        self.build.UpdateVertex(vertex, max(1.01 * tolerance, 2.0 * apart + 1.01 * self.least))

    def _use(self, layout: Layout, geometry: Any, step: Step) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopLoc import TopLoc_Location

        edge, piece = self.edges[step.piece], self.pieces[step.piece]
        if layout.chart.period[0] is not None or not _is_plane(layout.chart):
            given = ("pcurve", layout, piece.curve, *piece.domain, piece.gap)
            flat = self.known(given, lambda: pcurve(layout, piece, self.scale))
            tolerance = max(self.least, _MARGIN * flat.gap * self.scale)
            self.build.UpdateEdge(edge, flat.geometry(), geometry, TopLoc_Location(), tolerance)
            for node in piece.nodes:
                self.build.UpdateVertex(self.vertices[node], 1.01 * tolerance)
        return edge.Oriented(TopAbs_FORWARD if step.forward else TopAbs_REVERSED)

    def _side(self, chart: Chart, geometry: Any, side: Side, seams: dict[tuple[int, int, int], Any], extra: dict[int, Any]) -> Any:
        """Return a stretch of seam, made when it is first passed, or the edge that a pole is."""
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED

        key = (side.axis, *side.nodes)
        made = seams.get(key)
        if made is None:
            ends = [self._corner(chart, side, k, extra) for k in (0, 1)]
            pole = side.axis == 1 and chart.period[1] is None
            made = self._pole(geometry, side, ends) if pole else self._seam(chart, geometry, side, ends)
            if not pole:
                seams[key] = made
        return made.Oriented(TopAbs_FORWARD if side.forward else TopAbs_REVERSED)

    def _corner(self, chart: Chart, side: Side, k: int, extra: dict[int, Any]) -> tuple[Any, Floats]:
        node = side.nodes[k]
        if node >= 0:
            return self.vertices[node], self.points[node]
        at = np.empty((1, 2))
        at[0, side.axis], at[0, 1 - side.axis] = side.value, (side.low, side.top)[k]
        point = chart.point(at)[0]
        if node not in extra:
            extra[node] = self._vertex(point)
        return extra[node], point

    def _seam(self, chart: Chart, geometry: Any, side: Side, ends: list[tuple[Any, Floats]]) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopLoc import TopLoc_Location
        from OCP.TopoDS import TopoDS_Edge

        axis = side.axis
        period = chart.period[axis] or 0.0
        low = side.value - (period if side.high else 0.0)
        lines = [_line_2d(axis, value) for value in (low, low + period)]
        # The kernel wants the curve of the passage along the edge first, then that of the way back.
        there, back = (lines[1], lines[0]) if axis == 0 else (lines[0], lines[1])
        edge = TopoDS_Edge()
        curve = geometry.UIso(low) if axis == 0 else geometry.VIso(low)
        self.build.MakeEdge(edge, curve, self.least)
        self.build.UpdateEdge(edge, there, back, geometry, TopLoc_Location(), self.least)
        for (vertex, point), value, way in zip(ends, (side.low, side.top), (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
            at = np.empty((1, 2))
            at[0, axis], at[0, 1 - axis] = low, value
            self._widen(vertex, point, chart.point(at)[0], self.least)
            self.build.Add(edge, vertex.Oriented(way))
        self.build.Range(edge, side.low, side.top)
        self.build.SameRange(edge, True)
        self.build.SameParameter(edge, True)
        return edge

    def _pole(self, geometry: Any, side: Side, ends: list[tuple[Any, Floats]]) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopLoc import TopLoc_Location
        from OCP.TopoDS import TopoDS_Edge

        edge = TopoDS_Edge()
        self.build.MakeEdge(edge)
        self.build.UpdateEdge(edge, _line_2d(1, side.value), geometry, TopLoc_Location(), self.least)
        self.build.Add(edge, ends[0][0].Oriented(TopAbs_FORWARD))
        self.build.Add(edge, ends[1][0].Oriented(TopAbs_REVERSED))
        self.build.Range(edge, side.low, side.top)
        self.build.Degenerated(edge, True)
        self.build.SameRange(edge, True)
        self.build.SameParameter(edge, True)
        return edge


def _is_plane(chart: Chart) -> bool:
    return getattr(chart, "kind", "") == "plane"


def _line_2d(axis: int, value: float) -> Any:
    """Return the line on which u (0) or v (1) has a value, the other parameter running along it."""
    from OCP.Geom2d import Geom2d_Line
    from OCP.gp import gp_Dir2d, gp_Pnt2d

    point, direction = (value, 0.0), (0.0, 1.0)
    return Geom2d_Line(gp_Pnt2d(*(point if axis == 0 else point[::-1])), gp_Dir2d(*(direction if axis == 0 else direction[::-1])))


@dataclass(frozen=True)
class FlatPiece:
    """A piece in the parameters of a face, over the parameters that it has in the kernel.

    Attributes
    ----------
    poles : (K, 2) float64
    knots : (K + degree + 1,) float64
    degree : int
    gap : float
        Its largest distance from the piece, in space.
    """

    poles: Floats
    knots: Floats
    degree: int
    gap: float

    def geometry(self) -> Any:
        """Return it as a curve of the kernel."""
        from OCP.Geom2d import Geom2d_BSplineCurve

        return Geom2d_BSplineCurve(to_points(self.poles), *to_knots(self.knots), self.degree)


def pcurve(layout: Layout, piece: Piece, scale: float) -> FlatPiece:
    """Return a piece in the parameters of a face.

    A straight line where it is one, else a spline through as many points as its distance in space asks for.
    """
    t = piece.samples()
    uv = _tidy(layout, layout.within(layout.chart.uv(piece.curve(t))))
    share = ((t - t[0]) / (t[-1] - t[0]))[:, None]
    straight = uv[0] + share * (uv[-1] - uv[0])
    size = float(np.abs(piece.curve(t) - piece.curve(t[:1])).max())
    on_line = np.linalg.norm(layout.chart.point(straight) - layout.chart.point(uv), axis=1).max()
    if on_line <= max(_STRAIGHT * size, 0.5 * CONFUSION / scale):
        kernel = np.array([piece.curve.in_kernel(x, scale) for x in (t[0], t[-1])])
        gap = np.linalg.norm(layout.chart.point(straight) - piece.curve(t), axis=1).max()
        return FlatPiece(uv[[0, -1]], np.repeat(kernel, 2), 1, float(gap))
    while True:
        made = make_interp_spline(t, uv, k=3)
        middles = 0.5 * (t[:-1] + t[1:])
        space = piece.curve(middles)
        gap = np.linalg.norm(layout.chart.point(made(middles)) - space, axis=1)
        least = np.linalg.norm(layout.chart.point(layout.chart.uv(space)) - space, axis=1)
        bad = gap > np.maximum(1.1 * least, 0.5 * piece.gap) + max(1e-6 * size, CONFUSION / scale)
        # Halved again and again in one place, spans become too short for the kernel.
        if not bad.any() or len(t) > _MOST or np.diff(t).min() < _SHORTEST * (t[-1] - t[0]):
            break
        t = np.sort(np.concatenate([t, middles[bad]]))
        uv = _tidy(layout, layout.within(layout.chart.uv(piece.curve(t))))
    knots = np.array([piece.curve.in_kernel(float(x), scale) for x in made.t])
    gap = max(float(gap.max()), float(np.linalg.norm(layout.chart.point(uv) - piece.curve(t), axis=1).max()))
    return FlatPiece(np.ascontiguousarray(made.c), knots, 3, gap)


def _tidy(layout: Layout, uv: Floats) -> Floats:
    """Give ends that lie in a pole, where u says nothing, the u of their neighbours."""
    poles = [pole for pole in layout.chart.poles if pole is not None]
    for end, near in ((0, 1), (-1, -2)):
        if any(abs(uv[end, 1] - pole) < 1e-9 * max(1.0, abs(pole)) for pole in poles):
            uv[end, 0] = uv[near, 0]
    return uv


def steps_of(layout: Layout, loop: Sequence[tuple[int, bool]], pieces: Sequence[Piece], known: Known) -> list[Step]:
    """Return the pieces of a loop within the parameter rectangle of a face."""
    steps = []
    for number, forward in loop:
        piece = pieces[number]
        given = ("step", layout, piece.curve, *piece.domain)
        uv = known(given, lambda p=piece: _tidy(layout, layout.within(layout.chart.uv(p.curve(p.samples())))))
        steps.append(Step(number, forward, uv, piece.nodes if forward else (piece.nodes[1], piece.nodes[0])))
    return steps
