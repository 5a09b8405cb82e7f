"""Cleaning and thinning of boundary points: masks, Algorithm 2, and the distance to true creases under noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.edges.clean import CleanParams, clean_boundary, density_filter, in_large_group, near_curves
from scan2nurbs.edges.thin import CREASE, RIDGE, ThinParams, approximate_boundary, move_to_boundary, thin_boundary
from scan2nurbs.errors import ParameterError
from scan2nurbs.kernels.runner import set_threads


def wedge(angle, noise, seed=0, length=60.0, width=25.0):
    """Two half-planes that meet along the x axis, where the surface turns by the angle; one point a unit of area."""
    rng = np.random.default_rng(seed)
    n = int(length * width)
    u, v, w = rng.uniform(0, length, 2 * n), rng.uniform(0, width, 2 * n), np.arange(2 * n) < n
    t = np.radians(angle)
    points = np.stack([u, np.where(w, -v, v * np.cos(t)), np.where(w, 0.0, -v * np.sin(t))], axis=1)
    return points + noise * rng.standard_normal(points.shape)


def from_axis(points):
    return np.hypot(points[:, 1], points[:, 2])


def rim(noise, radius=20.0, height=30.0, seed=1):
    """A can: where its side meets its lid the crease is a circle."""
    rng = np.random.default_rng(seed)
    n = int(2.0 * np.pi * radius * height)
    t, z = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, height, n)
    m = int(np.pi * radius**2)
    r, s = radius * np.sqrt(rng.uniform(size=m)), rng.uniform(0, 2 * np.pi, m)
    side = np.stack([radius * np.cos(t), radius * np.sin(t), z], axis=1)
    lid = np.stack([r * np.cos(s), r * np.sin(s), np.full(m, height)], axis=1)
    points = np.concatenate([side, lid])
    points += noise * rng.standard_normal(points.shape)

    def distance(p):
        return np.hypot(np.hypot(p[:, 0], p[:, 1]) - radius, p[:, 2] - height)

    return points, distance


@pytest.mark.parametrize(("noise", "at_most"), [(0.0, 0.1), (0.25, 0.35), (0.5, 0.55)])
@pytest.mark.parametrize("shape", ["wedge", "rim"])
def test_thinned_points_lie_on_the_crease(noise, at_most, shape):
    cloud, distance = (wedge(90.0, noise), from_axis) if shape == "wedge" else rim(noise)
    band = cloud[distance(cloud) < 3.0]
    thinned = thin_boundary(band, cloud, spacing=1.0, noise=noise)
    assert distance(thinned.points).mean() < at_most
    assert distance(thinned.points).mean() < 0.5 * distance(approximate_boundary(band, 1.5, times=2)).mean()
    assert np.mean(thinned.status == CREASE) > 0.9
    assert abs(np.median(thinned.angle) - 90.0) < 8.0
    if shape == "wedge":
        assert np.abs(thinned.direction[thinned.status == CREASE, 0]).mean() > 0.98


def test_shallow_creases_are_found_without_noise():
    cloud = wedge(12.0, 0.0)
    moved = move_to_boundary(cloud[from_axis(cloud) < 2.5], cloud, spacing=1.0)
    assert np.mean(moved.status == CREASE) > 0.7
    assert from_axis(moved.points).mean() < 0.1
    assert np.median(moved.angle[moved.status == CREASE]) == pytest.approx(12.0, abs=1.0)


def test_knife_edge():
    cloud = wedge(150.0, 0.0)
    thinned = thin_boundary(cloud[from_axis(cloud) < 2.5], cloud, spacing=1.0)
    assert from_axis(thinned.points).max() < 0.2


def test_a_rounded_edge_goes_to_the_middle_of_its_band():
    """No two planes fit better than one curved face: a cylinder's strip keeps its place and becomes its middle line."""
    rng = np.random.default_rng(3)
    x, t = rng.uniform(0.0, 80.0, 4000), rng.uniform(-1.25, 1.25, 4000)
    cloud = np.stack([x, 20.0 * np.sin(t), 20.0 * np.cos(t)], axis=1)
    band = cloud[np.abs(t) < 0.12]
    moved = move_to_boundary(band, cloud, spacing=1.0, noise=0.2)
    assert np.mean(moved.status == RIDGE) > 0.9
    inner = (band[:, 0] > 8.0) & (band[:, 0] < 72.0)
    assert np.abs(moved.points[inner, 1]).mean() < 0.4 * np.abs(band[inner, 1]).mean()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_and_order_change_no_bit(threads):
    cloud, distance = rim(0.25)
    band = cloud[distance(cloud) < 3.0]
    expected = thin_boundary(band, cloud, spacing=1.0, noise=0.25).points
    order = np.random.default_rng(threads).permutation(len(band))
    set_threads(threads)
    try:
        again = thin_boundary(band[order], cloud, spacing=1.0, noise=0.25)
    finally:
        set_threads(None)
    np.testing.assert_array_equal(again.points, expected)


def test_units_and_places_change_nothing():
    cloud, distance = rim(0.2)
    band = cloud[distance(cloud) < 3.0]
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    here = thin_boundary(band, cloud, spacing=1.0, noise=0.2)
    there = thin_boundary((band @ turn) * 1e-5, (cloud @ turn) * 1e-5, spacing=1e-5, noise=0.2e-5)
    assert abs(len(there.points) - len(here.points)) <= 2
    # Points between two faces may change sides by rounding, and with them, a little, the creases of their neighbourhoods.
    off = np.linalg.norm(there.moved.points @ turn.T / 1e-5 - here.moved.points, axis=1)
    assert np.median(off) < 1e-6
    assert np.mean(off > 0.05) < 0.05


def literal(points, radius, order):
    """Algorithm 2 as printed, with a given order of pops."""
    left, result = list(order), []
    while left:
        x = points[left[0]]
        near = [i for i in left if np.linalg.norm(points[i] - x) < radius]
        result.append(points[near].mean(axis=0))
        left = [i for i in left if i not in near]
    return np.array(result)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.05, 3.0))
def test_algorithm_2_equals_the_pseudo_code(seed, n, radius):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3)) * [3.0, 2.0, 1.0]
    found = approximate_boundary(points, radius)
    relative = points - points.mean(axis=0)
    axis = np.linalg.eigh(relative.T @ relative)[1][:, 2]
    along = relative @ axis
    along *= 1.0 if (along**3).sum() >= 0.0 else -1.0
    np.testing.assert_allclose(found, literal(points, radius, np.argsort(-along)), atol=1e-9)
    np.testing.assert_array_equal(approximate_boundary(rng.permutation(points), radius), found)


def test_algorithm_2_repeated_thins_further():
    cloud, distance = rim(0.0)
    band = cloud[distance(cloud) < 2.0]
    once, thrice = approximate_boundary(band, 1.5), approximate_boundary(band, 1.5, times=3)
    assert len(band) > len(once) > len(thrice) > 60
    np.testing.assert_array_equal(approximate_boundary(approximate_boundary(once, 1.5), 1.5), thrice)


def scene():
    """A long line, a small clump far from it, and single points."""
    rng = np.random.default_rng(5)
    line = np.stack([np.arange(0.0, 80.0, 0.7), np.zeros(115), np.zeros(115)], axis=1) + 0.2 * rng.standard_normal((115, 3))
    clump = rng.normal(size=(8, 3)) + np.array([40.0, 20.0, 0.0])
    single = np.array([[10.0, -15.0, 0.0], [60.0, -30.0, 5.0], [90.0, 30.0, 0.0]])
    return np.concatenate([line, clump, single]), 115


@pytest.mark.parametrize("params", [CleanParams(), CleanParams(method="radius"), CleanParams(robust=False, deviations=2.0)])
def test_cleaning_keeps_the_line_only(params):
    points, n_line = scene()
    cleaned = clean_boundary(points, spacing=1.0, params=params)
    assert cleaned.keep[:n_line].mean() > 0.97
    assert not cleaned.keep[n_line:].any()
    assert cleaned.sparse[-3:].all()
    assert not (cleaned.sparse & cleaned.isolated).any()
    np.testing.assert_array_equal(cleaned.keep, ~(cleaned.sparse | cleaned.isolated))
    counts = cleaned.counts
    assert counts["given"] == len(points) == counts["sparse"] + counts["isolated"] + counts["kept"]


def test_density_threshold_follows_the_noise():
    """The same line with more noise keeps its points, where a threshold for noiseless points would not."""
    rng = np.random.default_rng(6)
    line = np.stack([np.arange(0.0, 200.0, 1.0), np.zeros(200), np.zeros(200)], axis=1) + 1.0 * rng.standard_normal((200, 3))
    params = CleanParams(method="radius", radius=2.0)
    assert density_filter(line, spacing=1.0, noise=1.0, params=params).mean() > 0.9
    assert density_filter(line, spacing=1.0, noise=0.0, params=params).mean() < 0.8


@given(st.integers(0, 2**32 - 1))
def test_cleaning_commutes_with_motion_and_order(seed):
    rng = np.random.default_rng(seed)
    points, _ = scene()
    order = rng.permutation(len(points))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = clean_boundary((points[order] @ turn + 3.0) * 1e-3, spacing=1e-3)
    np.testing.assert_array_equal(moved.keep, clean_boundary(points, spacing=1.0).keep[order])


@given(st.integers(0, 2**32 - 1))
def test_groups_equal_connected_components(seed):
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 30.0, (80, 3))
    params = CleanParams(group_gap=4.0, group_extent=12.0, group_share=1.0)
    pairs = KDTree(points).query_pairs(4.0, output_type="ndarray")
    _, group = connected_components(coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(80, 80)), directed=False)
    large = np.zeros(80, bool)
    for g in np.unique(group):
        mine = group == g
        large[mine] = 2.0 * np.linalg.norm(points[mine] - points[mine].mean(axis=0), axis=1).max() >= 12.0 or mine.all()
    np.testing.assert_array_equal(in_large_group(points, spacing=1.0, params=params), large)


def test_near_curves():
    points = np.array([[0.0, 0, 0], [5.0, 2.9, 0], [5.0, 3.1, 0]])
    line = np.stack([np.arange(0.0, 10.5, 0.5), np.zeros(21), np.zeros(21)], axis=1)
    assert near_curves(points, [line], 3.0).tolist() == [True, True, False]
    assert not near_curves(points, [], 3.0).any()


def test_nothing_in_nothing_out():
    none = np.empty((0, 3))
    assert clean_boundary(none, spacing=1.0).counts == {"given": 0, "sparse": 0, "isolated": 0, "kept": 0}
    assert approximate_boundary(none, 1.0).shape == (0, 3)
    assert thin_boundary(none, wedge(90.0, 0.0), spacing=1.0).points.shape == (0, 3)
    one = np.zeros((1, 3))
    assert thin_boundary(one, wedge(90.0, 0.0), spacing=1.0).points.shape[1] == 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CleanParams(method="nearest"), "'method' parameter of clean_boundary must be one of statistical, radius. Got 'nearest'"),
        (lambda: CleanParams(neighbours=0), r"'neighbours' parameter of clean_boundary must be an int in \[1, inf\). Got 0"),
        (lambda: CleanParams(group_share=1.5), r"'group_share' parameter of clean_boundary must be a float in \[0, 1\]. Got 1.5"),
        (lambda: CleanParams(radius=float("nan")), "'radius'"),
        (lambda: ThinParams(radius=-1.0), r"'radius' parameter of thin_boundary must be a float in \(0, inf\). Got -1.0"),
        (lambda: ThinParams(rounds=0), "'rounds'"),
        (lambda: ThinParams(min_angle=180.0), "'min_angle'"),
        (lambda: approximate_boundary(np.zeros((3, 3)), 0.0), "'radius' parameter of approximate_boundary"),
        (lambda: approximate_boundary(np.zeros((3, 3)), 1.0, times=0), "'times'"),
        (lambda: clean_boundary(np.zeros((3, 3)), spacing=0.0), "'spacing'"),
        (lambda: thin_boundary(np.zeros((3, 3)), np.zeros((3, 3)), spacing=1.0, noise=-1.0), "'noise'"),
    ],
)
def test_parameter_errors(make, message):
    with pytest.raises(ParameterError, match=message):
        make()
