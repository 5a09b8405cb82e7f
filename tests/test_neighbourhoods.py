"""The cell index and the kernels on it, each against a plain NumPy or SciPy twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.differences import normal_differences, normals_differ
from scan2nurbs.kernels.distinct import distinct_rows
from scan2nurbs.kernels.graph import basins
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.kernels.nearest import nearest_distance, nearest_indices, nearest_kth, nearest_neighbours, nearest_to
from scan2nurbs.kernels.one_sided import one_sided_planes
from scan2nurbs.kernels.runner import set_threads
from scan2nurbs.kernels.sorting import radix_argsort
from scan2nurbs.kernels.symmetric3 import line_angles
from scan2nurbs.kernels.within import within_reach


def wavy(n: int, seed: int = 0, noise: float = 0.02) -> np.ndarray:
    """Points on a bent sheet, a unit apart on average."""
    rng = np.random.default_rng(seed)
    xy = rng.random((n, 2)) * np.sqrt(n)
    z = 2.0 * np.sin(xy[:, 0] / 7.0) + 1.5 * np.cos(xy[:, 1] / 5.0) + noise * rng.normal(size=n)
    return np.c_[xy, z]


clouds = st.builds(
    lambda n, seed, scale, shape: scale * (wavy(n, seed) if shape else np.random.default_rng(seed).normal(size=(n, 3))),
    st.integers(3, 400),
    st.integers(0, 10_000),
    st.sampled_from([1e-6, 1.0, 3e5]),
    st.booleans(),
)


def plane_twin(points: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """The normal by singular values; None where the points carry no plane by the rule of the kernel."""
    centred = points - points.mean(axis=0)
    _, values, axes = np.linalg.svd(centred, full_matrices=True)
    values = np.r_[values, np.zeros(3 - len(values))] ** 2
    if len(points) < 3 or values[1] <= 1e-3 * values[0] or values[0] == 0:
        return None, values
    return axes[2], values


@given(clouds, st.floats(0.3, 30.0))
def test_cells_hold_every_point_once_and_in_its_cube(points, factor):
    cells = build_cells(points, factor * np.ptp(points, axis=0).max() / np.sqrt(len(points)))
    assert np.array_equal(np.sort(cells.order), np.arange(len(points)))
    assert np.array_equal(cells.points, points[cells.order])
    assert np.all(np.diff(cells.cell_key) > 0)
    assert np.all(np.diff(cells.row_key) > 0)
    assert cells.cell_start[-1] == len(points)
    keys = np.repeat(cells.cell_key, np.diff(cells.cell_start))
    cube = np.stack([keys % cells.shape[0], keys // cells.shape[0] % cells.shape[1], keys // (cells.shape[0] * cells.shape[1])], axis=1)
    place = (cells.points - cells.low) / cells.size
    assert np.all(place >= cube - 1e-9)
    assert np.all(place <= cube + 1 + 1e-9)


@given(clouds, st.integers(1, 15))
def test_nearest_neighbours_equal_a_tree_s(points, k):
    cells = build_cells(points, 2.0 * np.ptp(points, axis=0).max() / np.sqrt(len(points)))
    index, distance = nearest_neighbours(cells, k)
    expected = np.full((len(points), k), np.inf)
    found = min(k, len(points) - 1)
    expected[:, :found] = KDTree(cells.points).query(cells.points, found + 1)[0][:, 1:]
    np.testing.assert_allclose(distance, expected, rtol=1e-9)
    there = index >= 0
    assert np.array_equal(there, np.isfinite(expected))
    own = np.repeat(np.arange(len(points))[:, None], k, axis=1)
    assert not np.any(index[there] == own[there])
    np.testing.assert_allclose(np.linalg.norm(cells.points[index] - cells.points[:, None], axis=2)[there], distance[there], rtol=1e-9)
    for reach in (None, 1e-3 * cells.size, 10.0 * cells.size):
        assert np.array_equal(nearest_indices(cells, k, reach=reach), index)
        assert np.array_equal(nearest_kth(cells, k, reach=reach), distance[:, -1])


@given(clouds, st.integers(0, 2**32 - 1), st.floats(0.0, 4.0))
def test_points_near_some_equal_a_tree_s(points, seed, factor):
    reach = factor * np.ptp(points, axis=0).max() / np.sqrt(len(points))
    cells = build_cells(points, 2.0 * np.ptp(points, axis=0).max() / np.sqrt(len(points)))
    rng = np.random.default_rng(seed)
    mask = rng.random(len(points)) < rng.choice([0.0, 0.05, 1.0])
    expected = mask.copy()
    if mask.any():
        expected |= np.linalg.norm(cells.points[:, None] - cells.points[mask], axis=2).min(axis=1) < reach
    assert np.array_equal(within_reach(cells, mask, reach), expected)


def test_nearest_to_finds_far_places_and_outliers():
    points = np.r_[wavy(3000), [[1e4, -2e4, 5.0]]]
    cells = build_cells(points, 5.0)
    queries = np.array([[10.0, 10.0, 0.0], [-500.0, 3.0, 9.0], [1e4, 0.0, 0.0]])
    _, distance = nearest_to(cells, queries, 7)
    np.testing.assert_allclose(distance, KDTree(points).query(queries, 7)[0], rtol=1e-12)


@given(clouds, st.floats(0.5, 6.0))
def test_ball_planes_equal_singular_vectors(points, factor):
    radius = factor * np.ptp(points, axis=0).max() / np.sqrt(len(points))
    cells = build_cells(points, 1.7 * radius)
    planes = ball_planes(cells, radius)
    tree = KDTree(cells.points)
    for i in range(0, len(points), 7):
        distance = np.linalg.norm(cells.points - cells.points[i], axis=1)
        if np.any(np.abs(distance - radius) < 1e-5 * radius):
            continue  # float32 may see such a point on the other side of the sphere
        members = cells.points[tree.query_ball_point(cells.points[i], radius)]
        assert planes.n_points[i] == len(members)
        normal, values = plane_twin(members)
        if abs(values[1] - 1e-3 * values[0]) < 1e-4 * values[0] or values[1] - values[2] < 1e-3 * values[0]:
            continue  # the rule's edge; or no plane is better than another
        if normal is None:
            assert np.isnan(planes.variance[i])
        else:
            sine = np.linalg.norm(np.cross(normal, planes.normal[i]))
            assert sine < 1e-4 * values[0] / (values[1] - values[2])
            np.testing.assert_allclose(planes.mean[i], members.mean(axis=0) - cells.points[i], atol=1e-5 * radius)
            assert abs(planes.variance[i] - values[2] / len(members)) < 1e-5 * radius**2


def test_clusters_stand_for_the_points_of_large_balls():
    points = wavy(40_000, noise=0.1)
    cells = build_cells(points, 5.0)
    todo = np.arange(len(points)) % 50 == 0
    exact = ball_planes(cells, 40.0, sectors=4, exact=True, todo=todo)
    clustered = ball_planes(cells, 40.0, sectors=4, todo=todo)
    assert not np.array_equal(exact.normal[todo], clustered.normal[todo])
    tilt = line_angles(exact.normal[todo], clustered.normal[todo])
    assert np.quantile(tilt, 0.99) < 0.5
    assert np.median(np.abs(exact.sector_angle - clustered.sector_angle)[todo]) < 1.5
    np.testing.assert_allclose(clustered.n_points[todo], exact.n_points[todo], rtol=0.03)


def test_clusters_of_a_point_or_two_are_taken_where_they_are():
    points = wavy(40_000, noise=0.1)
    kept = (points[:, 0] < np.median(points[:, 0])) | (np.arange(len(points)) % 40 == 0)
    cells = build_cells(points[kept], 5.0)
    todo = np.arange(len(cells.points)) % 25 == 0
    exact = ball_planes(cells, 40.0, exact=True, todo=todo)
    clustered = ball_planes(cells, 40.0, todo=todo)
    assert not np.array_equal(exact.normal[todo], clustered.normal[todo])
    assert np.max(line_angles(exact.normal[todo], clustered.normal[todo])) < 1.0


def test_clusters_stand_for_the_points_of_sectors():
    points = wavy(20_000, noise=0.05) * [1.0, 1.0, 0.1]
    cells = build_cells(points, 5.0)
    todo = np.arange(len(points)) % 50 == 0
    exact = ball_planes(cells, 15.0, sectors=4, exact=True, todo=todo)
    clustered = ball_planes(cells, 15.0, sectors=4, todo=todo)
    assert np.array_equal(exact.normal[todo], clustered.normal[todo])
    assert not np.array_equal(exact.sector_angle[todo], clustered.sector_angle[todo])
    difference = np.abs(exact.sector_angle - clustered.sector_angle)[todo]
    assert np.median(difference) < 0.3
    assert np.quantile(difference, 0.99) < 3.0


@given(st.integers(1, 300), st.sampled_from([1, 7, 3000, 1 << 40]), st.integers(0, 10_000))
def test_radix_argsort_is_the_stable_order(n, bound, seed):
    keys = np.random.default_rng(seed).integers(0, bound, n)
    order, ordered = radix_argsort(keys, bound)
    assert np.array_equal(order, np.argsort(keys, kind="stable"))
    assert np.array_equal(ordered, np.sort(keys))


def sector_angle_twin(points: np.ndarray, i: int, radius: float, sectors: int, sign: float = 1.0) -> float:
    """Algorithm 1 and eq. 2.3, as they read, for one point."""
    relative = points - points[i]
    members = relative[np.linalg.norm(relative, axis=1) < radius]
    centred = members - members.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=True)[2]
    n1, n0 = sign * axes[0], axes[2]
    angle = np.arctan2(members @ np.cross(n0, n1), members @ n1) % (2 * np.pi)
    at_point = np.linalg.norm(members, axis=1) == 0
    normals = []
    for s in range(sectors):
        sector = (angle > 2 * np.pi * s / sectors) & (angle < 2 * np.pi * (s + 1) / sectors) & ~at_point
        normal, _ = plane_twin(np.r_[members[sector], np.zeros((1, 3))])
        if normal is not None:
            normals.append(normal)
    if len(normals) < 2:
        return np.nan
    return max(np.degrees(np.arccos(min(1.0, abs(a @ b)))) for k, a in enumerate(normals) for b in normals[:k])


@pytest.mark.parametrize("sectors", [2, 3, 4, 7])
def test_sector_angles_are_algorithm_1(sectors):
    points = wavy(1500, seed=3, noise=0.1)
    cells = build_cells(points, 5.0)
    planes = ball_planes(cells, 4.0, sectors=sectors)
    for i in range(0, 1500, 11):
        # The principal direction is a line: half a turn swaps sectors, which matters where their number is odd.
        expected = [sector_angle_twin(cells.points, i, 4.0, sectors, sign) for sign in (1.0, -1.0)]
        assert any(planes.sector_angle[i] == pytest.approx(angle, abs=0.02, nan_ok=True) for angle in expected)


def test_a_sector_without_a_plane_takes_no_part():
    # Five points: no sector but one holds two others, so there are no two planes to compare.
    points = np.array([[0.0, 0, 0], [1, 0.2, 0], [0.9, 0.5, 0.3], [-1, -0.3, 0], [0.4, -1, 0.1]])
    planes = ball_planes(build_cells(points, 3.0), 3.0, sectors=4)
    assert np.isnan(planes.sector_angle).all()
    assert np.isfinite(planes.variance).all()


def test_degenerate_balls_have_no_plane():
    line = np.c_[np.arange(50.0), np.zeros(50), np.zeros(50)]
    assert np.isnan(ball_planes(build_cells(line, 4.0), 5.0).normal).all()
    pair = np.array([[0.0, 0, 0], [0.5, 0, 0], [100.0, 0, 0]])
    planes = ball_planes(build_cells(pair, 4.0), 1.0)
    assert np.isnan(planes.normal).all()
    assert sorted(planes.n_points) == [1, 2, 2]


def test_only_what_is_asked_for_is_computed():
    cells = build_cells(wavy(500), 5.0)
    todo = np.arange(500) % 3 == 0
    part, whole = ball_planes(cells, 3.0, todo=todo), ball_planes(cells, 3.0)
    assert np.array_equal(part.normal[todo], whole.normal[todo])
    assert np.isnan(part.normal[~todo]).all()


def test_results_stand_in_the_order_of_the_input_where_that_is_asked_for():
    points = wavy(3000, noise=0.1)
    points[::97] += 1e3 * np.arange(31)[:, None]  # far from all others: balls without planes
    cells = build_cells(points, 5.0)
    todo = np.random.default_rng(0).random(3000) < 0.8
    for radius, widenings in ((0.6, 4), (4.0, 0)):
        by_cells = ball_planes(cells, radius, sectors=4, widenings=widenings, todo=todo)
        by_rows = ball_planes(cells, radius, sectors=4, widenings=widenings, todo=todo, input_order=True)
        for sorted_, rows in zip(by_cells, by_rows, strict=True):
            assert np.array_equal(rows[cells.order], sorted_, equal_nan=True)


def test_results_do_not_depend_on_the_number_of_threads():
    points = wavy(30_000)

    def everything():
        cells = build_cells(points, 5.0)
        planes = ball_planes(cells, 4.0, sectors=4)
        chosen = one_sided_planes(cells, planes, 4.0, 0.02)
        index, distance = nearest_neighbours(cells, 12)
        return (
            *planes,
            *ball_planes(cells, 40.0, sectors=4),
            chosen,
            normal_differences(cells, planes.normal[chosen], 2.0, 0.9),
            normals_differ(cells, planes.normal[chosen], 2.0, 0.9, 10.0),
            index,
            distance,
        )

    results = []
    for threads in (1, 2, 8):
        set_threads(threads)
        results.append([array.tobytes() for array in everything()])
    set_threads(None)
    assert results[0] == results[1] == results[2]


@given(clouds, st.floats(1.0, 4.0), st.sampled_from([0.0, 0.05, 0.5]))
def test_one_sided_planes_take_the_flattest_ball_that_fits(points, factor, noise):
    radius = factor * np.ptp(points, axis=0).max() / np.sqrt(len(points))
    noise *= radius
    cells = build_cells(points, 1.5 * radius)
    balls = ball_planes(cells, radius)
    chosen = one_sided_planes(cells, balls, radius, noise)
    for i in range(0, len(points), 7):
        distance = np.linalg.norm(cells.points - cells.points[i], axis=1)
        near = np.flatnonzero((distance < radius) & np.isfinite(balls.variance))
        if len(near) == 0 or np.any(np.abs(distance - radius) < 1e-5 * radius):
            continue
        height = np.einsum("ij,ij->i", balls.normal[near], cells.points[i] - cells.points[near] - balls.mean[near])
        cost = balls.variance[near] + np.maximum(height**2 - (2 * noise) ** 2, 0.0)
        assert chosen[i] in near
        assert cost[near == chosen[i]][0] <= cost.min() + 1e-5 * radius**2


def test_one_sided_planes_do_not_blur_across_an_edge():
    rng = np.random.default_rng(5)
    xy = rng.random((8000, 2)) * [100.0, 80.0]
    points = np.c_[np.where(xy[:, :1] < 50, xy[:, :1], 50.0), xy[:, 1:], np.where(xy[:, :1] < 50, 0.0, 50.0 - xy[:, :1])]
    points += rng.normal(size=points.shape) * 0.1
    cells = build_cells(points, 5.0)
    planes = ball_planes(cells, 4.0)
    normal = planes.normal[one_sided_planes(cells, planes, 4.0, 0.1)]
    top = (cells.points[:, 0] < 49.5) & (cells.points[:, 2] > -0.5)
    tilt = np.degrees(np.arccos(np.minimum(1.0, np.abs(normal[top, 2]))))
    blurred = np.degrees(np.arccos(np.minimum(1.0, np.abs(planes.normal[top, 2]))))
    assert np.quantile(tilt, 0.995) < 10.0
    assert blurred.max() > 25.0


@given(clouds, st.floats(0.5, 4.0), st.sampled_from([0.5, 0.9, 1.0]))
def test_normal_differences_equal_a_quantile(points, factor, quantile):
    radius = factor * np.ptp(points, axis=0).max() / np.sqrt(len(points))
    cells = build_cells(points, 2.0 * radius)
    normals = np.random.default_rng(1).normal(size=(len(points), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[::5] = np.nan
    got = normal_differences(cells, normals, radius, quantile)
    for i in range(0, len(points), 9):
        squared = ((cells.points - cells.points[i]) ** 2).sum(axis=1)
        near = (squared < radius * radius) & (np.arange(len(points)) != i)
        angles = np.degrees(np.arccos(np.minimum(1.0, np.abs(normals[near] @ normals[i]))))
        angles = np.sort(angles[np.isfinite(angles)])
        if len(angles) == 0:
            assert np.isnan(got[i])
        else:
            assert got[i] == pytest.approx(angles[int(np.ceil(quantile * len(angles))) - 1], abs=1e-6)


@given(clouds, st.floats(0.5, 4.0), st.sampled_from([0.5, 0.9, 1.0]), st.floats(5.0, 85.0))
def test_normals_differ_where_their_differences_exceed_the_angle(points, factor, quantile, angle):
    radius = factor * np.ptp(points, axis=0).max() / np.sqrt(len(points))
    cells = build_cells(points, 2.0 * radius)
    normals = np.random.default_rng(1).normal(size=(len(points), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[::5] = np.nan
    # Distances are compared in float32: leave out points with a neighbour just at the radius.
    distance = np.linalg.norm(cells.points[:, None] - cells.points, axis=2)
    clear = np.all(np.abs(distance - radius) > 1e-4 * radius, axis=1)
    wanted = normal_differences(cells, normals, radius, quantile)
    clear &= ~(np.abs(wanted - angle) < 1e-2)
    got = normals_differ(cells, normals, radius, quantile, angle)
    assert np.array_equal(got[clear], np.where(np.isnan(wanted), -1, wanted > angle)[clear])


def test_basins_are_parted_by_deep_saddles_only():
    height = np.array([1.0, 5.0, 3.0, 3.5, 3.2, 0.5, 4.0, 0.2])
    n = len(height)
    neighbours = np.array([[i - 1, i + 1 if i + 1 < n else -1] for i in range(n)], np.int32)
    linked, everyone = neighbours >= 0, np.ones(n, bool)
    assert basins(neighbours, linked, height, everyone, 1.0).tolist() == [0, 0, 0, 0, 0, 0, 1, 1]
    assert basins(neighbours, linked, height, everyone, 0.1).tolist() == [0, 0, 0, 2, 2, 2, 1, 1]
    assert basins(neighbours, linked, height, everyone, 10.0).tolist() == [0] * n
    dry = everyone.copy()
    dry[2] = False
    assert basins(neighbours, linked, height, dry, 10.0).tolist() == [0, 0, -1, 1, 1, 1, 1, 1]
    cut = linked.copy()
    cut[[4, 5], [1, 0]] = False
    assert basins(neighbours, cut, height, everyone, 10.0).tolist() == [0, 0, 0, 0, 0, 1, 1, 1]


def test_level_ground_is_one_basin():
    cells = build_cells(wavy(2000), 4.0)
    neighbours, _ = nearest_neighbours(cells, 8)
    labels = basins(neighbours, neighbours >= 0, np.full(2000, 7.0), np.ones(2000, bool), 1.0)
    assert labels.max() == 0


@given(st.integers(0, 300), st.integers(1, 4), st.integers(0, 10_000))
def test_distinct_rows_are_the_first_of_their_kind(n, values, seed):
    points = np.random.default_rng(seed).integers(0, values, (n, 3)).astype(float) * 1e-3
    first, index = distinct_rows(points)
    seen: dict[tuple[float, ...], int] = {}
    expected = [seen.setdefault(tuple(row), len(seen)) for row in points.tolist()]
    assert index.tolist() == expected
    assert first.tolist() == [expected.index(k) for k in range(len(seen))]


@given(clouds)
def test_nearest_distances_equal_a_tree_s(points):
    cells = build_cells(points, 2.0 * np.ptp(points, axis=0).max() / np.sqrt(len(points)))
    expected = KDTree(cells.points).query(cells.points, 2)[0][:, 1]
    for reach in (0.01 * expected.min(), np.median(expected), 100.0 * expected.max()):
        np.testing.assert_allclose(nearest_distance(cells, reach=reach), expected, rtol=1e-7)
