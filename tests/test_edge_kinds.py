"""Kinds of edges, oriented normals, borders and angles on shapes whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

import scan2nurbs as s2n
from edge_shapes import box, grid, wedge
from scan2nurbs.edges.border import find_borders
from scan2nurbs.edges.kinds import BORDER, CONCAVE, CONVEX, CORNER
from scan2nurbs.edges.orient import Creases, orient_normals
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.flood import between_components, flood_signs
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.openness import openness
from scan2nurbs.kernels.wedge_sides import wedge_sides


@pytest.mark.parametrize("turn", [25.0, 60.0, 90.0, 120.0])
def test_the_turn_of_a_wedge_is_measured_within_its_error(turn):
    cells = build_cells(wedge(turn, noise=0.1), 4.0)
    m = 30
    foot = np.column_stack([np.zeros(m), np.linspace(8, 32, m), np.zeros(m)])
    normals = np.full((len(cells.points), 3), np.nan)
    component = np.full(len(cells.points), -1, np.int32)
    sides = wedge_sides(cells, normals, component, foot, np.tile([0.0, 1.0, 0.0], (m, 1)), np.full(m, np.radians(turn * 0.8)), 6.0, 0.1)
    error = np.degrees(sides.turn) - turn
    assert np.abs(error).max() < 6.0
    assert np.std(error / np.degrees(sides.turn_error)) < 2.5
    assert (sides.component == -1).all()


@pytest.mark.parametrize(("turn", "kind"), [(90.0, CONVEX), (-90.0, CONCAVE), (40.0, CONVEX)])
def test_a_ridge_is_convex_and_its_mirror_image_concave_seen_from_above(turn, kind):
    points = wedge(turn, noise=0.1)
    cells = build_cells(points, 4.0)
    a = np.radians(turn) / 2
    normals = np.column_stack([np.sign(cells.points[:, 0]) * np.sin(a), np.zeros(len(points)), np.full(len(points), np.cos(a))])
    normals *= np.random.default_rng(2).choice([-1.0, 1.0], len(points))[:, None]
    foot = np.column_stack([np.zeros(20), np.linspace(8, 32, 20), np.zeros(20)])
    creases = Creases(foot, np.tile([0.0, 1.0, 0.0], (20, 1)), np.full(20, np.radians(abs(turn))), 6.0)
    neighbours, _ = nearest_neighbours(cells, 8)
    found = orient_normals(cells, normals, neighbours, np.abs(cells.points[:, 0]) < 1.5, creases, 0.1)
    up = found.normal[np.isfinite(found.normal[:, 0]), 2]
    assert len(np.unique(np.sign(up))) == 1
    seen_from_above = found.sides.towards.sum(axis=1) * np.sign(up[0])
    assert ((seen_from_above > 0) == (kind == CONCAVE)).all()
    assert found.agreement.min() > 0.9


def test_a_noisy_box_has_convex_edges_and_eight_corners():
    points = box()
    edges = s2n.detect_edges(points)
    marked = edges.kind > 0
    assert np.array_equal(marked, edges.mask)
    assert set(np.unique(edges.kind)) <= {0, CONVEX, CORNER}
    straight = edges.kind == CONVEX
    assert straight.sum() > 200
    assert np.median(np.abs(edges.angle[straight] - 90)) < 4
    assert np.median(edges.confidence[straight]) > 0.8
    assert np.isnan(edges.angle[~marked]).all()
    assert (edges.confidence[~marked] == 0).all()
    assert ((edges.confidence >= 0) & (edges.confidence <= 1)).all()


def test_a_sheet_ends_at_its_border_and_a_hole_in_the_data_is_no_edge():
    sheet = grid(60, 0.1)
    sheet = sheet[np.linalg.norm(sheet[:, :2] - 30, axis=1) > 6]
    edges = s2n.detect_edges(sheet)
    inside = np.minimum(sheet[:, :2], 59 - sheet[:, :2]).min(axis=1)
    around_hole = np.linalg.norm(sheet[:, :2] - 30, axis=1) < 9
    border = edges.kind == BORDER
    assert (inside[border & ~around_hole] < 2.5).all()
    outermost = KDTree(sheet[border, :2]).query([(30.0, 0.0), (0.0, 30.0), (59.0, 30.0), (0.0, 0.0)])[0]
    assert outermost.max() < 2.0
    assert (border & around_hole).sum() > 15
    assert not edges.mask[around_hole].any()
    assert edges.mask[border & ~around_hole].all()
    assert (edges.angle[border] == 180).all()


def test_kinds_do_not_depend_on_position_scale_or_order():
    points = box(20)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    order = np.random.default_rng(2).permutation(len(points))
    moved = (0.01 * points @ turn.T + [3.0, -2.0, 7.0])[order]
    here, there = s2n.detect_edges(points), s2n.detect_edges(moved)
    assert (here.kind[order] == there.kind).mean() > 0.97
    assert not ((here.kind[order] == CONVEX) & (there.kind == CONCAVE)).any()
    assert np.nanmedian(np.abs(here.angle[order] - there.angle)) < 3


@pytest.mark.parametrize("operator", ["edn", "one-sided"])
def test_operators_of_wide_bands_have_no_kinds(operator):
    edges = s2n.detect_edges(box(12), s2n.EdgeParams(operator=operator))
    assert edges.kind is None
    assert edges.angle is None


def test_rows_that_are_no_point_have_no_kind():
    points = np.concatenate([box(16), [[np.nan, 0, 0]]])
    edges = s2n.detect_edges(points)
    assert edges.kind[-1] == 0
    assert np.isnan(edges.angle[-1])
    assert edges.confidence[-1] == 0


@pytest.mark.parametrize("points", [np.eye(3), np.random.default_rng(0).normal(size=(10, 3)), np.column_stack([np.arange(50.0)] * 3)])
def test_clouds_that_are_no_surface_are_survived(points):
    edges = s2n.detect_edges(points)
    assert edges.kind is not None
    assert len(edges.kind) == len(points)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**31), st.integers(1, 6))
def test_flooded_signs_agree_along_every_link_they_used(seed, k):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(0, 5, (80, 2)), np.zeros(80)])
    neighbours = KDTree(points).query(points, k + 1)[1][:, 1:].astype(np.int32).reshape(80, k)
    tilt = rng.normal(0, 0.05, (80, 3)) + np.array([0, 0, 1])
    normals = tilt / np.linalg.norm(tilt, axis=1, keepdims=True) * rng.choice([-1.0, 1.0], 80)[:, None]
    member = rng.random(80) < 0.8
    component, sign = flood_signs(neighbours, normals, member, 0.7)
    assert ((component >= 0) == member).all()
    assert ((sign != 0) == member).all()
    up = normals[:, 2] * sign
    for c in range(component.max(initial=-1) + 1):
        assert len(np.unique(np.sign(up[component == c]))) == 1


def test_openness_is_high_at_a_border_and_low_inside_and_at_a_crease():
    points = wedge(90.0)
    cells = build_cells(points, 4.0)
    a = np.radians(45.0)
    normals = np.column_stack([np.sign(cells.points[:, 0]) * np.sin(a), np.zeros(len(points)), np.full(len(points), np.cos(a))])
    found = openness(cells, normals, 4.0, 0.4)
    y, depth = cells.points[:, 1], -cells.points[:, 2] * np.sqrt(2)
    at_end = (np.minimum(y, 39 - y) < 0.3) & (depth > 5) & (depth < 34)
    inner = (np.minimum(y, 39 - y) > 5) & (depth < 34)
    assert found[at_end].min() > 0.8
    assert np.quantile(found[inner], 0.98) < 0.8
    borders = find_borders(cells, normals, 1.0, 0.0)
    assert not borders.mask[inner & (depth < 3)].any()
    assert borders.outline[at_end].mean() > 0.9


def test_points_beside_another_component_are_found():
    component = np.array([0, 0, 0, 1, 1, -1, 2], np.int32)
    neighbours = np.array([[1, -1], [0, 2], [1, 3], [4, 2], [3, 5], [4, 6], [5, -1]], np.int32)
    assert between_components(component, neighbours).tolist() == [2, 3]
