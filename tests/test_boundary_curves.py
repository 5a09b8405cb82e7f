"""Boundary curves: order, closure, gaps, junctions, splines and corners against analytic curves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.edges.curves import CurveParams, fit_curve, trace_curves
from scan2nurbs.edges.graph import order_points
from scan2nurbs.edges.polyline import find_corners, resample, smooth
from scan2nurbs.errors import ParameterError
from scan2nurbs.kernels.tracing import greedy_spanner


def row(corners, step=1.5, closed=True):
    corners = np.array(corners, float)
    return resample(corners, step, closed=closed)


def circle(radius=20.0, step=1.5):
    t = np.arange(0.0, 2.0 * np.pi, step / radius)
    return np.stack([radius * np.cos(t), radius * np.sin(t), 3.0 + 0.0 * t], axis=1)


SQUARE = [[0, 0, 0], [45, 0, 0], [45, 45, 0], [0, 45, 0]]


def shuffled(points, seed=0, noise=0.0):
    rng = np.random.default_rng(seed)
    return rng.permutation(points) + noise * rng.standard_normal(points.shape)


@pytest.mark.parametrize("noise", [0.0, 0.15, 0.3])
def test_circle(noise):
    (curve,) = trace_curves(shuffled(circle(), noise=noise), 1.0, noise=noise)
    assert curve.closed
    assert len(curve.corners) == 0
    sample = curve.sample(0.2)
    off = np.hypot(np.hypot(sample[:, 0], sample[:, 1]) - 20.0, sample[:, 2] - 3.0)
    assert off.mean() < 0.05 + 0.7 * noise
    assert curve.length == pytest.approx(40.0 * np.pi, rel=0.02)
    assert curve.rms <= curve.max_deviation <= 0.3 + 4.0 * noise
    # A periodic spline: position and tangent agree across the seam.
    tangent = curve.spline.derivative()
    np.testing.assert_allclose(curve.spline(0.0), curve.spline(curve.end - 1e-9), atol=1e-6)
    np.testing.assert_allclose(tangent(0.0), tangent(curve.end - 1e-9), atol=1e-6)
    assert len(curve.spline.c) <= 24


@pytest.mark.parametrize("noise", [0.0, 0.15])
def test_square_keeps_its_corners(noise):
    (curve,) = trace_curves(shuffled(row(SQUARE), noise=noise), 1.0, noise=noise)
    assert curve.closed
    assert len(curve.corners) == 4
    found = curve.spline(curve.corners)
    distance = np.linalg.norm(found[:, None] - np.array(SQUARE, float)[None], axis=2).min(axis=1)
    assert distance.max() < 1.0
    assert curve.length == pytest.approx(180.0, rel=0.02)
    np.testing.assert_allclose(curve.spline(0.0), curve.spline(curve.end), atol=1e-6)
    assert curve.rms < 0.4


def test_open_curve_keeps_its_ends():
    t = np.linspace(0.0, 3.0, 60)
    points = np.stack([20.0 * t, 10.0 * np.sin(t), 5.0 * t**2], axis=1)
    (curve,) = trace_curves(shuffled(points), 1.0)
    assert not curve.closed
    ends = sorted([tuple(curve.spline(0.0)), tuple(curve.spline(curve.end))])
    np.testing.assert_allclose(ends, [points[0], points[-1]], atol=0.3)
    assert curve.max_deviation < 0.5
    assert len(curve.points) == 60


def test_gaps_are_bridged_and_wide_ones_are_not():
    points = circle()
    angle = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    (closed,) = trace_curves(shuffled(points[np.abs(angle) > 8.0]), 1.0)
    assert closed.closed
    (open_,) = trace_curves(shuffled(points[np.abs(angle) > 20.0]), 1.0)
    assert not open_.closed


def test_parallel_curves_stay_apart():
    curves = trace_curves(shuffled(np.concatenate([circle(20.0), circle(24.0)])), 1.0)
    assert [curve.closed for curve in curves] == [True, True]
    assert [round(curve.length / (2.0 * np.pi)) for curve in curves] == [24, 20]


def test_side_branches_and_crumbs_are_left_out():
    spur = np.array([[20.0 + d, 0.0, 3.0] for d in (1.4, 2.7)])
    crumbs = np.array([[0.0, 0.0, 0.0], [1.4, 0.0, 0.0], [2.8, 0.0, 0.0]])
    (curve,) = trace_curves(shuffled(np.concatenate([circle(), spur, crumbs])), 1.0)
    assert curve.closed
    assert curve.length == pytest.approx(40.0 * np.pi, rel=0.02)


def test_curves_split_at_junctions():
    """A square with a bar across: three curves between two junctions."""
    bar = row([[22.5, 1.5, 0], [22.5, 43.5, 0]], closed=False)
    curves = trace_curves(shuffled(np.concatenate([row(SQUARE), bar])), 1.0)
    assert [curve.closed for curve in curves] == [False] * 3
    assert sorted(round(curve.length / 45.0) for curve in curves) == [1, 2, 2]


def test_figure_eight_of_two_squares():
    left = row(SQUARE)
    right = left + np.array([46.0, 46.0, 0.0])
    curves = trace_curves(shuffled(np.concatenate([left, right])), 1.0)
    assert sum(curve.length for curve in curves) == pytest.approx(360.0, rel=0.04)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-6, 0.2, 1.0, 3e4]))
def test_motion_scale_and_order_change_nothing(seed, scale):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2.0 * np.pi, 81)[:-1]
    points = np.stack([25.0 * np.cos(t), 15.0 * np.sin(t), 4.0 * np.sin(2.0 * t)], axis=1) + 0.1 * np.random.default_rng(1).normal(
        size=(80, 3)
    )
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    (here,) = trace_curves(points, 1.0)
    (again,) = trace_curves(rng.permutation(points), 1.0)
    np.testing.assert_array_equal(again.spline.c, here.spline.c)
    (there,) = trace_curves(scale * (points @ turn + [5.0, -7.0, 100.0]), scale)
    assert there.closed
    # Where the curve begins is free: the points and the lengths are what must agree.
    assert there.length == pytest.approx(scale * here.length, rel=2e-2)
    assert there.rms == pytest.approx(scale * here.rms, rel=0.5)


def test_spanner_keeps_long_loops_only():
    points = row(SQUARE)
    n = len(points)
    pairs = np.array([(i, (i + 1) % n) for i in range(n)] + [(i, (i + 2) % n) for i in range(n)])
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    order = np.argsort(length, kind="stable")
    chosen = greedy_spanner(n, pairs[order], length[order], 12.0)
    assert chosen.sum() == n
    assert greedy_spanner(n, pairs[order], length[order], 1e9).sum() == n - 1


@given(st.integers(0, 2**32 - 1))
def test_random_points_never_break_the_ordering(seed):
    """Points on no curve at all: every node at most once inside chains, and no failure."""
    points = np.random.default_rng(seed).uniform(0.0, 20.0, (120, 3))
    chains = order_points(points, link=3.0, gap=6.0, prune=4.0, loop=12.0)
    inner = [node for chain in chains for node in (chain.nodes if chain.closed else chain.nodes[1:-1])]
    assert len(inner) == len(set(inner)) or any(chain.closed for chain in chains)
    assert all(len(chain.nodes) >= 2 for chain in chains)


def test_corners_but_not_bends():
    assert len(find_corners(row(SQUARE, 0.5), closed=True, arm=6.0, blunt=1.0, min_angle=35.0)) == 4
    for radius in (6.0, 10.0, 40.0):
        assert len(find_corners(circle(radius, 0.5), closed=True, arm=6.0, blunt=1.0, min_angle=35.0)) == 0
    bent = row([[0, 0, 0], [30, 0, 0], [60, 8, 0]], 0.5, closed=False)
    assert len(find_corners(bent, closed=False, arm=6.0, blunt=1.0, min_angle=35.0)) == 0


@given(st.integers(4, 60), st.floats(2.5, 40.0), st.booleans())
def test_smoothing_equals_dense_least_squares(k, wave, closed):
    rng = np.random.default_rng(k)
    values, weight = rng.normal(size=(k, 2)), rng.uniform(0.2, 1.0, k)
    second = np.zeros((k if closed else k - 2, k))
    for i in range(len(second)):
        for offset, factor in ((0, 1.0), (1, -2.0), (2, 1.0)):
            second[i, (i + offset) % k] += factor
    penalty = 1.0 / (2.0 * np.sin(np.pi / wave)) ** 4
    expected = np.linalg.solve(np.diag(weight) + penalty * second.T @ second, weight[:, None] * values)
    np.testing.assert_allclose(smooth(values, weight, wave, closed=closed), expected, atol=1e-7)


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 9])
def test_degrees(degree):
    curve = fit_curve(circle(), 1.0, closed=True, params=CurveParams(degree=degree, tolerance=0.05))
    assert curve.spline.k == degree
    assert curve.max_deviation < 0.3


def test_nothing_in_nothing_out():
    assert trace_curves(np.empty((0, 3)), 1.0) == ()
    assert trace_curves(np.zeros((2, 3)), 1.0) == ()
    assert trace_curves(np.arange(9.0).reshape(3, 3) * 100.0, 1.0) == ()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CurveParams(link=0.0), r"'link' parameter of trace_curves must be a float in \(0, inf\). Got 0.0 instead."),
        (lambda: CurveParams(prune=-1.0), r"'prune' parameter of trace_curves must be a float in \[0, inf\)"),
        (lambda: CurveParams(tolerance=0.0), "'tolerance'"),
        (lambda: CurveParams(degree=0), r"'degree' parameter of trace_curves must be an int in \[1, 9\]. Got 0 instead."),
        (lambda: CurveParams(corner_angle=180.0), "'corner_angle'"),
        (lambda: trace_curves(np.zeros((3, 3)), -1.0), "'spacing'"),
        (lambda: trace_curves(np.zeros((3, 3)), 1.0, noise=float("nan")), "'noise'"),
    ],
)
def test_parameter_errors(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
