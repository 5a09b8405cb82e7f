"""Small holes of a surface are closed, large ones stay."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.pinholes import _corner, close_pinholes
from scan2nurbs.faces.sheet import Sheet, drop_triangles, triangle_areas


def plate(n):
    """A square of (n − 1)² cells, two triangles each, on a grid of unit steps, and its points."""
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)]).astype(np.float64)
    corner = (x[:-1, :-1] * n + y[:-1, :-1]).ravel()
    a, b, c, d = corner, corner + n, corner + n + 1, corner + 1
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    at = {(int(u), int(v)): h for h, (u, v) in enumerate(zip(start, end, strict=True))}
    twin = np.array([at.get((int(v), int(u)), -1) for u, v in zip(start, end, strict=True)], np.int32)
    return Sheet(np.arange(n * n, dtype=np.int32), triangles, twin), points


def without(sheet, points, holes):
    """The sheet without the triangles whose centres lie within a radius of one of some places."""
    centre = points[sheet.source[sheet.triangles]].mean(axis=1)[:, :2]
    keep = np.ones(len(centre), bool)
    for place, radius in holes:
        keep &= np.linalg.norm(centre - place, axis=1) > radius
    return drop_triangles(sheet, keep)


def assert_paired(sheet):
    """Every half-edge runs against its twin, between the same vertices, and is its twin's twin."""
    start, end = sheet.triangles.ravel(), np.roll(sheet.triangles, -1, axis=1).ravel()
    inner = np.flatnonzero(sheet.twin >= 0)
    other = sheet.twin[inner]
    np.testing.assert_array_equal(sheet.twin[other], inner)
    np.testing.assert_array_equal(start[other], end[inner])
    np.testing.assert_array_equal(end[other], start[inner])


@pytest.mark.parametrize("radius", [0.3, 0.6, 1.2, 1.6])
def test_a_small_hole_is_spanned_and_a_long_border_is_left(radius):
    whole, points = plate(12)
    holed = without(whole, points, [((5.3, 5.6), radius)])
    assert len(holed.triangles) < len(whole.triangles)
    closed = close_pinholes(holed, points, 20.0)
    assert_paired(closed)
    assert (closed.twin < 0).sum() == (whole.twin < 0).sum() == 4 * 11
    area = triangle_areas(points, closed.source[closed.triangles]).sum()
    assert area == pytest.approx(121.0)
    corners = points[closed.source[closed.triangles]]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > -1e-12).all()


def test_only_holes_up_to_the_given_length_are_closed():
    whole, points = plate(20)
    holed = without(whole, points, [((5.3, 5.6), 0.6), ((13.3, 13.4), 4.0)])
    closed = close_pinholes(holed, points, 8.0)
    assert_paired(closed)
    lost = 361.0 - triangle_areas(points, closed.source[closed.triangles]).sum()
    assert lost > 30.0
    assert (closed.twin < 0).sum() > 4 * 19
    assert len(closed.triangles) > len(holed.triangles)


def test_a_sheet_without_small_holes_is_returned_as_it_is():
    whole, points = plate(6)
    assert close_pinholes(whole, points, 3.0) is whole


def test_both_mouths_of_a_cut_tunnel_are_closed():
    lower, points = plate(12)
    n = len(points)
    upper = Sheet(lower.source + n, lower.triangles[:, [0, 2, 1]] + n, lower.twin.reshape(-1, 3)[:, [2, 1, 0]].ravel())
    remap = np.arange(3 * len(lower.triangles)).reshape(-1, 3)[:, [2, 1, 0]].ravel()
    twin = np.where(upper.twin >= 0, remap[np.maximum(upper.twin, 0)], -1) + np.where(upper.twin >= 0, 3 * len(lower.triangles), 0)
    both = Sheet(
        np.concatenate([lower.source, upper.source]).astype(np.int32),
        np.vstack([lower.triangles, upper.triangles]).astype(np.int32),
        np.concatenate([lower.twin, twin]).astype(np.int32),
    )
    places = np.vstack([points, points + np.array([0.0, 0.0, 3.0])])
    assert_paired(both)
    closed = close_pinholes(without(both, places, [((5.3, 5.6), 1.2)]), places, 20.0)
    assert_paired(closed)
    assert (closed.twin < 0).sum() == 2 * 4 * 11


def test_no_corner_is_cut_off_where_the_loop_enters():
    # An arrow, run around clockwise as the border of a hole is: the line across its notch is the shortest, and lies outside.
    arrow = np.array([[0, 0, 0], [-1, 3, 0], [0, 1.5, 0], [1, 3, 0]], float)
    normal = np.array([0.0, 0.0, 1.0])
    assert np.cross(arrow, np.roll(arrow, -1, axis=0)).sum(axis=0) @ normal < 0
    assert _corner(arrow, normal) != 2
