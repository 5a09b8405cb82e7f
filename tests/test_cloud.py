"""What becomes of the rows of an input, and what a cloud tells of itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scan2nurbs as s2n
from scan2nurbs.cloud import as_cloud
from scan2nurbs.errors import InputError, ParameterError
from scan2nurbs.scale import measure_scale


def sheet(n: int, noise: float = 0.0, seed: int = 0, grid: bool = False) -> np.ndarray:
    """A curved sheet whose points lie about 1 apart, with noise across it."""
    rng = np.random.default_rng(seed)
    side = np.sqrt(n)
    if grid:
        x, y = np.meshgrid(np.arange(int(side)), np.arange(int(side)))
        xy = np.c_[x.ravel(), y.ravel()] + rng.uniform(-0.25, 0.25, (int(side) ** 2, 2))
    else:
        xy = rng.random((n, 2)) * side
    z = 3.0 * np.sin(xy[:, 0] / 15.0) * np.cos(xy[:, 1] / 20.0)
    return np.c_[xy, z + noise * rng.normal(size=len(xy))]


@given(st.lists(st.tuples(*[st.sampled_from([0.0, -0.0, 1.0, 2.5, np.nan, np.inf])] * 3), min_size=1, max_size=60))
def test_every_row_finds_its_point_again(rows):
    rows = np.array(rows)
    finite = np.isfinite(rows).all(axis=1)
    distinct = {tuple(row + 0.0) for row in rows[finite]}
    if len(distinct) < 3:
        with pytest.raises(InputError, match="at least 3"):
            as_cloud(rows)
        return
    cloud = as_cloud(rows)
    assert len(cloud.points) == len(distinct)
    assert cloud.n_invalid == np.count_nonzero(~finite)
    assert cloud.n_duplicates == np.count_nonzero(finite) - len(distinct)
    np.testing.assert_array_equal(cloud.to_rows(cloud.points + cloud.origin, np.nan)[finite], rows[finite])
    assert np.array_equal(cloud.rows < 0, ~finite)


def test_far_coordinates_move_to_a_local_origin():
    points = np.random.default_rng(0).random((100, 3)) + np.array([4e6, 5e6, 100.0])
    cloud = as_cloud(points)
    assert np.abs(cloud.points).max() <= 0.5
    np.testing.assert_array_equal(cloud.points + cloud.origin, points)


def test_near_coordinates_stay_as_they_are():
    points = np.random.default_rng(0).random((100, 3))
    np.testing.assert_array_equal(as_cloud(points).points, points)


def test_whatever_has_points_is_taken():
    class Mesh:
        points = np.eye(3).tolist()

    cloud = as_cloud(Mesh(), unit="m")
    assert cloud.unit == "m"
    assert as_cloud(cloud) is cloud
    assert as_cloud(cloud, "in").unit == "in"
    with pytest.raises(ParameterError, match="unit"):
        as_cloud(Mesh(), unit="furlong")


@pytest.mark.parametrize("size", [1e101, 1e-120])
def test_extents_that_cannot_be_computed_with_are_refused(size):
    with pytest.raises(InputError, match=r"extent|large"):
        as_cloud(np.random.default_rng(0).random((10, 3)) * size)


def test_the_same_points_have_the_same_hash():
    points = np.random.default_rng(0).random((10, 3))
    assert as_cloud(points).sha256 == as_cloud(points.tolist()).sha256 != as_cloud(points[::-1]).sha256


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.25, 0.5, 0.9])
@pytest.mark.parametrize("grid", [False, True])
def test_spacing_and_noise_are_recovered(noise, grid):
    scale = measure_scale(sheet(20_000, noise, grid=grid))
    assert scale.h == pytest.approx(1.0, abs=0.1 if noise <= 0.5 else 0.25)
    assert scale.noise == pytest.approx(noise, rel=0.1, abs=0.01)


def test_an_edge_is_not_taken_for_noise():
    points = sheet(20_000, 0.1)
    points[:, 2] = np.abs(points[:, 0] % 20.0 - 10.0) + 0.1 * np.random.default_rng(1).normal(size=len(points))
    assert measure_scale(points).noise == pytest.approx(0.1, rel=0.35)


def test_local_spacing_follows_the_density():
    points = sheet(40_000)
    dense = points[:, 0] < 100
    thinned = points[dense | (np.random.default_rng(1).random(len(points)) < 1 / 6)]
    scale = measure_scale(thinned)
    ratio = np.median(scale.local_h[thinned[:, 0] > 110]) / np.median(scale.local_h[thinned[:, 0] < 90])
    assert ratio == pytest.approx(np.sqrt(6), rel=0.1)


def test_a_far_outlier_changes_little():
    points = sheet(5000, 0.1)
    scale, disturbed = measure_scale(points), measure_scale(np.r_[points, [[1e5, 1e5, 1e5]]])
    assert disturbed.h == pytest.approx(scale.h, rel=1e-3)
    assert disturbed.noise == pytest.approx(scale.noise, rel=0.05)


def test_measure_speaks_of_the_cloud():
    measured = s2n.measure(sheet(1000), unit="cm")
    assert measured.cloud.unit == "cm"
    assert measured.scale.spacing < measured.scale.h


def test_masked_rows_are_no_points():
    points = np.random.default_rng(0).normal(size=(50, 3))
    masked = np.ma.masked_array(points, np.zeros(points.shape, bool))
    masked[::10, 1] = np.ma.masked
    cloud = as_cloud(masked)
    np.testing.assert_array_equal(cloud.rows[::10], -1)
    assert len(cloud.points) == 45
    whole = np.ma.masked_array(np.arange(30).reshape(10, 3) ** 2, False)
    assert len(as_cloud(whole).points) == 10


def test_complex_numbers_are_refused():
    with pytest.raises(InputError, match="real numbers"):
        as_cloud(np.ones((10, 3)) * 1j)
