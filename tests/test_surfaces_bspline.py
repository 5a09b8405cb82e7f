"""The B-spline surface as a value: evaluation, rational surfaces, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.errors import ParameterError
from scan2nurbs.surfaces.bspline import BSplineSurface


def clamped(degree: int, spans: int) -> np.ndarray:
    return np.concatenate([np.zeros(degree), np.linspace(0, 1, spans + 1), np.ones(degree)])


def surface(p: int = 3, q: int = 2, m: int = 4, n: int = 3, seed: int = 0, **changes: object) -> BSplineSurface:
    rng = np.random.default_rng(seed)
    shape = (m + p, n + q)
    fields = {
        "degrees": (p, q),
        "knots": (clamped(p, m), clamped(q, n)),
        "control_points": rng.normal(size=(*shape, 3)),
        "weights": np.ones(shape),
    }
    return BSplineSurface(**(fields | changes))


def quarter_cylinder() -> BSplineSurface:
    """The exact rational quarter of a circle (The NURBS Book, ex. 7.1), swept."""
    arc = np.array([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]])
    net = np.stack([arc, arc + np.array([0, 0, 2])], axis=1)
    weights = np.repeat([[1.0], [np.sqrt(0.5)], [1.0]], 2, axis=1)
    return BSplineSurface((2, 1), (clamped(2, 1), clamped(1, 1)), net, weights)


def test_a_rational_quarter_circle_is_round() -> None:
    uv = np.random.default_rng(0).random((200, 2))
    s = quarter_cylinder()
    points = s.evaluate(uv)
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 1.0)
    np.testing.assert_allclose(points[:, 2], 2 * uv[:, 1])
    np.testing.assert_allclose(s.normals(uv), points * [1, 1, 0], atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), rational=st.booleans())
def test_a_surface_turned_over_is_the_same_seen_from_the_other_side(seed: int, rational: bool) -> None:
    rng = np.random.default_rng(seed)
    knots = np.concatenate([np.full(4, 2.0), np.sort(rng.uniform(2.0, 5.0, 3)), np.full(4, 5.0)])
    s = surface(knots=(knots, clamped(2, 3)), **({"weights": rng.uniform(0.5, 2, (7, 5))} if rational else {}), seed=seed)
    uv = rng.random((20, 2)) * [3.0, 1.0] + [2.0, 0.0]
    back = np.column_stack([7.0 - uv[:, 0], uv[:, 1]])
    over = s.turned_over()
    assert over.domain == s.domain
    np.testing.assert_allclose(over.evaluate(back), s.evaluate(uv), atol=1e-12)
    np.testing.assert_allclose(over.normals(back), -s.normals(uv), atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), rational=st.booleans())
def test_derivatives_are_limits_of_differences(seed: int, rational: bool) -> None:
    rng = np.random.default_rng(seed)
    s = surface(seed=seed, **({"weights": rng.uniform(0.5, 2, (7, 5))} if rational else {}))
    # Away from the knots, where the second derivatives of a quadratic jump.
    cell = rng.integers(0, [4, 3], (10, 2))
    uv = (cell + rng.uniform(0.2, 0.8, (10, 2))) / [4, 3]
    d = s.derivatives(uv, 2)
    e = 1e-5
    for k, (axis, of) in {1: (0, 0), 2: (1, 0), 3: (0, 1), 4: (1, 1), 5: (1, 2)}.items():
        step = np.eye(2)[axis] * e
        difference = (s.derivatives(uv + step, 2)[:, of] - s.derivatives(uv - step, 2)[:, of]) / (2 * e)
        np.testing.assert_allclose(d[:, k], difference, atol=1e-4 * (1 + np.abs(d[:, k]).max()))
    np.testing.assert_array_equal(s.derivatives(uv, 1), d[:, :3])
    np.testing.assert_array_equal(s.evaluate(uv), d[:, 0])


def test_equal_weights_of_any_size_are_polynomial() -> None:
    uv = np.random.default_rng(1).random((50, 2))
    s = surface()
    np.testing.assert_allclose(surface(weights=np.full((7, 5), 3.0)).evaluate(uv), s.evaluate(uv), atol=1e-14)


def test_corners_are_the_corners_of_the_net() -> None:
    s = surface()
    np.testing.assert_allclose(s.evaluate([[0, 0], [1, 0], [0, 1], [1, 1]]), s.control_points[[0, -1, 0, -1], [0, 0, -1, -1]])


def test_degenerate_normals_are_nan() -> None:
    s = surface(control_points=np.ones((7, 5, 3)))
    assert np.isnan(s.normals([[0.3, 0.4]])).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"control_points": np.zeros((7, 5, 2))},
        {"control_points": np.full((7, 5, 3), np.nan)},
        {"weights": np.ones((5, 7))},
        {"weights": np.zeros((7, 5))},
        {"degrees": (0, 2)},
        {"degrees": (16, 2)},
        {"degrees": (3, 7)},
        {"knots": (clamped(3, 5), clamped(2, 3))},
        {"knots": (clamped(3, 4)[::-1].copy(), clamped(2, 3))},
        {"knots": (np.linspace(0, 1, 11), clamped(2, 3))},
        {"knots": (np.zeros(11), clamped(2, 3))},
    ],
)
def test_what_does_not_belong_together_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ParameterError):
        surface(**changes)


@pytest.mark.parametrize("uv", [[[0.5, 1.1]], [[-0.1, 0.5]], [[np.nan, 0.5]], [0.5, 0.5], [[0.1, 0.2, 0.3]]])
def test_parameters_outside_the_domain_are_refused(uv: list[object]) -> None:
    with pytest.raises(ParameterError):
        surface().evaluate(uv)


def test_order_of_derivatives_is_one_or_two() -> None:
    with pytest.raises(ParameterError, match="order"):
        surface().derivatives([[0.5, 0.5]], 3)
