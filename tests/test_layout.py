"""Faces laid out in their parameters: on which side of their rings they lie, and where their seam runs."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.charts import chart_of
from scan2nurbs.brep.layout import lay_out
from scan2nurbs.brep.space import SpaceCurve, interpolate
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.torus import Torus

X, Y, Z = np.eye(3)
TURN = 2.0 * np.pi


def border(curve: SpaceCurve, vertices: tuple[int, int] = (0, 0)) -> BorderCurve:
    return BorderCurve(curve, (0, 1), vertices, "crossing", 0.0, 90.0)


def around(angle: float) -> np.ndarray:
    return np.cos(angle) * X + np.sin(angle) * Y


def arc(center: np.ndarray, x: np.ndarray, y: np.ndarray, radius: float, begin: float = 0.0, end: float = TURN) -> SpaceCurve:
    return SpaceCurve("circle", center, x, y, radius, None, (begin, end))


@pytest.mark.parametrize("begin", [0.0, 1.0, 4.0])
@pytest.mark.parametrize("bend", [90.0, 180.0, 270.0, 330.0])
def test_a_bent_pipe_lies_left_of_its_ends_however_far_it_bends(bend, begin):
    chart = chart_of(Torus(center=np.zeros(3), axis=Z, major=25.0, minor=7.0), 1.0)
    end = begin + np.radians(bend)
    rings = [border(arc(25.0 * around(u), around(u), Z, 7.0)) for u in (begin, end)]
    layout = lay_out(chart, [((0, False),), ((1, True),)], rings, [[], []], 0.5)
    assert layout.cut == (False, True)
    inside = layout.chart.uv(25.0 * np.array([around(u) for u in np.linspace(begin, end, 9)]) + 7.0 * Z)[:, 0]
    assert (np.diff(inside) > 0.0).all()


@pytest.mark.parametrize("bend", [90.0, 180.0, 270.0])
def test_a_groove_lies_left_of_its_rims_however_deep_it_is(bend):
    chart = chart_of(Torus(center=np.zeros(3), axis=Z, major=25.0, minor=7.0), 1.0)
    low, high = 0.3, 0.3 + np.radians(bend)
    rings = [border(arc(7.0 * np.sin(v) * Z, X, Y, 25.0 + 7.0 * np.cos(v))) for v in (low, high)]
    # Where v grows, the surface runs to the left of u.
    layout = lay_out(chart, [((0, True),), ((1, False),)], rings, [[], []], 0.5)
    assert layout.cut == (True, False)
    v = np.linspace(low, high, 9)
    points = (25.0 + 7.0 * np.cos(v))[:, None] * X + 7.0 * np.sin(v)[:, None] * Z
    inside = np.array([layout.within(chart.uv(point[None]))[0, 1] for point in points])
    assert (np.diff(inside) > 0.0).all()


@pytest.mark.parametrize("n", [1, 3, 5])
def test_a_seam_does_not_run_along_the_side_of_a_window(n):
    chart = chart_of(Cylinder(point=np.zeros(3), axis=Z, radius=40.0), 1.0)
    loops, borders = [((0, True),), ((1, False),)], [border(arc(z * Z, X, Y, 40.0)) for z in (-10.0, 10.0)]
    for k in range(n):
        a, b = TURN * k / n, TURN * k / n + 0.6
        corners = [4 * k + i for i in range(4)]
        sides = [
            arc(-4.0 * Z, X, Y, 40.0, a, b),
            SpaceCurve("line", 40.0 * around(b), Z, X, 0.0, None, (-4.0, 4.0)),
            arc(4.0 * Z, X, Y, 40.0, a, b),
            SpaceCurve("line", 40.0 * around(a), Z, X, 0.0, None, (-4.0, 4.0)),
        ]
        ends = [(corners[0], corners[1]), (corners[1], corners[2]), (corners[3], corners[2]), (corners[0], corners[3])]
        m = len(borders)
        borders += [border(side, end) for side, end in zip(sides, ends, strict=True)]
        loops.append(((m + 3, True), (m + 2, True), (m + 1, False), (m, False)))  # clockwise: the face is around it
    layout = lay_out(chart, loops, borders, [[] for _ in borders], 0.5)
    assert layout.cut == (True, False)
    for curve in borders[2:]:
        if curve.curve.kind == "line":
            u = layout.chart.uv(curve.curve(np.array([0.0])))[0, 0]
            assert min(u, TURN - u) > 0.02


@pytest.mark.parametrize("place", [0.0, 1.0, 2.5])
def test_a_seam_does_not_touch_the_corner_of_a_hole(place):
    """It touches no border in passing there, but two wires of a face may not touch."""
    chart = chart_of(Cylinder(point=np.zeros(3), axis=Z, radius=40.0), 1.0)
    corners = [40.0 * around(place + u) + z * Z for u, z in ((0.0, 0.0), (0.3, -6.0), (0.6, 0.0), (0.3, 6.0))]
    sides = []
    for k in range(4):
        line = np.linspace(corners[k], corners[(k + 1) % 4], 60)
        out = line[:, :2] * 40.0 / np.linalg.norm(line[:, :2], axis=1)[:, None]
        sides.append(border(interpolate(np.column_stack([out, line[:, 2]]), False), (k, (k + 1) % 4)))
    borders = [border(arc(z * Z, X, Y, 40.0)) for z in (-10.0, 10.0)] + sides
    loops = [((0, True),), ((1, False),), tuple((k, False) for k in (5, 4, 3, 2))]
    layout = lay_out(chart, loops, borders, [[] for _ in borders], 0.5)
    hole = layout.within(layout.chart.uv(np.vstack([side.curve(side.curve.samples(64)) for side in sides])))[:, 0]
    assert hole.min() - layout.window[0] > 0.02
    assert layout.window[0] + TURN - hole.max() > 0.02
