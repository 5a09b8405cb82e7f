"""DN, VDN, EDN and one-sided normals: as the paper defines them, and on creases of known place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

import scan2nurbs as s2n
from scan2nurbs.edges.normals import UNDEFINED, normals_at
from scan2nurbs.edges.operators import edn
from scan2nurbs.errors import InputError, ParameterError
from scan2nurbs.kernels.cells import build_cells


def roof(n: int = 4000, turn: float = 60.0, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Two planes that meet at x = 0 under an angle, one point a unit of area; the crease runs along y."""
    rng = np.random.default_rng(seed)
    xy = (rng.random((n, 2)) - 0.5) * np.sqrt(n)
    half = np.radians(turn) / 2
    points = np.c_[xy[:, 0] * np.cos(half), xy[:, 1], -np.abs(xy[:, 0]) * np.sin(half)]
    return points + noise * rng.normal(size=points.shape)


def normal_twin(points: np.ndarray, i: int, radius: float) -> np.ndarray:
    members = points[KDTree(points).query_ball_point(points[i], radius)]
    return np.linalg.svd(members - members.mean(axis=0))[2][2]


def test_dn_is_the_angle_between_the_normals_at_two_radii():
    points = roof(noise=0.05)
    edges = s2n.detect_edges(points, s2n.EdgeParams(operator="dn", small_radius=3, large_radius=9))
    assert edges.spacing == pytest.approx(KDTree(points).query(points, 2)[0][:, 1].mean(), rel=1e-12)
    for i in range(0, len(points), 211):
        a, b = normal_twin(points, i, 3 * edges.spacing), normal_twin(points, i, 9 * edges.spacing)
        expected = np.degrees(np.arccos(min(1.0, abs(a @ b))))
        if np.count_nonzero(np.linalg.norm(points - points[i], axis=1) < 3 * edges.spacing) > 4:
            assert edges.dn[i] == pytest.approx(expected, abs=0.05)
    assert np.array_equal(edges.strength, edges.dn)
    assert edges.threshold == 20.0


def test_edn_weighs_dn_and_the_larger_vdn():
    points = roof(noise=0.05)
    params = {"small_radius": 4, "large_radius": 10}
    whole = s2n.detect_edges(points, s2n.EdgeParams(operator="edn", alpha=0.3, **params))
    dn = s2n.detect_edges(points, s2n.EdgeParams(operator="dn", **params))
    vdn = s2n.detect_edges(points, s2n.EdgeParams(operator="vdn", **params))
    np.testing.assert_array_equal(whole.dn, dn.strength)
    np.testing.assert_array_equal(whole.vdn_large, vdn.strength)
    np.testing.assert_allclose(whole.strength, 0.3 * whole.dn + 0.7 * np.fmax(whole.vdn_small, whole.vdn_large))
    only_dn = s2n.detect_edges(points, s2n.EdgeParams(operator="edn", alpha=1.0, **params))
    np.testing.assert_array_equal(only_dn.strength, dn.strength)


def test_an_undefined_vdn_takes_no_part():
    nan = np.nan
    dn, small, large = np.array([10.0, 10, nan, 10]), np.array([nan, 30, 20, nan]), np.array([40.0, nan, 20, nan])
    np.testing.assert_array_equal(edn(dn, small, large, 0.5), [25.0, 20.0, nan, nan])
    np.testing.assert_array_equal(edn(dn, small, large, 1.0), [10.0, 10.0, nan, 10.0])
    np.testing.assert_array_equal(edn(dn, small, large, 0.0), [40.0, 30.0, 20.0, nan])


def test_a_run_sees_only_what_the_previous_one_kept():
    points = roof(noise=0.1)
    once = s2n.detect_edges(points, s2n.EdgeParams(operator="vdn", large_radius=8))
    twice = s2n.detect_edges(points, s2n.EdgeParams(operator="vdn", large_radius=8, repeat=2))
    kept = points[once.mask]
    # The second run alone, with the first run's radius in absolute terms.
    second = s2n.detect_edges(kept, s2n.EdgeParams(operator="vdn", small_radius=0.1, large_radius=8 * once.spacing, absolute=True))
    expected = np.zeros(len(points), bool)
    expected[np.flatnonzero(once.mask)[second.mask]] = True
    assert np.array_equal(twice.mask, expected)
    assert 0 < twice.mask.sum() < once.mask.sum()
    assert twice.runs == (("vdn", once.mask.sum()), ("vdn", twice.mask.sum()))
    sequence = s2n.detect_edges(points, s2n.EdgeParams(sequence="vdn*2", large_radius=8))
    assert np.array_equal(sequence.mask, twice.mask)
    mixed = s2n.detect_edges(points, s2n.EdgeParams(sequence="vdn*3, dn", small_radius=3, large_radius=8))
    assert [name for name, _ in mixed.runs] == ["vdn", "vdn", "vdn", "dn"]
    assert np.all(mixed.mask <= twice.mask)


def test_degenerate_neighbourhoods_are_widened_then_given_up_and_counted():
    points = np.r_[roof(2000), [[500.0, 0, 0], [500.0, 0, 1.0]]]
    edges = s2n.detect_edges(points, s2n.EdgeParams(operator="dn", small_radius=1.5, large_radius=10))
    assert edges.counts["small_normals_undefined"] == 2
    assert edges.counts["large_normals_undefined"] == 2
    assert edges.counts["small_normals_widened"] > 500
    assert np.isnan(edges.strength[-2:]).all()
    assert not edges.mask[-2:].any()
    assert np.isfinite(edges.strength[:-2]).all()
    # A widened normal is that of the first wider ball that carries a plane.
    cells = build_cells(points, 5.0)
    normals = normals_at(cells, 0.75)
    for i in np.flatnonzero((normals.status > 0) & (normals.status < UNDEFINED))[::97]:
        wide = 0.75 * np.sqrt(2.0) ** normals.status[i]
        expected = normal_twin(cells.points, i, wide)
        assert np.linalg.norm(np.cross(expected, normals.normal[i])) < 1e-3


@pytest.mark.parametrize(("turn", "noise"), [(90.0, 0.0), (90.0, 0.5), (40.0, 0.25)])
def test_the_default_finds_a_crease_under_noise(turn, noise):
    points = roof(12_000, turn, noise)
    edges = s2n.detect_edges(points)
    distance = np.abs(roof(12_000, turn, 0.0)[:, 0]) / np.cos(np.radians(turn / 2))
    # The border of the scan is an edge, too.
    inner = (np.abs(roof(12_000, turn, 0.0)[:, 1]) < 48) & (distance < 48)
    # Marked is what lies there now, wherever noise took it from.
    now = np.hypot(points[:, 0], points[:, 2])
    assert edges.mask[(now < 0.4) & inner].mean() > (0.9 if noise == 0 else 0.7)
    assert edges.mask[(distance > 2.5 + 2 * noise) & inner].mean() < 0.01
    assert edges.mask[(distance > 4.0) & inner].mean() < 0.01
    assert edges.noise == pytest.approx(noise, abs=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_a_ridge_bends_and_does_not_break(noise):
    rng = np.random.default_rng(7)
    along, around = rng.random(12_000) * 100.0, (rng.random(12_000) - 0.5) * 120.0
    radius = 8.0
    turn = np.clip(around / radius, -np.pi / 4, np.pi / 4)
    flat = around - turn * radius
    points = np.c_[along, radius * np.sin(turn) + flat * np.cos(turn), radius * (np.cos(turn) - 1) - flat * np.sin(turn)]
    points += noise * rng.normal(size=points.shape)
    inner = (np.abs(along - 50) < 45) & (np.abs(around) < 55)
    assert s2n.detect_edges(points).mask[inner].mean() < 0.01
    # Its first pass alone marks what bends sharply, too.
    assert s2n.detect_edges(points, s2n.EdgeParams(operator="one-sided", threshold=12.0)).mask[inner].mean() > 0.05


def test_the_default_leaves_a_sphere_alone():
    normal = np.random.default_rng(2).normal(size=(15_000, 3))
    points = normal / np.linalg.norm(normal, axis=1, keepdims=True) * np.sqrt(15_000 / (4 * np.pi))
    assert s2n.detect_edges(points).mask.mean() < 0.001
    noisy = points + 0.25 * np.random.default_rng(3).normal(size=points.shape)
    assert s2n.detect_edges(noisy).mask.mean() < 0.01


@pytest.mark.parametrize("operator", ["crease", "one-sided", "dn", "vdn", "edn"])
@given(seed=st.integers(0, 1000), scale=st.sampled_from([1e-7, 1.0, 25.4, 1e6]))
def test_motion_scale_and_order_change_nothing(operator, seed, scale):
    rng = np.random.default_rng(seed)
    points = roof(700, 70.0, 0.2, seed=seed)
    params = s2n.EdgeParams(operator=operator, small_radius=4, large_radius=9)
    edges = s2n.detect_edges(points, params)
    order = rng.permutation(len(points))
    moved = scale * Rotation.random(rng=rng).apply(points)[order] + scale * rng.normal(size=3) * 20
    again = s2n.detect_edges(moved, params)
    assert again.h == pytest.approx(scale * edges.h, rel=1e-7)
    assert again.noise == pytest.approx(scale * edges.noise, rel=0.15, abs=0.02 * scale)
    # Which points lie at the end of the scan is counted in sectors, whose first direction turns with the axes; 90 marks those points.
    inner = (again.strength < 90.0) & (edges.strength[order] < 90.0) if operator == "crease" else np.ones(len(points), bool)
    assert inner.mean() > 0.6
    difference = np.abs(again.strength - edges.strength[order])[inner]
    # Rounding moves single points over the sphere or a dividing plane; the choice of a ball may flip where two are equally flat.
    assert np.nanquantile(difference, 0.9) < 0.2
    assert np.mean((again.mask != edges.mask[order])[inner]) < 0.03


def test_rows_that_are_no_point_keep_their_place():
    points = roof(3000, 90.0)
    holed = np.insert(points, [0, 100, 3000], np.nan, axis=0)
    holed[1, 1] = np.inf
    edges, whole = s2n.detect_edges(holed), s2n.detect_edges(points[1:])
    invalid = ~np.isfinite(holed).all(axis=1)
    assert len(edges.strength) == len(holed)
    assert np.isnan(edges.strength[invalid]).all()
    assert not edges.mask[invalid].any()
    np.testing.assert_array_equal(edges.strength[~invalid], whole.strength)


def test_duplicates_get_their_point_s_answer():
    points = roof(1500)
    edges = s2n.detect_edges(np.r_[points, points[:200]])
    single = s2n.detect_edges(points)
    np.testing.assert_array_equal(edges.strength, np.r_[single.strength, single.strength[:200]])


def test_far_coordinates_lose_nothing():
    points = np.round(roof(2000, 80.0, 0.1) * 1024) / 1024
    near, far = s2n.detect_edges(points), s2n.detect_edges(points + np.array([4.0e6, 5.0e6, 1.0e6]))
    np.testing.assert_allclose(near.strength, far.strength, atol=1e-3)


@pytest.mark.parametrize("points", [np.eye(3), np.c_[np.arange(40.0), np.zeros((40, 2))], np.ones((50, 3)) * np.arange(50)[:, None]])
def test_tiny_and_collinear_clouds_have_no_edges(points):
    for operator in ("auto", "one-sided", "dn", "vdn", "edn"):
        edges = s2n.detect_edges(points, s2n.EdgeParams(operator=operator))
        assert not edges.mask.any()


@pytest.mark.parametrize(
    "points", [np.ones((10, 3)), np.zeros((0, 3)), np.full((5, 3), np.nan), np.eye(2), "no such file.ply", [["a", 1, 2]]]
)
def test_what_is_no_cloud_is_refused(points):
    with pytest.raises(InputError):
        s2n.detect_edges(points)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"operator": "sobel"}, "operator"),
        ({"small_radius": 10.0, "large_radius": 10.0}, "smaller"),
        ({"small_radius": -1.0}, r"'small_radius' parameter of detect_edges must be a float in \(0, inf\). Got -1.0 instead."),
        ({"large_radius": float("nan")}, "large_radius"),
        ({"alpha": 1.5}, "alpha"),
        ({"alpha": 0.4, "beta": 0.5}, "alpha \\+ beta"),
        ({"threshold": 91.0}, "threshold"),
        ({"sectors": 1}, "sectors"),
        ({"sectors": 4.0}, "an int"),
        ({"repeat": 0}, "repeat"),
        ({"sequence": "vdn*3; dn"}, "sequence"),
        ({"sequence": "vdn*0"}, "sequence"),
        ({"sequence": "auto, dn"}, "sequence"),
    ],
)
def test_parameters_out_of_range_are_refused(params, message):
    with pytest.raises(ParameterError, match=message):
        s2n.EdgeParams(**params)
