"""The surface fit against analytic truth, and what must not change it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scan2nurbs.errors import InputError, NoResultError, ParameterError
from scan2nurbs.kernels.runner import set_threads
from scan2nurbs.surfaces.fit import FitParams, fit_surface
from surface_shapes import SHAPES, distance_to, pipe, stack

MAPS = {"conical ring": "tube", "closed tube": "tube"} | dict.fromkeys(
    ("half tube", "tube of 300 degrees", "blade", "hemisphere", "ribbon"), "geodesic"
)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("noise", [0.1, 0.25, 0.5])
@pytest.mark.parametrize("name", SHAPES)
def test_averages_the_noise_out_on_every_shape(name: str, noise: float) -> None:
    points, truth, sigma = SHAPES[name].scan(5000, noise)
    fit = fit_surface(points)
    assert rms(distance_to(fit, truth)) <= 0.3 * sigma
    assert fit.noise == pytest.approx(sigma, rel=0.1)
    assert fit.parametrization == MAPS.get(name, "plane")
    assert fit.surface.closed == (fit.parametrization == "tube", False)
    assert fit.n_control_points < len(points) / 20
    assert fit.notes == ()
    # No folds: the normals at neighbouring foot points agree in side with those at the points of the true surface.
    normals = fit.surface.normals(fit.uv)
    area = np.linalg.norm(np.cross(*np.moveaxis(fit.surface.derivatives(fit.uv)[:, 1:], 1, 0)), axis=1)
    assert np.isfinite(normals).all()
    assert area.min() > 0.05 * np.median(area)


@pytest.mark.parametrize("name", ["convex", "half tube", "closed tube", "blade"])
def test_outliers_do_nothing(name: str) -> None:
    points, truth, sigma = SHAPES[name].scan(8000, 0.25)
    rng = np.random.default_rng(3)
    wrong = rng.choice(len(points), len(points) // 50, replace=False)
    dirty = points.copy()
    dirty[wrong] += rng.normal(0, 40 * sigma, (len(wrong), 3))
    fit, clean = fit_surface(dirty), fit_surface(points)
    far = np.abs(distance_to(clean, dirty)) > 8 * sigma
    assert not fit.inliers[far].any()
    assert fit.n_outliers < 1.2 * len(wrong)
    right = np.setdiff1d(np.arange(len(points)), wrong)
    assert rms(distance_to(fit, truth[right])) <= 0.3 * sigma
    assert fit.n_control_points <= 1.3 * clean.n_control_points


def test_without_robustness_outliers_are_felt() -> None:
    points, truth, sigma = SHAPES["convex"].scan(3000, 0.25)
    points[::20] += [0, 0, 20 * sigma]
    robust, plain = fit_surface(points), fit_surface(points, FitParams(robust=False))
    assert plain.n_outliers == 0
    assert rms(distance_to(robust, truth)) < 0.3 * sigma < 0.9 * sigma < rms(distance_to(plain, truth))


def test_a_bump_is_followed_not_taken_for_outliers() -> None:
    rng = np.random.default_rng(0)
    x, y = (rng.random((2, 20_000)) - 0.5) * 140
    true = stack(x, y, 12 * np.exp(-((x - 20) ** 2 + (y + 10) ** 2) / 80))
    fit = fit_surface(true + rng.normal(0, 0.2, true.shape) * [0, 0, 1])
    assert fit.n_outliers == 0
    assert np.abs(distance_to(fit, true)).max() < 0.4
    # Knots stand where the bump is: the shortest span is there, and it is far shorter than the longest.
    spans = [np.diff(np.unique(k)) for k in fit.knots]
    assert all(s.max() > 2 * s.min() for s in spans)


def test_a_given_tolerance_saves_control_points() -> None:
    points, truth, sigma = SHAPES["holes"].scan(6000, 0.1)
    fine = fit_surface(points)
    coarse = fit_surface(points, FitParams(tolerance=10 * sigma))
    assert coarse.n_control_points < fine.n_control_points
    assert rms(distance_to(coarse, truth)) < 10 * sigma
    assert coarse.tolerance == pytest.approx(10 * sigma)


def test_given_noise_is_believed() -> None:
    points, _, sigma = SHAPES["convex"].scan(3000, 0.25)
    fit = fit_surface(points, FitParams(noise=2 * sigma))
    assert fit.noise == pytest.approx(2 * sigma)
    assert fit.tolerance == pytest.approx(sigma)


def test_the_net_is_calm_where_there_are_no_points() -> None:
    points, _, _ = SHAPES["concave"].scan(6000, 0.5)
    fit = fit_surface(points)
    low, high = points.min(axis=0), points.max(axis=0)
    net = fit.control_points.reshape(-1, 3)
    assert (net > low - 0.25 * (high - low).max()).all()
    assert (net < high + 0.25 * (high - low).max()).all()
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 60)] * 2), -1).reshape(-1, 2)
    normals = fit.surface.normals(grid)
    assert (normals @ normals.mean(axis=0) > 0.3).all()


def test_a_tube_closes_smoothly() -> None:
    points, _, _ = SHAPES["closed tube"].scan(5000, 0.25)
    surface = fit_surface(points).surface
    v = np.linspace(0, 1, 20)
    first = surface.derivatives(np.stack([np.zeros(20), v], 1), 2)
    last = surface.derivatives(np.stack([np.ones(20), v], 1), 2)
    np.testing.assert_array_equal(surface.control_points[0], surface.control_points[-1])
    np.testing.assert_allclose(first, last, atol=1e-7 * np.abs(first).max())


def test_a_bent_pipe_closes_around_its_bend() -> None:
    points, truth, sigma = pipe(turns=200).scan(5000, 0.25)
    fit = fit_surface(points)
    assert fit.parametrization == "tube"
    assert rms(distance_to(fit, truth)) <= 0.3 * sigma


def test_a_closed_ball_has_no_map_or_a_named_one() -> None:
    x = np.random.default_rng(0).normal(size=(4000, 3))
    caps = np.abs(x[:, 2]) < 0.9 * np.linalg.norm(x, axis=1)
    band = 30 * (x / np.linalg.norm(x, axis=1, keepdims=True))[caps]
    assert fit_surface(band).parametrization == "tube"


@pytest.mark.parametrize("degree", [1, 2, 5, 9, (2, 4)])
def test_any_degree(degree: int | tuple[int, int]) -> None:
    points, truth, sigma = SHAPES["convex"].scan(6000, 0.25)
    fit = fit_surface(points, FitParams(degree=degree))
    assert sorted(fit.degrees) == sorted((degree, degree) if isinstance(degree, int) else degree)
    assert rms(distance_to(fit, truth)) <= 0.35 * sigma


@pytest.mark.parametrize("n", [6, 9, 20, 60, 150])
def test_few_points_get_a_low_degree_and_few_control_points(n: int) -> None:
    rng = np.random.default_rng(n)
    x, y = rng.random((2, n))
    points = stack(3 * x, 2 * y, 0.2 * x * x + 0.001 * rng.normal(size=n))
    fit = fit_surface(points)
    assert fit.n_control_points <= max(4, n / 4)
    assert fit.degrees == (3, 3) or n < 64
    assert fit.rms < 0.05
    assert np.abs(fit.control_points).max() < 6


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_tube_that_narrows_is_wound_around_at_its_narrow_end_too(seed: int) -> None:
    """Most nodes lie where it is wide, and a line that leaves it through the wall beside the narrow end suits them as well."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0, 90, 60_000)
    radius = 19 + 10 * np.sin(height / 20) - 0.08 * height
    kept = rng.random(len(height)) < radius / radius.max()
    height, radius = height[kept], radius[kept]
    around = rng.uniform(0, 2 * np.pi, len(height))
    points = np.column_stack([radius * np.cos(around), radius * np.sin(around), height])
    spacing = np.sqrt(2 * np.pi * radius.mean() * 90 / len(points))
    surface = fit_surface(points + 0.5 * spacing * rng.normal(size=points.shape)).surface
    narrow = max((0.0, 1.0), key=lambda v: float(surface.evaluate(np.array([[0.0, v]]))[0, 2]))
    end = surface.evaluate(np.column_stack([np.linspace(0, 1, 64, endpoint=False), np.full(64, narrow)]))
    turn = np.unwrap(np.arctan2(end[:, 1], end[:, 0]))
    assert abs(turn[-1] - turn[0]) > 1.8 * np.pi
    assert np.ptp(end[:, 2]) < 5.0


@pytest.mark.parametrize("name", ["saddle", "half tube", "closed tube"])
def test_moving_and_scaling_the_points_moves_and_scales_the_surface(name: str) -> None:
    points, _, sigma = SHAPES[name].scan(3000, 0.25)
    plain = fit_surface(points)
    turn = Rotation.from_euler("xyz", [0.3, -0.8, 1.9])
    far = np.array([1e3, -2e3, 5e2])
    for scale in (1e-6, 1.0, 1e6):
        moved = fit_surface(scale * (turn.apply(points) + far))
        back = turn.inv().apply(moved.surface.evaluate(moved.uv) / scale - far)
        assert moved.rms / scale == pytest.approx(plain.rms, rel=0.02)
        assert rms(distance_to(plain, back)) < 0.15 * sigma


def test_the_order_of_the_points_does_not_matter() -> None:
    points, _, sigma = SHAPES["blade"].scan(3000, 0.25)
    order = np.random.default_rng(0).permutation(len(points))
    plain, shuffled = fit_surface(points), fit_surface(points[order])
    assert rms(distance_to(plain, shuffled.surface.evaluate(shuffled.uv))) < 0.15 * sigma
    assert shuffled.rms == pytest.approx(plain.rms, rel=0.02)


def test_threads_do_not_change_a_bit() -> None:
    points, _, _ = SHAPES["holes"].scan(20_000, 0.25)
    fits = []
    try:
        for threads in (1, 3):
            set_threads(threads)
            fits.append(fit_surface(points))
    finally:
        set_threads(None)
    one, three = fits
    np.testing.assert_array_equal(one.control_points, three.control_points)
    np.testing.assert_array_equal(one.residuals, three.residuals)
    np.testing.assert_array_equal(one.weights, three.weights)


def test_many_points_are_all_fitted_from_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scan2nurbs.surfaces.fit._SAMPLE", 3000)
    points, truth, sigma = SHAPES["half tube"].scan(12_000, 0.25)
    fit = fit_surface(points)
    assert len(fit.uv) == len(fit.residuals) == len(fit.weights) == len(points)
    assert rms(distance_to(fit, truth)) <= 0.2 * sigma
    np.testing.assert_allclose(distance_to(fit, points), fit.residuals, atol=1e-6)


def test_figures_count_only_what_is_no_outlier() -> None:
    points, _, sigma = SHAPES["saddle"].scan(2000, 0.25)
    points[0] += [0, 0, 30]
    fit = fit_surface(points)
    assert fit.n_outliers >= 1
    assert not fit.inliers[0]
    assert fit.max < 8 * sigma < np.abs(fit.residuals).max()
    assert fit.rms == pytest.approx(sigma, rel=0.1)
    assert fit.rms < fit.p95 < fit.max


def test_progress_is_told() -> None:
    calls: list[tuple[int, int]] = []
    points, _, _ = SHAPES["ring"].scan(1500, 0.25)
    fit = fit_surface(points, FitParams(max_iterations=7), progress=lambda done, total: calls.append((done, total)))
    assert [done for done, _ in calls] == list(range(1, fit.iterations + 1))
    assert {total for _, total in calls} == {7}


def test_bounds_are_kept_and_said() -> None:
    points, _, _ = SHAPES["holes"].scan(6000, 0.1)
    fit = fit_surface(points, FitParams(max_control_points=30))
    assert fit.n_control_points <= 30
    assert "control points" in fit.notes[0]
    fit = fit_surface(points, FitParams(max_iterations=1))
    assert "max_iterations" in fit.notes[0]


@pytest.mark.parametrize(
    ("points", "why"),
    [
        (np.zeros((5, 3)), "at least 6"),
        (np.ones((50, 3)), "coincide"),
        (np.outer(np.arange(50.0), [1, 2, 3]), "line"),
        (np.random.default_rng(0).normal(size=(3000, 3)), "sheet"),
    ],
)
def test_what_is_no_surface_is_refused_with_a_reason(points: np.ndarray, why: str) -> None:
    with pytest.raises(NoResultError, match=why):
        fit_surface(points)


@pytest.mark.parametrize("points", [np.zeros((10, 2)), np.zeros(3), np.full((10, 3), np.nan), np.full((10, 3), np.inf)])
def test_what_are_no_points_is_refused(points: np.ndarray) -> None:
    with pytest.raises(InputError):
        fit_surface(points)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("degree", 0),
        ("degree", 16),
        ("degree", (3, 3, 3)),
        ("degree", 2.5),
        ("tolerance", 0.0),
        ("tolerance", float("nan")),
        ("noise", -1.0),
        ("smoothness", 0.0),
        ("max_control_points", 3),
        ("max_iterations", 0),
    ],
)
def test_wrong_parameters_are_named(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"'{name}' parameter of fit_surface must be"):
        FitParams(**{name: value})


def test_a_plane_without_noise_is_fitted_without_a_warning():
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(0, 10, (2000, 2)), np.zeros(2000)]
    fit = fit_surface(points, FitParams(noise=0.0))
    assert np.abs(fit.residuals).max() < 1e-9
