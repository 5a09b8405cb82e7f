"""From surface and edges to a face of the CAD kernel."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.curve import Curve
from scan2nurbs.brep.edges import FaceEdge
from scan2nurbs.brep.occ import CONFUSION, kernel_errors, silence, to_knots, to_points, to_surface
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_SAME_VERTEX = 1e-6


def build_face(
    surface: BSplineSurface,
    wires: Sequence[Sequence[FaceEdge]],
    *,
    scale: float = 1.0,
    offset: Floats | None = None,
) -> Any:
    """Return a ``TopoDS_Face``: the surface times `scale` plus `offset`, trimmed by the wires.

    Parameters
    ----------
    surface : BSplineSurface
        What lies under the face.
    wires : sequence of sequences of FaceEdge
        The outer wire first; every edge ends where the next begins.
    scale : float
        Factor of all lengths.
    offset : (3,) float64, optional
        Added to all points after scaling: control points are moved, not a placement.

    Raises
    ------
    KernelError
        If the kernel refuses a curve or the surface.
    """
    silence()
    builder = _Builder(surface, scale, np.zeros(3) if offset is None else np.asarray(offset, np.float64))
    with kernel_errors("build the face"):
        return builder.face(wires)


def natural_face(surface: BSplineSurface, *, scale: float = 1.0, offset: Floats | None = None) -> Any:
    """Return the whole surface as the kernel's own ``TopoDS_Face``."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace

    silence()
    with kernel_errors("make a face of the whole surface"):
        return BRepBuilderAPI_MakeFace(to_surface(surface, scale=scale, offset=offset), CONFUSION).Face()


class _Builder:
    """One face in the making: its surface, and the vertices and seams that its edges share."""

    def __init__(self, surface: BSplineSurface, scale: float, offset: Floats) -> None:
        self.surface, self.scale, self.offset = surface, scale, offset
        self.geometry = to_surface(surface, scale=scale, offset=offset)
        points = surface.control_points.reshape(-1, 3) * scale
        self.extent = float(np.linalg.norm(np.ptp(points, axis=0)))
        # Coordinates far from zero are rounded; no two evaluations agree better than that.
        rounding = 16.0 * np.finfo(float).eps * float(np.abs(points + offset).max())
        self.least = max(CONFUSION, rounding)
        self.seams: dict[tuple[int, float, float], Any] = {}

    def face(self, wires: Sequence[Sequence[FaceEdge]]) -> Any:
        from OCP.BRep import BRep_Builder
        from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

        build, face = BRep_Builder(), TopoDS_Face()
        build.MakeFace(face, self.geometry, self.least)
        vertices = self._vertices([edge for edges in wires for edge in edges])
        for edges in wires:
            wire = TopoDS_Wire()
            build.MakeWire(wire)
            for edge in edges:
                build.Add(wire, self._edge(build, face, edge, vertices))
            wire.Closed(True)
            build.Add(face, wire)
        return face

    def _vertices(self, edges: list[FaceEdge]) -> Any:
        """Return a function from an edge to its first and last vertex; ends that meet in space share one."""
        from OCP.BRep import BRep_Builder
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        ends = np.array([edge.pcurve.control_points[k] for edge in edges for k in (0, -1)])
        places = self._in_kernel(self.surface.evaluate(ends))
        tree = KDTree(places)
        first = [min(found) for found in tree.query_ball_point(places, max(_SAME_VERTEX * self.extent, 2.0 * self.least))]
        made: dict[int, Any] = {}
        build = BRep_Builder()
        for k, owner in enumerate(first):
            edge = edges[k // 2]
            apart = np.linalg.norm(places[k] - places[owner])
            if edge.space is not None:
                apart += np.linalg.norm(self._in_kernel(edge.space.control_points[-(k % 2)]) - places[k])
            tolerance = max(1.5 * float(apart), 1.1 * self._tolerance(edge))
            if owner not in made:
                made[owner] = TopoDS_Vertex()
                build.MakeVertex(made[owner], gp_Pnt(*places[owner].tolist()), tolerance)
            else:
                build.UpdateVertex(made[owner], tolerance)
        owners = {id(edge): (made[first[2 * k]], made[first[2 * k + 1]]) for k, edge in enumerate(edges)}
        return lambda edge: owners[id(edge)]

    def _edge(self, build: Any, face: Any, edge: FaceEdge, vertices: Any) -> Any:
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopoDS import TopoDS_Edge

        low, high = edge.pcurve.domain
        key = (edge.side[0] if edge.side else -1, low, high)
        made = self.seams.get(key) if edge.seam else None
        if made is None:
            made = TopoDS_Edge()
            first, last = vertices(edge)
            curve = self._space_curve(edge)
            tolerance = self._tolerance(edge)
            if curve is None:
                build.MakeEdge(made)
            else:
                build.MakeEdge(made, curve, tolerance)
            if edge.seam is None:
                build.UpdateEdge(made, _curve_2d(edge.pcurve), face, tolerance)
            else:
                # The kernel wants the curve of the passage along the edge first, then that of the way back.
                there, back = (edge.pcurve, edge.seam) if edge.forward else (edge.seam, edge.pcurve)
                build.UpdateEdge(made, _curve_2d(there), _curve_2d(back), face, tolerance)
                self.seams[key] = made
            build.Add(made, first.Oriented(TopAbs_FORWARD))
            build.Add(made, last.Oriented(TopAbs_REVERSED))
            build.Range(made, low, high)
            build.Degenerated(made, curve is None)
            build.SameRange(made, True)
            build.SameParameter(made, True)
        return made.Oriented(TopAbs_FORWARD if edge.forward else TopAbs_REVERSED)

    def _space_curve(self, edge: FaceEdge) -> Any:
        """Return the edge's curve in space; None where a side of the surface has shrunk to a point."""
        if edge.side is None and edge.space is not None:
            return _curve_3d(edge.space, self._in_kernel(edge.space.control_points))
        axis, end = edge.side or (0, 0)
        row = np.moveaxis(self.surface.control_points, axis, 0)[-end] * self.scale
        if np.ptp(row, axis=0).max() <= self.least:
            return None
        value = self.surface.domain[axis][end]
        return self.geometry.UIso(value) if axis == 0 else self.geometry.VIso(value)

    def _tolerance(self, edge: FaceEdge) -> float:
        return max(self.least, 1.5 * edge.gap * self.scale)

    def _in_kernel(self, points: Floats) -> Floats:
        return points * self.scale + self.offset


def _curve_2d(curve: Curve) -> Any:
    from OCP.Geom2d import Geom2d_BSplineCurve

    return Geom2d_BSplineCurve(to_points(curve.control_points), *to_knots(curve.knots), curve.degree)


def _curve_3d(curve: Curve, control_points: Floats) -> Any:
    from OCP.Geom import Geom_BSplineCurve

    return Geom_BSplineCurve(to_points(control_points), *to_knots(curve.knots), curve.degree)
