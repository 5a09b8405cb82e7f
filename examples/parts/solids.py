"""Solids, sweeps and blends that the whole parts are made of; with `modelling`, all the CAD operations of the examples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Transform,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet
from OCP.BRepOffsetAPI import BRepOffsetAPI_MakePipe, BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.collections import HArray1_gp_Pnt, IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

Point = Sequence[float]
Chosen = Callable[[np.ndarray], bool]
"""Tells by its points (K, 3), from one end to the other, whether an edge is meant."""

Z = (0.0, 0.0, 1.0)


def axes(at: Point, along: Point) -> Any:
    return gp_Ax2(gp_Pnt(*map(float, at)), gp_Dir(*map(float, along)))


def cylinder(at: Point, radius: float, height: float, along: Point = Z) -> Any:
    return BRepPrimAPI_MakeCylinder(axes(at, along), radius, height).Shape()


def cone(at: Point, radius: float, top: float, height: float, along: Point = Z) -> Any:
    return BRepPrimAPI_MakeCone(axes(at, along), radius, top, height).Shape()


def sphere(at: Point, radius: float) -> Any:
    return BRepPrimAPI_MakeSphere(gp_Pnt(*map(float, at)), radius).Shape()


def torus(at: Point, radius: float, tube: float, along: Point = Z) -> Any:
    return BRepPrimAPI_MakeTorus(axes(at, along), radius, tube).Shape()


def polygon(points: Any) -> Any:
    """Make a closed wire through points (N, 3)."""
    job = BRepBuilderAPI_MakePolygon()
    for p in points:
        job.Add(gp_Pnt(*map(float, p)))
    job.Close()
    return job.Wire()


def spline(points: Any, *, closed: bool = False) -> Any:
    """Make an edge, a cubic through points (N, 3)."""
    held = HArray1_gp_Pnt(1, len(points))
    for i, p in enumerate(points):
        held.SetValue(i + 1, gp_Pnt(*map(float, p)))
    job = GeomAPI_Interpolate(held, closed, 1e-7)
    job.Perform()
    return BRepBuilderAPI_MakeEdge(job.Curve()).Edge()


def line(a: Point, b: Point) -> Any:
    return BRepBuilderAPI_MakeEdge(gp_Pnt(*map(float, a)), gp_Pnt(*map(float, b))).Edge()


def wire(*edges: Any) -> Any:
    job = BRepBuilderAPI_MakeWire()
    for edge in edges:
        job.Add(edge)
    return job.Wire()


def face(outline: Any) -> Any:
    return BRepBuilderAPI_MakeFace(outline).Face()


def extrude(outline: Any, along: Point) -> Any:
    """Make the solid that a closed, flat wire sweeps along a vector."""
    return BRepPrimAPI_MakePrism(face(outline), gp_Vec(*map(float, along))).Shape()


def prism(profile: Any, low: float, high: float) -> Any:
    """Extrude a polygon (N, 2) of the xy plane between two heights."""
    return extrude(polygon([(x, y, low) for x, y in profile]), (0, 0, high - low))


def revolve(outline: Any, at: Point = (0, 0, 0), along: Point = Z, turn: float = 2 * np.pi) -> Any:
    """Make the solid that a closed, flat wire sweeps around an axis."""
    return BRepPrimAPI_MakeRevol(face(outline), gp_Ax1(gp_Pnt(*map(float, at)), gp_Dir(*map(float, along))), turn).Shape()


def turned(profile: Any) -> Any:
    """Turn a polygon of (radius, z) around the z axis."""
    return revolve(polygon([(r, 0, z) for r, z in profile]))


def sweep(outline: Any, path: Any) -> Any:
    """Make the solid that a flat closed wire sweeps along a wire."""
    return BRepOffsetAPI_MakePipe(path, face(outline)).Shape()


def loft(wires: Iterable[Any], *, ruled: bool = False, solid: bool = True) -> Any:
    job = BRepOffsetAPI_ThruSections(solid, ruled, 1e-6)
    for section in wires:
        job.AddWire(section)
    job.CheckCompatibility(False)
    job.Build()
    return job.Shape()


def moved(shape: Any, by: Point = (0, 0, 0), *, turn: float = 0.0, along: Point = Z) -> Any:
    """Turn a shape around an axis through the origin, by degrees, then shift it."""
    rotation, shift = gp_Trsf(), gp_Trsf()
    rotation.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*map(float, along))), np.radians(turn))
    shift.SetTranslation(gp_Vec(*map(float, by)))
    return BRepBuilderAPI_Transform(shape, shift.Multiplied(rotation), True).Shape()


def around(shape: Any, count: int, first: float = 0.0) -> list[Any]:
    """Repeat a shape around the z axis."""
    return [moved(shape, turn=first + 360 * k / count) for k in range(count)]


def edges(shape: Any, chosen: Chosen | None = None) -> list[Any]:
    """Return the edges whose points are accepted; all without a test."""
    found = IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher()
    TopExp.MapShapes_s(shape, TopAbs_EDGE, found)
    every = [TopoDS.Edge(found.FindKey(i + 1)) for i in range(found.Extent())]
    return [edge for edge in every if chosen is None or chosen(_points(edge))]


def _points(edge: Any) -> np.ndarray:
    curve = BRepAdaptor_Curve(edge)
    along = np.linspace(curve.FirstParameter(), curve.LastParameter(), 9)
    return np.array([(p.X(), p.Y(), p.Z()) for p in map(curve.Value, map(float, along))])


def fillet(shape: Any, radius: float, chosen: Chosen | None = None) -> Any:
    job = BRepFilletAPI_MakeFillet(shape)
    for edge in edges(shape, chosen):
        job.Add(radius, edge)
    job.Build()
    return job.Shape()


def chamfer(shape: Any, width: float, chosen: Chosen | None = None) -> Any:
    job = BRepFilletAPI_MakeChamfer(shape)
    for edge in edges(shape, chosen):
        job.Add(width, edge)
    job.Build()
    return job.Shape()


def at(axis: int, value: float) -> Chosen:
    """Choose the edges that lie in a plane across a coordinate axis."""
    return lambda p: bool(np.abs(p[:, axis] - value).max() < 1e-3)


def upright(p: np.ndarray) -> bool:
    """Choose the edges that run along z."""
    return bool(np.ptp(p[:, 2]) > 1e-3 and np.ptp(p[:, :2], axis=0).max() < 1e-3)


def face_of(surface: Any) -> Any:
    """Make the face that a whole surface is."""
    return BRepBuilderAPI_MakeFace(surface, 1e-6).Face()
