"""Foot points on a surface, and surfaces extended beyond their borders."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.extend import extend
from scan2nurbs.surfaces.project import foot_points


def random_surface(rng: np.random.Generator, degrees: tuple[int, int], bumps: float) -> BSplineSurface:
    """A bumpy sheet over the unit square with uneven knots."""
    knots, places = [], []
    for degree in degrees:
        inner = np.sort(rng.uniform(0.1, 0.9, rng.integers(0, 5)))
        vector = np.r_[np.zeros(degree + 1), inner, np.ones(degree + 1)]
        knots.append(vector)
        places.append(np.array([vector[i + 1 : i + degree + 1].mean() for i in range(len(inner) + degree + 1)]))
    u, v = np.meshgrid(*places, indexing="ij")
    control = np.stack([u, v, bumps * rng.normal(size=u.shape)], axis=2)
    return BSplineSurface(degrees, (knots[0], knots[1]), control, np.ones(u.shape))


degrees = st.tuples(st.integers(1, 5), st.integers(1, 5))


@given(st.integers(0, 10_000), degrees, st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_an_extended_surface_stays_the_same_on_its_old_domain(seed, degrees, before, after):
    rng = np.random.default_rng(seed)
    surface = random_surface(rng, degrees, 0.3)
    wider = extend(surface, np.array([-before, -after]), np.array([1 + after, 0.5]))
    assert wider.domain == ((-before, 1 + after), (-after, 1.0))
    assert wider.control_points.shape == surface.control_points.shape
    uv = rng.random((200, 2))
    np.testing.assert_allclose(wider.evaluate(uv), surface.evaluate(uv), atol=1e-9)


def test_an_extended_surface_goes_on_as_its_polynomials_do():
    rng = np.random.default_rng(0)
    knots = np.r_[0, 0, 0, 0, 1, 1, 1, 1.0]
    surface = BSplineSurface((3, 3), (knots, knots), rng.random((4, 4, 3)), np.ones((4, 4)))
    wider = extend(surface, np.array([-0.5, 0.0]), np.array([1.0, 1.0]))
    u = np.linspace(0, 1, 4)
    for v in (0.0, 0.3, 1.0):
        values = surface.evaluate(np.c_[u, np.full(4, v)])
        expected = [np.polyval(np.polyfit(u, values[:, k], 3), -0.4) for k in range(3)]
        np.testing.assert_allclose(wider.evaluate(np.array([[-0.4, v]]))[0], expected, atol=1e-9)


def test_a_closed_direction_is_left_alone():
    rng = np.random.default_rng(0)
    surface = random_surface(rng, (3, 3), 0.1)
    tube = BSplineSurface(surface.degrees, surface.knots, surface.control_points, surface.weights, (True, False))
    wider = extend(tube, np.array([-1.0, -1.0]), np.array([2.0, 2.0]))
    assert wider.domain == ((0.0, 1.0), (-1.0, 2.0))


@given(st.integers(0, 10_000), st.tuples(st.integers(2, 5), st.integers(2, 5)))  # a kink has feet on both of its sides
def test_foot_points_are_the_nearest_points(seed, degrees):
    rng = np.random.default_rng(seed)
    surface = random_surface(rng, degrees, 0.03)
    uv = rng.uniform(0.05, 0.95, (40, 2))
    height = rng.normal(size=40) * 0.02
    points = surface.evaluate(uv) + height[:, None] * surface.normals(uv)
    feet = foot_points(surface, points, np.clip(uv + rng.normal(size=uv.shape) * 0.02, 0, 1), steps=40)
    assert np.all(feet.distance <= np.abs(height) + 1e-9)
    np.testing.assert_allclose(np.linalg.norm(surface.evaluate(feet.uv) - points, axis=1), feet.distance, atol=1e-12)
    grid = surface.evaluate(np.stack(np.meshgrid(*[np.linspace(0, 1, 60)] * 2), axis=2).reshape(-1, 2))
    nearest = np.linalg.norm(points[:, None] - grid[None], axis=2).min(axis=1)
    assert np.all(feet.distance <= nearest + 1e-9)


def test_beyond_the_border_the_distance_exceeds_the_height():
    surface = random_surface(np.random.default_rng(1), (3, 3), 0.0)
    feet = foot_points(surface, np.array([[1.5, 0.5, 0.1]]), np.array([[0.9, 0.5]]))
    np.testing.assert_allclose(feet.uv, [[1.0, 0.5]], atol=1e-9)
    assert abs(abs(feet.height[0]) - 0.1) < 1e-9
    assert abs(feet.distance[0] - np.hypot(0.5, 0.1)) < 1e-9
