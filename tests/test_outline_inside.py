"""Algorithm 3 of the paper: exact where outlines are star-shaped about their centroid, wrong elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.edges.corrections import in_polygon
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.inside import enclosed_by_centroid

CIRCLE = [np.stack([np.cos(np.linspace(0, 2 * np.pi, 300)[:-1]), np.sin(np.linspace(0, 2 * np.pi, 300)[:-1])], axis=1) * 30.0]
SHAPES = {
    "circle": CIRCLE,
    "square": [np.array([[0, 0], [60, 0], [60, 60], [0, 60.0]])],
    "rectangle": [np.array([[0, 0], [100, 0], [100, 20], [0, 20.0]])],
    "T": [20.0 * np.array([[0, 2], [1, 2], [1, 0], [2, 0], [2, 2], [3, 2], [3, 3], [0, 3]])],
    "L": [20.0 * np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])],
    "U": [20.0 * np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]])],
    "ring": [CIRCLE[0], 0.5 * CIRCLE[0]],
}


def boundary(loops, step=0.5):
    pieces = []
    for loop in loops:
        ring = np.concatenate([loop, loop[:1]])
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
        at = np.arange(0.0, length[-1], step)
        pieces.append(np.stack([np.interp(at, length, ring[:, 0]), np.interp(at, length, ring[:, 1]), 0.0 * at], axis=1))
    return np.concatenate(pieces)


def score(name):
    loops = SHAPES[name]
    low, high = loops[0].min(axis=0) - 8.0, loops[0].max(axis=0) + 8.0
    points = np.random.default_rng(0).uniform(low, high, (8000, 2))
    true = np.zeros(len(points), bool)
    for loop in loops:
        true ^= in_polygon(points, loop)
    found = enclosed_by_centroid(np.column_stack([points, np.zeros(len(points))]), boundary(loops))
    return np.mean(found == true), np.sum(found & true) / np.sum(found | true)


@pytest.mark.parametrize("name", ["circle", "square"])
def test_exact_on_star_shaped_outlines(name):
    accuracy, overlap = score(name)
    assert accuracy > 0.995
    assert overlap > 0.99


def test_nearly_exact_on_a_long_rectangle():
    accuracy, overlap = score("rectangle")
    assert 0.95 < accuracy < 0.999
    assert 0.9 < overlap < 0.99


@pytest.mark.parametrize(("name", "at_most"), [("T", 0.8), ("L", 0.75), ("ring", 0.75), ("U", 0.6)])
def test_fails_on_other_outlines(name, at_most):
    """What the paper's algorithm cannot do: another result would mean that it is no longer the paper's."""
    assert 0.2 < score(name)[1] < at_most


def literal(points, edge):
    """The pseudo-code of Algorithm 3, line by line."""
    c = sum(edge) / len(edge)
    inside = []
    for x in points:
        y = edge[np.argmin([np.linalg.norm(x - p) for p in edge])]
        inside.append((y - x) @ (c - x) < 0 and np.linalg.norm(y - c) > np.linalg.norm(x - c))
    return np.array(inside, bool)


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_equals_the_pseudo_code(seed, n):
    rng = np.random.default_rng(seed)
    points, edge = rng.normal(size=(60, 3)), 2.0 * rng.normal(size=(n, 3))
    np.testing.assert_array_equal(enclosed_by_centroid(points, edge), literal(points, edge))


@given(st.integers(0, 2**32 - 1))
def test_rigid_motion_and_order_change_nothing(seed):
    rng = np.random.default_rng(seed)
    points, edge = rng.normal(size=(200, 3)), 2.0 * rng.normal(size=(50, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    order = rng.permutation(200)
    moved = enclosed_by_centroid(points[order] @ turn + 5.0, rng.permutation(edge) @ turn + 5.0)
    np.testing.assert_array_equal(moved, enclosed_by_centroid(points, edge)[order])


def test_boundary_points_are_not_inside():
    edge = boundary(SHAPES["circle"])
    assert not enclosed_by_centroid(edge, edge).any()


def test_errors():
    with pytest.raises(ParameterError, match="'boundary'"):
        enclosed_by_centroid(np.zeros((3, 3)), np.empty((0, 3)))
    with pytest.raises(ParameterError, match=r"must be \(N, 3\)"):
        enclosed_by_centroid(np.zeros((3, 2)), np.zeros((3, 3)))
