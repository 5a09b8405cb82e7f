"""Tunnels between the two sides of a thin wall are cut, and both of their ends closed; holes stay."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.sheet import Sheet, components, triangle_areas
from scan2nurbs.faces.topology import find_topology
from scan2nurbs.faces.tunnels import close_tunnels
from scan2nurbs.scale import measure_scale
from test_pinholes import assert_paired, plate, without
from test_topology import box, noisy


def wall(n, holes, slant=0.0):
    """Two plates one apart, with rings through both where there are holes, their points and their normals, tilted into the holes."""
    whole, flat = plate(n)
    plane = without(whole, flat, holes)
    upper = plane.source[plane.triangles]
    lower = upper[:, ::-1] + n * n
    start, end = upper.ravel(), np.roll(upper, -1, axis=1).ravel()
    edge = plane.twin < 0
    inside = (flat[start] > 0).all(axis=1, where=[True, True, False]) & (flat[start] < n - 1).all(axis=1, where=[True, True, False])
    u, v = start[edge & inside], end[edge & inside]
    ring = np.vstack([np.column_stack([v, u, u + n * n]), np.column_stack([v, u + n * n, v + n * n])])
    triangles = np.vstack([upper, lower, ring]).astype(np.int32)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    at = {(int(a), int(b)): k for k, (a, b) in enumerate(zip(start, end, strict=True))}
    twin = np.array([at.get((int(b), int(a)), -1) for a, b in zip(start, end, strict=True)], np.int32)
    points = np.vstack([flat, flat - [0.0, 0.0, 1.0]])
    up = np.tile([0.0, 0.0, 1.0], (n * n, 1))
    for place, radius in holes:
        way = np.append(place, 0.0) - flat
        far = np.linalg.norm(way, axis=1)
        near = far < radius + 1.5
        up[near] += slant * way[near] / far[near, None]
    up /= np.linalg.norm(up, axis=1)[:, None]
    sheet = Sheet(np.arange(2 * n * n, dtype=np.int32), triangles, twin)
    return sheet, points, np.vstack([up, up * [1.0, 1.0, -1.0]])


def area_of(sheet, points):
    return triangle_areas(points, sheet.source[sheet.triangles]).sum()


@pytest.mark.parametrize("radius", [0.3, 0.6, 1.2, 2.2])
def test_a_tunnel_is_cut_and_both_its_ends_are_closed(radius):
    sheet, points, outward = wall(14, [((5.3, 5.6), radius)])
    assert_paired(sheet)
    assert components(sheet)[0] == 1
    parted = close_tunnels(sheet, points, outward, 50.0)
    assert_paired(parted)
    assert components(parted)[0] == 2
    assert (parted.twin < 0).sum() == 2 * 4 * 13
    assert area_of(parted, points) == pytest.approx(2 * 13.0**2)


def test_tunnels_are_cut_and_wide_holes_stay():
    holes = [((5.3, 5.3), 0.6), ((8.2, 6.7), 0.6), ((15.3, 15.4), 5.0)]
    sheet, points, outward = wall(24, holes)
    parted = close_tunnels(sheet, points, outward, 50.0)
    assert_paired(parted)
    only_wide, _, _ = wall(24, holes[2:])
    assert area_of(parted, points) == pytest.approx(area_of(only_wide, points))
    assert components(parted)[0] == 1
    assert close_tunnels(only_wide, points, outward, 50.0) is only_wide


def test_what_turns_within_the_hole_is_no_tunnel():
    sheet, points, outward = wall(14, [((5.3, 5.6), 1.2)], slant=1.0)
    assert close_tunnels(sheet, points, outward, 50.0) is sheet


def test_the_rest_of_an_open_surface_keeps_its_holes():
    sheet, points, outward = wall(24, [((5.3, 5.3), 0.6)])
    keep = np.linalg.norm(points[sheet.source[sheet.triangles]].mean(axis=1) - [15.0, 15.0, 0.0], axis=1) > 0.9
    start = sheet.triangles[keep]
    at = {(int(a), int(b)): k for k, (a, b) in enumerate(zip(start.ravel(), np.roll(start, -1, axis=1).ravel(), strict=True))}
    twin = np.array([at.get((b, a), -1) for a, b in at], np.int32)
    parted = close_tunnels(Sheet(sheet.source, start, twin), points, outward, 50.0)
    assert_paired(parted)
    assert area_of(parted, points) == pytest.approx(
        2 * 23.0**2 - area_of(sheet, points) + area_of(Sheet(sheet.source, start, twin), points), abs=9.0
    )
    assert (parted.twin < 0).sum() == (twin < 0).sum()


@pytest.mark.parametrize("seed", range(3))
def test_a_thin_plate_has_no_tunnels(seed):
    rng = np.random.default_rng(seed)
    points, label, fits = box((30.0, 24.0, 0.9), rng)
    points = noisy(points, rng)
    topology = find_topology(points, label, fits, measure_scale(points))
    wide = np.argsort(topology.areas)[-2:]
    assert [len(topology.loops[f]) for f in wide] == [1, 1]
