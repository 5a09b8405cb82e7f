"""B-spline kernels against scipy and plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline, NdBSpline

from scan2nurbs.kernels.bspline_band import PADDING, factor_band, solve_band
from scan2nurbs.kernels.runner import set_threads
from scan2nurbs.surfaces.axis import Axis, basis_table
from scan2nurbs.surfaces.prune import _normal_of
from scan2nurbs.surfaces.solve import Spline, fairness, fit_spline, normal_equations, quadratic_form, solve_banded

ORDERS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]


def axis(rng: np.random.Generator, degree: int, spans: int, closed: bool = False) -> Axis:
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.0, spans))])
    return Axis(degree, breaks, closed)


def dense(u: Axis, v: Axis, uv: np.ndarray) -> np.ndarray:
    """Rows of the design matrix, (N, n_u n_v)."""
    return np.einsum("ni,nj->nij", u.at(uv[:, 0]), v.at(uv[:, 1])).reshape(len(uv), -1)


def unband(u: Axis, v: Axis, matrix: np.ndarray) -> np.ndarray:
    """The full symmetric matrix of a banded tensor."""
    full = np.zeros((u.n, v.n, u.n, v.n))
    q = v.degree
    for i in range(u.n):
        for j in range(v.n):
            for a in range(u.degree + 1):
                for b in range(-q if a else 0, q + 1):
                    if (u.closed or i + a < u.n) and (v.closed or 0 <= j + b < v.n):
                        full[i, j, (i + a) % u.n, (j + b) % v.n] += matrix[i, j, a, q + b]
                        if a or b:
                            full[(i + a) % u.n, (j + b) % v.n, i, j] += matrix[i, j, a, q + b]
    return full.reshape(u.n * v.n, u.n * v.n)


@given(seed=st.integers(0, 2**32 - 1), p=st.integers(1, 9), q=st.integers(1, 5), m=st.integers(1, 7), n=st.integers(1, 4))
def test_values_and_derivatives_equal_scipy(seed: int, p: int, q: int, m: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = axis(rng, p, m), axis(rng, q, n)
    control = rng.normal(size=(u.n, v.n, 3))
    uv = rng.random((20, 2)) * [u.length, v.length]
    uv[0], uv[1] = 0.0, [u.breaks[-1], v.breaks[-1]]
    ours = Spline(u, v, control).derivatives(uv, 2)
    theirs = NdBSpline((u.knots, v.knots), control, (p, q))
    for k, order in enumerate(ORDERS):
        expected = theirs(uv, nu=order)
        np.testing.assert_allclose(ours[:, k], expected, atol=1e-10 * (1 + np.abs(expected).max()))


@given(seed=st.integers(0, 2**32 - 1), p=st.integers(1, 7), spans=st.integers(8, 20))
def test_clamping_a_closed_axis_changes_no_value_and_closes_smoothly(seed: int, p: int, spans: int) -> None:
    rng = np.random.default_rng(seed)
    ring = axis(rng, p, spans + p, closed=True)
    coefficients = rng.normal(size=ring.n)
    clamped = ring.to_clamped @ coefficients
    u = rng.random(50) * ring.length
    spline = BSpline(ring.clamped, clamped, p)
    np.testing.assert_allclose(ring.at(u) @ coefficients, spline(u), atol=1e-7)
    assert clamped[0] == clamped[-1]
    if p > 1:
        # The seam joins with one derivative at least: the first and last legs of the net are parallel and fit their knots.
        first = (clamped[1] - clamped[0]) / (ring.breaks[1] - ring.breaks[0])
        last = (clamped[-1] - clamped[-2]) / (ring.breaks[-1] - ring.breaks[-2])
        assert first == pytest.approx(last, abs=1e-6 * np.abs(clamped).max())


@given(
    seed=st.integers(0, 2**32 - 1), p=st.integers(1, 4), q=st.integers(1, 4), m=st.integers(1, 5), n=st.integers(1, 5), closed=st.booleans()
)
def test_normal_equations_fairness_and_solution_equal_dense_algebra(seed: int, p: int, q: int, m: int, n: int, closed: bool) -> None:
    rng = np.random.default_rng(seed)
    u, v = axis(rng, p, m + 2 * p + 1 if closed else m, closed), axis(rng, q, n)
    uv = rng.random((200, 2)) * [u.length, v.length]
    points, weights = rng.normal(size=(200, 3)), rng.random(200)
    matrix, right = normal_equations(u, v, uv, points, weights)
    design = dense(u, v, uv)
    full = design.T @ (weights[:, None] * design)
    np.testing.assert_allclose(unband(u, v, matrix), full, atol=1e-10)
    np.testing.assert_allclose(right.reshape(-1, 3), design.T @ (weights[:, None] * points), atol=1e-10)
    fair = fairness(u, v, np.ones((u.n_spans, v.n_spans)))
    x = solve_banded(u, v, matrix + 0.1 * fair, right)
    np.testing.assert_allclose((full + 0.1 * unband(u, v, fair)) @ x.reshape(-1, 3), right.reshape(-1, 3), atol=1e-8)
    assert quadratic_form(u, v, matrix, x) == pytest.approx(np.einsum("ic,ij,jc->", x.reshape(-1, 3), full, x.reshape(-1, 3)))


def test_fairness_is_the_thin_plate_energy() -> None:
    rng = np.random.default_rng(1)
    u, v = axis(rng, 3, 4), axis(rng, 2, 3)
    control = rng.normal(size=(u.n, v.n, 3))
    form = quadratic_form(u, v, fairness(u, v, np.ones((4, 3))), control)
    gu, gv = ((np.arange(n) + 0.5) / n for n in (400, 300))
    grid = np.stack(np.meshgrid(gu * u.length, gv * v.length, indexing="ij"), -1).reshape(-1, 2)
    d = Spline(u, v, control).derivatives(grid, 2)
    hu, hv = u.length / 4, v.length / 3
    energy = (d[:, 3] ** 2 * hu**4 + 2 * d[:, 4] ** 2 * (hu * hv) ** 2 + d[:, 5] ** 2 * hv**4).sum() / len(grid) * 4 * 3
    assert form == pytest.approx(energy, rel=2e-3)


@given(seed=st.integers(0, 2**32 - 1), p=st.integers(1, 5), spans=st.integers(2, 8), data=st.data())
def test_splines_without_a_knot_have_no_part_along_its_normal(seed: int, p: int, spans: int, data: st.DataObject) -> None:
    full = axis(np.random.default_rng(seed), p, spans)
    k = data.draw(st.integers(1, spans - 1))
    smaller = Axis(p, np.delete(full.breaks, k))
    greville = np.lib.stride_tricks.sliding_window_view(full.knots[1:-1], p).mean(axis=1)
    inserted = np.linalg.solve(full.at(greville), smaller.at(greville))
    np.testing.assert_allclose(_normal_of(full, k) @ inserted, 0.0, atol=1e-8)


def test_functions_are_positive_and_sum_to_one() -> None:
    ring = axis(np.random.default_rng(0), 5, 12, closed=True)
    table = basis_table(ring.knots, 5, np.linspace(0, ring.length, 101), 1)[1]
    assert table[:, 0].min() >= 0
    np.testing.assert_allclose(table[:, 0].sum(axis=1), 1.0)
    np.testing.assert_allclose(table[:, 1].sum(axis=1), 0.0, atol=1e-12)


def bowl(u: Axis, v: Axis) -> Spline:
    rng = np.random.default_rng(5)
    uv = rng.random((4000, 2)) * [u.length, v.length]
    x, y = uv.T
    return fit_spline(u, v, uv, np.stack([x, y, 0.1 * (x - 1) ** 2 - 0.07 * y**2], 1), np.ones(4000), 1e-9)


def test_foot_points_are_the_nearest_of_a_fine_grid_and_stand_at_right_angles() -> None:
    rng = np.random.default_rng(2)
    spline = bowl(axis(rng, 3, 5), axis(rng, 3, 4))
    size = np.array([spline.u.length, spline.v.length])
    start = (0.05 + 0.9 * rng.random((300, 2))) * size
    d = spline.derivatives(start, 1)
    normal = np.cross(d[:, 1], d[:, 2])
    height = rng.uniform(-0.3, 0.3, 300)
    points = d[:, 0] + height[:, None] * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    uv, signed, whole = spline.foot_points(points, np.clip(start + rng.normal(0, 0.2, (300, 2)), 0, size), 20)
    np.testing.assert_allclose(uv, start, atol=1e-6)
    np.testing.assert_allclose(signed, height, atol=1e-10)
    np.testing.assert_allclose(whole, np.abs(height), atol=1e-10)


def test_foot_points_stay_in_the_rectangle_and_never_recede() -> None:
    rng = np.random.default_rng(3)
    spline = bowl(axis(rng, 3, 3), axis(rng, 3, 3))
    size = np.array([spline.u.length, spline.v.length])
    points = rng.uniform(-3, 6, (500, 3))
    start = rng.random((500, 2)) * size
    before = np.linalg.norm(spline.derivatives(start, 0)[:, 0] - points, axis=1)
    uv, _, whole = spline.foot_points(points, start, 10)
    assert (uv >= 0).all()
    assert (uv <= size).all()
    assert (whole <= before + 1e-12).all()


def test_threads_do_not_change_a_bit() -> None:
    rng = np.random.default_rng(4)
    u, v = axis(rng, 3, 9), axis(rng, 3, 7)
    uv = rng.random((50_000, 2)) * [u.length, v.length]
    points = rng.normal(size=(50_000, 3))
    results = []
    try:
        for threads in (1, 2, 5):
            set_threads(threads)
            spline = fit_spline(u, v, uv, points, np.ones(len(uv)), 1e-4)
            results.append((spline.control, *spline.foot_points(points, uv, 3)))
    finally:
        set_threads(None)
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 40), width=st.integers(0, 12))
def test_banded_cholesky_equals_dense_algebra(seed: int, n: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    width = min(width, n - 1)
    lower = np.tril(np.triu(rng.normal(size=(n, n)), -width)) + 2 * np.eye(n) * (1 + width)
    matrix = lower @ lower.T
    band = np.zeros((n, width + 1 + PADDING))
    for d in range(width + 1):
        band[: n - d, d] = np.diagonal(matrix, -d)
    x = rng.normal(size=(n, 3))
    expected = np.linalg.solve(matrix, x)
    assert factor_band(band) == 0
    solve_band(band, x)
    np.testing.assert_allclose(x, expected, rtol=1e-7, atol=1e-10)


def test_banded_cholesky_names_the_bad_pivot() -> None:
    band = np.zeros((4, 2 + PADDING))
    band[:, 0] = [1, 2, -1, 3]
    assert factor_band(band) == 3
