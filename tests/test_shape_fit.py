"""Fits of primitives and the choice between shapes, against truth."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from primitive_samples import PRIMITIVES, patch, placed
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.kernels.shapes import normal_equations
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.interior import interior
from scan2nurbs.surfaces.shape_fit import choose_shape, fit_shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS, moved, pose
from scan2nurbs.surfaces.shape_solve import distances

KINDS = list(PRIMITIVES)


def noisy(kind, n, noise, seed=0):
    rng = np.random.default_rng(seed)
    points = patch(kind, n, rng)
    return points + rng.normal(size=points.shape) * noise


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [120, 3000])
def test_a_fit_recovers_the_surface_within_its_noise(kind, n):
    fit = fit_shape(kind, noisy(kind, n, 0.25), noise=0.25)
    clean = patch(kind, n, np.random.default_rng(7))
    assert np.sqrt(np.mean(fit.shape.distance(clean) ** 2)) < 0.25 * 3 * np.sqrt(fit.shape.freedom / n)
    assert fit.rms == pytest.approx(0.25, rel=0.2 if n < 1000 else 0.05)
    assert fit.covariance.shape == (fit.shape.freedom, fit.shape.freedom)


@pytest.mark.parametrize(
    ("kind", "name"), [("cylinder", "radius"), ("sphere", "radius"), ("torus", "minor"), ("torus", "major"), ("cone", "half_angle")]
)
def test_uncertainties_are_those_of_the_errors(kind, name):
    pulls = []
    for seed in range(60):
        fit = fit_shape(kind, noisy(kind, 300, 0.1, seed), noise=0.1)
        error = getattr(fit.shape, name) - getattr(PRIMITIVES[kind], name)
        pulls.append((np.degrees(error) if name == "half_angle" else error) / fit.uncertainty[name])
    assert 0.75 < np.sqrt(np.mean(np.square(pulls))) < 1.35


@pytest.mark.parametrize("kind", KINDS)
def test_clean_points_give_the_exact_surface(kind):
    points = patch(kind, 200, np.random.default_rng(1))
    fit = fit_shape(kind, points, noise=0.0)
    assert np.abs(fit.shape.distance(points)).max() < 1e-6


@given(st.sampled_from(KINDS), st.integers(0, 1000))
@settings(max_examples=20)
def test_similarities_carry_fits_along(kind, seed):
    rng = np.random.default_rng(seed)
    points = noisy(kind, 200, 0.2, seed)
    turn, shift, size = Rotation.random(random_state=seed), 50 * rng.normal(size=3), 10 ** rng.uniform(-3, 3)
    plain = fit_shape(kind, points, noise=0.2)
    other = fit_shape(kind, size * turn.apply(points) + size * shift, noise=0.2 * size)
    clean = patch(kind, 200, rng)
    expected = placed(plain.shape, turn, size * shift, size)
    where = size * turn.apply(clean) + size * shift
    np.testing.assert_allclose(np.abs(other.shape.distance(where)), np.abs(expected.distance(where)), atol=0.02 * size)


@pytest.mark.parametrize("kind", KINDS)
def test_the_normal_equations_are_those_of_the_distances(kind):
    points = noisy(kind, 50, 0.2)
    shape = placed(PRIMITIVES[kind], Rotation.random(random_state=3), np.array([0.1, -0.2, 0.05]), 1.0)
    freedom = len(COLUMNS[kind])
    steps = 1e-6 * np.eye(freedom)
    jacobian = np.array([(distances(moved(shape, s), points) - distances(moved(shape, -s), points)) / 2e-6 for s in steps]).T
    d, weights = distances(shape, points), np.linspace(0.5, 1.0, 50)
    cut = 3.0 * np.median(np.abs(d))
    tukey = weights * np.maximum(1 - (d / cut) ** 2, 0) ** 2
    out = np.empty((8, 8))
    cost = normal_equations(points, weights, *pose(shape), cut, out)
    columns = COLUMNS[kind]
    upper = np.triu(np.ones((freedom, freedom), bool))
    np.testing.assert_allclose(out[np.ix_(columns, columns)][upper], (jacobian.T * tukey @ jacobian)[upper], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(out[columns, 7], jacobian.T @ (tukey * d), rtol=1e-5, atol=1e-5)
    inside = np.maximum(1 - (d / cut) ** 2, 0)
    assert cost == pytest.approx(np.sum(weights * cut**2 / 3 * (1 - inside**3)))
    np.testing.assert_allclose(d, shape.distance(points), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_wrong_points_do_not_bend_a_fit(kind):
    points = noisy(kind, 600, 0.2)
    points[::20] += np.random.default_rng(1).normal(size=(30, 3)) * 6.0
    fit = fit_shape(kind, points, noise=0.2)
    assert np.sqrt(np.mean(fit.shape.distance(patch(kind, 600, np.random.default_rng(9))) ** 2)) < 0.08


@pytest.mark.parametrize("width", [3.0, 6.0])
def test_narrow_fillets_are_found(width):
    rng = np.random.default_rng(5)
    radius = width / (0.5 * np.pi)
    a, z = 0.5 * np.pi * rng.random(int(60 * width)), 60 * rng.random(int(60 * width))
    points = np.c_[radius * np.cos(a), radius * np.sin(a), z]
    points += 0.25 * rng.normal(size=points.shape)
    fit = fit_shape("cylinder", points, noise=0.25)
    assert fit.shape.radius == pytest.approx(radius, abs=0.35)
    assert abs(fit.shape.axis[2]) > np.cos(np.radians(1.0))


def test_a_thin_ring_of_a_torus_is_found():
    rng = np.random.default_rng(5)
    a, b = 2 * np.pi * rng.random(1500), 0.5 * np.pi * rng.random(1500)
    r = 70 + 4 * np.cos(b)
    points = np.c_[r * np.cos(a), r * np.sin(a), 4 * np.sin(b)] + 0.25 * rng.normal(size=(1500, 3))
    fit = choose_shape(points, noise=0.25)
    assert fit.shape.kind == "torus"
    assert fit.shape.major == pytest.approx(70, abs=4 * fit.uncertainty["major"])
    assert fit.shape.minor == pytest.approx(4, abs=4 * fit.uncertainty["minor"])


@pytest.mark.parametrize(
    ("kind", "of"),
    [("cylinder", "plane"), ("cone", "plane"), ("sphere", "plane"), ("torus", "plane"), ("cone", "cylinder"), ("torus", "sphere")],
)
def test_what_the_points_do_not_determine_is_refused(kind, of):
    with pytest.raises(NoResultError, match="do not determine"):
        fit_shape(kind, noisy(of, 400, 0.25), noise=0.25)


@pytest.mark.parametrize("points", [np.zeros((10, 3)), np.eye(3)[:2], np.c_[np.arange(9.0), np.zeros((9, 2))]])
@pytest.mark.parametrize("kind", KINDS)
def test_degenerate_points_end_in_a_sentence(kind, points):
    with pytest.raises(NoResultError, match=r"determine|suggest"):
        fit_shape(kind, points, noise=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_points_in_any_line_end_in_a_sentence(kind):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        line = rng.normal(size=3) + np.outer(np.arange(30.0), rng.normal(size=3))
        with pytest.raises(NoResultError, match=r"determine|suggest"):
            fit_shape(kind, line, noise=1e-3)


@pytest.mark.parametrize("extent", [1.0, 1e4])
def test_nearly_flat_points_are_a_plane_and_a_huge_sphere_or_none(extent):
    for seed in range(40):
        rng = np.random.default_rng(seed)
        points = extent * np.c_[rng.uniform(-1, 1, (120, 2)), rng.normal(scale=1e-4, size=120)]
        assert choose_shape(points, noise=1e-4 * extent).shape.kind == "plane"
        with suppress(NoResultError):
            assert fit_shape("sphere", points, noise=1e-4 * extent).shape.radius > 100.0 * extent


def test_no_number_of_threads_changes_a_fit():
    program = (
        "import numpy as np; from scan2nurbs.surfaces.shape_fit import fit_shape; rng = np.random.default_rng(3)\n"
        "for n in (20_000, 23_001, 25_000, 200_000):\n"
        "    fit = fit_shape('plane', np.c_[rng.uniform(size=(n, 2)), rng.normal(scale=0.01, size=n)], noise=0.01)\n"
        "    print(fit.criterion.hex(), fit.rms.hex())\n"
    )
    said = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2", "4")
    }
    assert len(said) == 1


def test_wrong_arguments_are_told():
    points = noisy("plane", 50, 0.1)
    with pytest.raises(ParameterError, match="finite"):
        fit_shape("plane", np.full((5, 3), np.nan), noise=0.1)
    with pytest.raises(ParameterError, match="kind"):
        fit_shape("cube", points, noise=0.1)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="noise"):
        fit_shape("plane", points, noise=-1.0)
    with pytest.raises(ParameterError, match="weights"):
        fit_shape("plane", points, noise=0.1, weights=np.ones(3))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [1e-4, 1.0, 1e5])
def test_the_right_kind_is_chosen(kind, size):
    right = [choose_shape(size * noisy(kind, 400, 0.25, seed), noise=0.25 * size).shape.kind == kind for seed in range(4)]
    assert sum(right) >= 3


def test_border_points_of_a_neighbour_do_not_decide():
    rng = np.random.default_rng(2)
    flat = np.c_[30 * rng.random((900, 2)), np.zeros(900)]
    wall = np.c_[30 * rng.random(45), np.zeros(45), -2 * rng.random(45)]
    points = np.concatenate([flat, wall]) + 0.25 * rng.normal(size=(945, 3))
    assert choose_shape(points, noise=0.25).shape.kind == "plane"
    assert np.mean(interior(points)[-45:]) < 0.2
    assert np.mean(interior(points)[:-45]) > 0.6


@pytest.mark.parametrize("kind", KINDS)
def test_noise_has_no_smooth_part_and_a_bend_has(kind):
    points = noisy(kind, 1500, 0.2)
    shape = fit_shape(kind, points, noise=0.2).shape
    feet, d = shape.foot(points), shape.distance(points)
    assert study(feet, d, 0.2).chance > 1e-3
    bent = study(feet, d + 0.4 * np.sin(0.3 * feet[:, 0]), 0.2)
    assert not bent.explained(0.2)
    assert bent.noise == pytest.approx(0.2, rel=0.35)
