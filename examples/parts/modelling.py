"""Ways to make the example parts: freeform surfaces, outlines, walls with a draft, raised and engraved areas."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakePrism
from OCP.collections import Array2_gp_Pnt, HArray1_gp_Pnt
from OCP.GeomAPI import GeomAPI_Interpolate, GeomAPI_PointsToBSplineSurface
from OCP.gp import gp_Pnt, gp_Vec
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

Height = Callable[[Any, Any], Any]
"""z at (x, y)."""


def surface(points: np.ndarray) -> Any:
    """Interpolate an (n, m, 3) grid by a bicubic B-spline surface."""
    n, m = points.shape[:2]
    grid = Array2_gp_Pnt(1, n, 1, m)
    for i in range(n):
        for j in range(m):
            grid.SetValue(i + 1, j + 1, gp_Pnt(*map(float, points[i, j])))
    job = GeomAPI_PointsToBSplineSurface()
    job.Interpolate(grid)
    return job.Surface()


def height_surface(height: Height, x: tuple[float, float], y: tuple[float, float], n: int = 24, *, raised: float = 0.0) -> Any:
    """Interpolate a height field over a rectangle."""
    gx, gy = np.meshgrid(np.linspace(*x, n), np.linspace(*y, n), indexing="ij")
    return surface(np.stack([gx, gy, height(gx, gy) + raised], axis=2))


def below(face_surface: Any, depth: float) -> Any:
    """Make the solid that hangs `depth` below a surface."""
    face = BRepBuilderAPI_MakeFace(face_surface, 1e-6).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, -depth)).Shape()


def wire(outline: np.ndarray, z: float, *, smooth: bool) -> Any:
    """Make a closed wire at height z: a polygon, or a periodic cubic through the points."""
    if not smooth:
        polygon = BRepBuilderAPI_MakePolygon()
        for x, y in outline:
            polygon.Add(gp_Pnt(float(x), float(y), z))
        polygon.Close()
        return polygon.Wire()
    points = HArray1_gp_Pnt(1, len(outline))
    for i, (x, y) in enumerate(outline):
        points.SetValue(i + 1, gp_Pnt(float(x), float(y), z))
    curve = GeomAPI_Interpolate(points, True, 1e-7)
    curve.Perform()
    return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve.Curve()).Edge()).Wire()


def walls(outline: np.ndarray, low: float, high: float, *, smooth: bool, draft: float = 0.0) -> Any:
    """Make the solid between two heights whose walls lean inwards by `draft` degrees; `outline` is that at the top."""
    grown = grow(outline, (high - low) * np.tan(np.radians(draft)))
    job = BRepOffsetAPI_ThruSections(True, True, 1e-6)
    job.AddWire(wire(grown, low, smooth=smooth))
    job.AddWire(wire(outline, high, smooth=smooth))
    job.CheckCompatibility(False)
    job.Build()
    return job.Shape()


def grow(outline: np.ndarray, distance: float) -> np.ndarray:
    """Move the sides of a counter-clockwise polygon outwards by a distance, with mitred corners."""
    before = outline - np.roll(outline, 1, axis=0)
    after = np.roll(outline, -1, axis=0) - outline
    n0, n1 = (np.column_stack([s[:, 1], -s[:, 0]]) / np.linalg.norm(s, axis=1, keepdims=True) for s in (before, after))
    return outline + distance * (n0 + n1) / (1 + (n0 * n1).sum(axis=1, keepdims=True))


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Any:
    return BRepPrimAPI_MakeBox(gp_Pnt(x[0], y[0], z[0]), gp_Pnt(x[1], y[1], z[1])).Shape()


def fuse(*shapes: Any) -> Any:
    result = shapes[0]
    for other in shapes[1:]:
        result = BRepAlgoAPI_Fuse(result, other).Shape()
    return _tidy(result)


def cut(shape: Any, tools: Iterable[Any]) -> Any:
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return _tidy(shape)


def common(a: Any, b: Any) -> Any:
    return _tidy(BRepAlgoAPI_Common(a, b).Shape())


def _tidy(shape: Any) -> Any:
    """Merge the pieces into which set operations split one face."""
    job = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    job.Build()
    return job.Shape()


# Outlines, counter-clockwise.


def ellipse(a: float, b: float, n: int = 32, *, centre: tuple[float, float] = (0.0, 0.0), power: float = 2.0) -> np.ndarray:
    """Make a superellipse; power 2 is an ellipse, 4 nearly a rectangle with round corners."""
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    c, s = np.cos(t), np.sin(t)
    r = (np.abs(c) ** power + np.abs(s) ** power) ** (-1 / power)
    return np.column_stack([centre[0] + a * r * c, centre[1] + b * r * s])


def star(outer: float, inner: float, points: int = 5) -> np.ndarray:
    t = np.arange(2 * points) * np.pi / points + np.pi / 2
    r = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
    return np.column_stack([r * np.cos(t), r * np.sin(t)])
