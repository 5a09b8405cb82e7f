"""The demonstration part, and stand-ins for the scans of the paper's figures, of the same kind and size."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

from scan2nurbs.brep.cad import tessellate

from . import modelling as m
from .part import FROM_ABOVE, Part

# The demonstration: a die whose curved top has a hole and a notch in its outline, on a shoulder, on a plate.


def _die_top(x: Any, y: Any) -> Any:
    return 30 + 7 * np.sin(x / 17 + 0.4) + 5 * np.cos(y / 12) - x**2 / 260


def demo() -> Any:
    outline = m.ellipse(40, 29, 40, power=4.0)
    top = m.below(m.height_surface(_die_top, (-70, 70), (-60, 60), 32), 200.0)
    die = m.common(m.walls(outline, 8.0, 48.0, smooth=True, draft=4.0), top)
    notch = m.walls(m.ellipse(9, 13, 24, centre=(12, 31)), 10.0, 60.0, smooth=True, draft=-4.0)
    die = m.cut(die, [notch, _drill(-16, -4, 7.0, 16.0, 60.0)])
    shoulder = m.walls(m.ellipse(52, 41, 40, power=4.0), -1.0, 14.0, smooth=True, draft=4.0)
    return m.fuse(die, shoulder, m.box((-66, 66), (-54, 54), (-8.0, 0.0)))


def _drill(x: float, y: float, radius: float, low: float, high: float) -> Any:
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), radius, high - low).Shape()


# Figure 6: a shallow surface; the functional area is raised by a smooth step.

_STEP = 2.4


def _shallow(x: Any, y: Any) -> Any:
    return 12 - x**2 / 420 - y**2 / 300 + 0.5 * np.sin(x / 23 + y / 31)


def shallow_step() -> Any:
    x, y = (-75.0, 75.0), (-60.0, 60.0)
    outline = m.ellipse(48, 34, 40, power=3.0)
    outline[:, 1] += 6 * np.cos(outline[:, 0] / 22)
    ground = m.below(m.height_surface(_shallow, x, y), 60.0)
    raised = m.below(m.height_surface(_shallow, x, y, raised=_STEP), 60.0)
    raised = m.common(m.walls(outline, 0.0, 18.0, smooth=True, draft=30.0), raised)
    solid = m.fuse(m.common(ground, m.box((-70, 70), (-55, 55), (-20.0, 90.0))), raised)
    return _rounded_step(solid, 2.0)


def _rounded_step(solid: Any, radius: float) -> Any:
    """Round both edges of the wall of the step."""
    part = tessellate(solid)
    face_at = ShapeMap()
    TopExp.MapShapes_s(solid, TopAbs_FACE, face_at)
    top = part.nearest_face((0.0, 0.0, float(_shallow(0.0, 0.0)) + _STEP))
    outer = part.nearest_face((66.0, 52.0, float(_shallow(66.0, 52.0))))
    inner = {i: _edges(face_at.FindKey(i + 1)) for i in range(len(part.faces))}
    wall = [i for i in inner if i not in (top, outer) and _shares(inner[i], inner[top])]
    job = BRepFilletAPI_MakeFillet(solid)
    done: list[Any] = []
    for i in wall:
        for edge in inner[i]:
            known = any(edge.IsSame(o) for o in done)
            if not known and (_shares([edge], inner[top]) or _shares([edge], inner[outer])):
                job.Add(radius, TopoDS.Edge(edge))
                done.append(edge)
    job.Build()
    return job.Shape()


def _edges(face: Any) -> list[Any]:
    found = ShapeMap()
    TopExp.MapShapes_s(face, TopAbs_EDGE, found)
    return [found.FindKey(i + 1) for i in range(found.Extent())]


def _shares(some: list[Any], others: list[Any]) -> bool:
    return any(a.IsSame(b) for a in some for b in others)


# Figures 1 and 10: one functional surface of high curvature between flanks, scanned with noise and missing patches.


def _insert_top(x: Any, y: Any) -> Any:
    ridge = 13 * np.exp(-(((y - 0.12 * x) / 14) ** 2))
    return 24 + ridge - 8 * np.exp(-((x / 15) ** 2)) + x**2 / 190 - y**2 / 150


def insert() -> Any:
    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    egg = np.column_stack([44 * np.cos(t), (27 + 5 * np.cos(t)) * np.sin(t)])
    top = m.below(m.height_surface(_insert_top, (-75, 75), (-60, 60), 40), 200.0)
    block = m.common(m.walls(egg, -2.0, 50.0, smooth=True, draft=12.0), top)
    return m.fuse(block, m.box((-70, 70), (-56, 56), (-6.0, 0.0)))


# Figure 11: a large curved body with many details.


def _body_top(x: Any, y: Any) -> Any:
    return 46 - x**2 / 330 - y**2 / 170 + 2.5 * np.sin(x / 26) * np.cos(y / 21)


_STROKES = {
    "S": ((4, 6), (3, 7), (1, 7), (0, 6), (0, 4.6), (1, 3.8), (3, 3.2), (4, 2.4), (4, 1), (3, 0), (1, 0), (0, 1)),
    "2": ((0, 6), (1, 7), (3, 7), (4, 6), (4, 4.5), (0, 0), (4, 0)),
    "N": ((0, 0), (0, 7), (4, 0), (4, 7)),
}
"""Polylines of letters, 4 wide and 7 high."""


def _stroke(points: np.ndarray, width: float) -> list[Any]:
    """Make a bar of rectangular section along each piece of a polyline, tall enough to cross the body."""
    bars = []
    for a, b in itertools.pairwise(points):
        along = (b - a) / np.linalg.norm(b - a) * width / 2
        across = np.array([-along[1], along[0]])
        corners = np.array([a - along - across, b + along - across, b + along + across, a - along + across])
        bars.append(m.walls(corners, 0.0, 90.0, smooth=False))
    return bars


def complex_body() -> Any:
    x, y = (-125.0, 125.0), (-95.0, 95.0)
    field = lambda raised: m.below(m.height_surface(_body_top, x, y, 32, raised=raised), 200.0)  # noqa: E731
    top, lowered, raised = field(0.0), field(-1.6), field(4.0)
    outline = m.ellipse(95, 66, 48, power=3.2)
    body = m.common(m.walls(outline, -2.0, 60.0, smooth=True, draft=6.0), top)
    ribs = [m.walls(_bar(cx, 0, 4.0, 70.0, turn), 5.0, 60.0, smooth=False, draft=2.0) for cx, turn in ((-70, 0.1), (-58, 0.1), (-46, 0.1))]
    body = m.fuse(body, *[m.common(rib, raised) for rib in ribs])
    pockets = [m.walls(m.ellipse(15, 11, 24, centre=(8 + 32 * i, -26), power=4.0), 24.0, 70.0, smooth=True, draft=-5.0) for i in range(3)]
    bores = [_drill(8 + 16 * i, 40 - abs(i - 2), 3.0 + 0.6 * i, 10.0, 70.0) for i in range(5)]
    body = m.cut(body, pockets + bores)
    engraved = [m.cut(bar, [lowered]) for bar in _letters()]
    body = m.cut(body, engraved)
    knobs = [m.walls(m.ellipse(5, 5, 20, centre=(-88 + 6 * i, -40 - 3 * i)), 5.0, 40.0 - 3 * i, smooth=True, draft=5.0) for i in (0, 3)]
    steps = [m.walls(m.ellipse(112 - 6 * i, 82 - 6 * i, 48, power=3.2), -3.0, 5.0 + 5 * i, smooth=True, draft=3.0) for i in range(2)]
    return m.fuse(body, *knobs, *steps, m.box((-122, 122), (-92, 92), (-8.0, 0.0)))


def _bar(cx: float, cy: float, width: float, length: float, turn: float) -> np.ndarray:
    corners = np.array([(-width, -length), (width, -length), (width, length), (-width, length)]) / 2
    c, s = np.cos(turn), np.sin(turn)
    return corners @ np.array([[c, s], [-s, c]]) + (cx, cy)


def _letters() -> list[Any]:
    bars = []
    for place, letter in enumerate("S2N"):
        points = np.array(_STROKES[letter]) * 2.4 + (2 + 19 * place, -1)
        bars += _stroke(points, 2.4)
    return bars


def _on(height: m.Height, x: float, y: float, raised: float = 0.0) -> tuple[float, float, float]:
    return (x, y, float(height(np.float64(x), np.float64(y))) + raised)


FIGURES = (
    Part(
        "demo", "A die: a curved top with a hole and a notch, walls all around, a shoulder and a plate.", demo, _on(_die_top, 5, -8), 60_000
    ),
    Part(
        "shallow_step",
        "After Fig. 6: a shallow surface whose functional area is raised by a step with rounded edges.",
        shallow_step,
        _on(_shallow, 0, 0, _STEP),
        26_975,
        {"views": 5, "spread": 35.0, "noise": 0.1},
    ),
    Part(
        "insert",
        "After Figs. 1 and 10: one functional surface of high curvature between flanks, with noise and missing patches.",
        insert,
        _on(_insert_top, 25, 12),
        45_000,
        {**FROM_ABOVE, "noise": 0.25, "holes": 6, "hole_radius": 5.0},
    ),
    Part(
        "complex_body",
        "After Fig. 11: a large curved body with ribs, pockets, bores, steps and engraved letters.",
        complex_body,
        _on(_body_top, -20, 0),
        1_678_267,
        {**FROM_ABOVE, "noise": 0.25},
    ),
)
