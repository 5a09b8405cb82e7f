"""A face within given edges: a disc's image, whose edges have the curves of these."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from scan2nurbs.brep.occ import CONFUSION, kernel_errors, to_knots, to_points, to_surface
from scan2nurbs.faces.complex import length_of
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_FINE = 0.5
"""Distance of points along edges, in h."""
_COARSE = 17
_SAMPLES = (16, 400)
_MARGIN = 1.25
"""Tolerances over the gaps that were seen: between the places that were looked at these may be wider."""


def along(edge: Any) -> Floats:
    """Return points (K, 3) along an edge."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve

    with kernel_errors("follow an edge"):
        curve = BRepAdaptor_Curve(edge)
        return _at(curve, np.linspace(curve.FirstParameter(), curve.LastParameter(), _COARSE))


@dataclass(frozen=True)
class Side:
    """An edge along a loop: its parameters (K,) and the points (K, 3) there, in the kernel's lengths, from where the loop begins."""

    edge: Any
    forward: bool
    t: Floats
    points: Floats

    def turned(self) -> Side:
        """Return the edge along the loop the other way round."""
        return Side(self.edge, not self.forward, self.t[::-1], self.points[::-1])


def follow(edge: Any, step: float) -> Side:
    """Return an edge along its loop, with points about half a step apart."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_REVERSED

    with kernel_errors("follow an edge"):
        curve = BRepAdaptor_Curve(edge)
        ends = curve.FirstParameter(), curve.LastParameter()
        t = np.linspace(*ends, int(np.clip(length_of(along(edge)) / (_FINE * step), *_SAMPLES)) + 1)
        side = Side(edge, True, t, _at(curve, t))
    return side.turned() if edge.Orientation() == TopAbs_REVERSED else side


def _at(curve: Any, t: Floats) -> Floats:
    points = (curve.Value(x) for x in t.tolist())
    return np.array([(p.X(), p.Y(), p.Z()) for p in points])


def loop_length(loop: Sequence[Side]) -> float:
    """Return the length of a loop of edges."""
    return sum(length_of(side.points) for side in loop)


def disc_face(surface: BSplineSurface, loops: Sequence[Sequence[Side]], parameters: Sequence[Floats], scale: float) -> Any:
    """Return the face of a disc's image within edges that have the curves of the given ones.

    Parameters
    ----------
    surface : BSplineSurface
    loops : sequence of sequence of Side
        The outer one first.
    parameters : sequence of (K, 2) float64
        Of the surface at the points of each loop, without those that end an edge.
    scale : float
        Kernel lengths over the surface's.
    """
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Face

    build, geometry, face = BRep_Builder(), to_surface(surface, scale=scale), TopoDS_Face()
    with kernel_errors("span a face"):
        build.MakeFace(face, geometry, CONFUSION)
        for k, (loop, uv) in enumerate(zip(loops, parameters, strict=True)):
            area = float(np.sum(uv[:, 0] * np.roll(uv[:, 1], -1) - uv[:, 1] * np.roll(uv[:, 0], -1)))
            closed = np.vstack([uv, uv[:1]])
            if (area > 0.0) == (k == 0):
                build.Add(face, _wire(surface, geometry, loop, closed, scale))
            else:  # the face lies on the left of its outer loop and of its holes
                build.Add(face, _wire(surface, geometry, [side.turned() for side in reversed(loop)], closed[::-1], scale))
    return face


def _wire(surface: BSplineSurface, geometry: Any, loop: Sequence[Side], uv: Floats, scale: float) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS_Vertex, TopoDS_Wire

    build, wire, corners = BRep_Builder(), TopoDS_Wire(), list[Any]()
    build.MakeWire(wire)
    for side in loop:
        vertex = TopoDS_Vertex()
        build.MakeVertex(vertex, gp_Pnt(*side.points[0].tolist()), CONFUSION)
        corners.append(vertex)
    corners.append(corners[0])
    start = 0
    for k, side in enumerate(loop):
        end = start + len(side.t) - 1
        own = uv[start : end + 1]
        gap = float(np.linalg.norm(scale * surface.evaluate(own) - side.points, axis=1).max())
        build.Add(wire, _edge(side, own, max(CONFUSION, _MARGIN * gap), geometry, corners[k : k + 2]))
        start = end
    wire.Closed(True)
    return wire


def _edge(side: Side, uv: Floats, most: float, geometry: Any, corners: Sequence[Any]) -> Any:
    """Return an edge with the curve of a given one, and a curve on a surface through parameters (K, 2) of that."""
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS_Edge

    forward, uv, corners = (side, uv, corners) if side.forward else (side.turned(), uv[::-1], corners[::-1])
    spline = make_interp_spline(forward.t, uv, k=3)
    on_surface = Geom2d_BSplineCurve(to_points(np.ascontiguousarray(spline.c)), *to_knots(spline.t), 3)
    edge, build = TopoDS_Edge(), BRep_Builder()
    build.MakeEdge(edge, BRep_Tool.Curve_s(side.edge, 0.0, 0.0), most)
    for corner, end, way in zip(corners, forward.points[[0, -1]].tolist(), (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
        build.UpdateVertex(corner, 1.01 * most + BRep_Tool.Pnt_s(corner).Distance(gp_Pnt(*end)))
        build.Add(edge, corner.Oriented(way))
    build.UpdateEdge(edge, on_surface, geometry, TopLoc_Location(), most)
    build.Range(edge, float(forward.t[0]), float(forward.t[-1]))
    build.SameRange(edge, True)
    build.SameParameter(edge, True)
    return edge.Oriented(TopAbs_FORWARD if side.forward else TopAbs_REVERSED)
