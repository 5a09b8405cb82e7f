"""Tunnels through thin walls, and places where faces touch, are no part of a topology."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.draw import draw
from scan2nurbs.faces.sheet import Sheet
from scan2nurbs.faces.trace import cap_holes, trace
from scan2nurbs.faces.tunnels import without_tunnels
from scan2nurbs.surfaces.plane import Plane
from test_pinholes import assert_paired, plate, without

UP = np.array([0.0, 0.0, 1.0])


def wall(n, holes, thickness=1.0):
    """Two plates with rings through both where there are holes, and its points: those of the upper plate first."""
    whole, flat = plate(n)
    plane = without(whole, flat, holes)
    upper = plane.source[plane.triangles]
    start, end = upper.ravel(), np.roll(upper, -1, axis=1).ravel()
    inside = ((flat[start, :2] > 0) & (flat[start, :2] < n - 1)).all(axis=1)
    u, v = (corner[(plane.twin < 0) & inside] for corner in (start, end))
    ring = np.vstack([np.column_stack([v, u, u + n * n]), np.column_stack([v, u + n * n, v + n * n])])
    triangles = np.vstack([upper, upper[:, ::-1] + n * n, ring]).astype(np.int32)
    at = {pair: k for k, pair in enumerate(zip(triangles.ravel().tolist(), np.roll(triangles, -1, axis=1).ravel().tolist(), strict=True))}
    used, numbered = np.unique(triangles, return_inverse=True)
    twin = np.array([at.get((b, a), -1) for a, b in at], np.int32)
    points = np.vstack([flat, flat - thickness * UP])
    return Sheet(used.astype(np.int32), numbered.reshape(-1, 3).astype(np.int32), twin), points


def complex_of(sheet, points, region):
    """What is traced and drawn of two regions on the planes z = 0 and z = −1."""
    mesh, place = cap_holes(sheet), points[sheet.source]
    shapes = [Plane(np.zeros(3), UP), Plane(-UP, UP)]
    traced = trace(mesh, region)
    return traced, draw(mesh, traced, place, region, shapes, 1.0), shapes


def sides_of(sheet, points):
    return (points[sheet.source][:, 2] < -0.5).astype(np.int32)


@pytest.mark.parametrize("radius", [0.3, 0.6, 1.2, 2.0])
def test_tunnels_through_a_wall_are_taken_out(radius):
    sheet, points = wall(14, [((3.3, 3.6), radius), ((9.4, 9.3), radius)])
    assert_paired(sheet)
    traced, drawn, shapes = complex_of(sheet, points, sides_of(sheet, points))
    assert [len(loops) for loops in traced.loops] == [3, 3]
    after, places = without_tunnels(traced, drawn, shapes, np.array([1, -1], np.int8), 1.0, 12.5)
    assert [len(loops) for loops in after.loops] == [1, 1]
    assert len(after.borders) == len(after.sides) == len(places.lines) == 2
    assert set(after.sides[:, 1].tolist()) == {-1}
    # What is left is the rim of either plate.
    assert [len(line) > 30 for line in places.lines] == [True, True]
    assert sorted({b for loops in after.loops for loop in loops for b, _ in loop}) == [0, 1]


@pytest.mark.parametrize(("outward", "longest"), [((1, -1), 6.0), ((1, 1), 12.5)])
def test_wide_ones_and_those_between_faces_that_look_the_same_way_stay(outward, longest):
    sheet, points = wall(14, [((5.3, 5.6), 1.5)])
    traced, drawn, shapes = complex_of(sheet, points, sides_of(sheet, points))
    after, _ = without_tunnels(traced, drawn, shapes, np.array(outward, np.int8), 1.0, longest)
    assert [len(loops) for loops in after.loops] == [2, 2]
    np.testing.assert_array_equal(after.sides, traced.sides)


def test_a_border_about_a_point_is_none():
    sheet, points = wall(14, [((5.3, 5.6), 1.5)])
    traced, drawn, shapes = complex_of(sheet, points, sides_of(sheet, points))
    both = np.array([1, 1], np.int8)
    for h, left in ((1.0, 2), (20.0, 1)):
        after, _ = without_tunnels(traced, drawn, shapes, both, h, 12.5 * h)
        assert [len(loops) for loops in after.loops] == [left, left]


def test_the_only_border_of_a_face_stays():
    sheet, points = plate(14)
    region = (np.linalg.norm(points[:, :2] - 6.2, axis=1) < 1.5).astype(np.int32)
    traced, drawn, shapes = complex_of(sheet, points, region)
    assert [len(loops) for loops in traced.loops] == [2, 1]
    after, _ = without_tunnels(traced, drawn, shapes, np.array([1, -1], np.int8), 100.0, 1000.0)
    assert [len(loops) for loops in after.loops] == [2, 1]
