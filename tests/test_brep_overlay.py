"""Set operations on polylines, and the curves laid through them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brep_samples import circle
from scan2nurbs.brep.curve import fit_curve
from scan2nurbs.brep.overlay import area, crosses, overlay, winding

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
CASES = [
    ([SQUARE, SQUARE + 0.5], lambda w: w[0] and w[1], [0.25]),
    ([SQUARE, SQUARE + 0.5], lambda w: w[0] and not w[1], [0.75]),
    ([SQUARE, SQUARE + np.array([0.5, 0.0])], lambda w: w.any(), [1.5]),
    ([SQUARE, 0.25 + 0.5 * SQUARE], lambda w: w[0] and not w[1], [-0.25, 1.0]),
    ([SQUARE, SQUARE[::-1]], lambda w: w[0] and w[1], [1.0]),
    ([SQUARE, np.array([[0.2, 0.0], [0.5, 0.5], [0.8, 0.0]])], lambda w: w[0] and not w[1], [0.85]),
    ([np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])], lambda w: w[0], [0.25, 0.25]),
    ([SQUARE, np.array([[0.3, 0.0], [0.7, 0.5], [0.5, 1.0]])], lambda w: w[0] and not w[1], [0.4, 0.45]),
]


@pytest.mark.parametrize(("loops", "keep", "areas"), CASES)
def test_regions_have_their_areas(loops, keep, areas):
    found = overlay(loops, lambda w: bool(keep(w)), snap=1e-9)
    assert sorted(area(loop) for loop in found) == pytest.approx(areas)


@given(st.integers(0, 10_000))
def test_any_two_scribbles_intersect_in_simple_loops_with_the_area_of_the_raster(seed):
    rng = np.random.default_rng(seed)
    loops = [circle(*rng.uniform(0.4, 0.6, 2), 0.3, n=60) + rng.normal(size=(60, 2)) * rng.choice([0, 0.01, 0.05]) for _ in range(2)]
    found = overlay(loops, lambda w: bool(w[0] and w[1]), snap=1e-9)
    grid = (np.indices((200, 200)).reshape(2, -1).T + 0.5) / 200
    inside = (winding(loops[0], grid) != 0) & (winding(loops[1], grid) != 0)
    assert sum(area(loop) for loop in found) == pytest.approx(inside.mean(), abs=0.01)
    assert not any(crosses([loop], 0.0) for loop in found)


def test_crossing_loops_are_told_from_simple_ones():
    assert not crosses([SQUARE, SQUARE + 2.0], 0.0)
    assert crosses([SQUARE, SQUARE + 0.5], 0.0)
    assert crosses([SQUARE[[0, 2, 1, 3]]], 0.0)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_a_curve_keeps_its_tolerance_with_few_control_points(closed, tolerance):
    t = np.linspace(0, 2 * np.pi, 400)
    points = np.column_stack([np.cos(t), np.sin(t)])
    curve = fit_curve(points, t, tolerance=tolerance, closed=closed)
    fine = curve(curve.samples(20))
    assert np.abs(np.linalg.norm(fine, axis=1) - 1).max() <= 1.2 * tolerance
    assert len(curve.control_points) < 16 * tolerance**-0.25
    assert np.allclose(curve.control_points[0], curve.control_points[-1])


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_a_curve_passes_through_few_points(n):
    points = np.random.default_rng(n).normal(size=(n, 2))
    t = np.arange(n, dtype=float)
    assert np.allclose(fit_curve(points, t, tolerance=1e-12)(t), points, atol=1e-9)
