"""Planar profiles, extruded and revolved surfaces, and B-spline surfaces as shapes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.profile import fit_profile, trace
from scan2nurbs.surfaces.shape_fit import choose_shape, fit_shape


def curve(name, u):
    if name == "sine":
        return np.c_[60 * u, 8 * np.sin(6 * u)]
    if name == "ellipse":
        return np.c_[20 * np.cos(2 * np.pi * u), 10 * np.sin(2 * np.pi * u)]
    return np.c_[20 * u, 8 * (u - 0.3) ** 2]


@pytest.mark.parametrize("name", ["sine", "ellipse", "parabola"])
def test_profiles_are_found_in_points_without_order(name):
    rng = np.random.default_rng(0)
    clean = curve(name, rng.random(2000))
    found = fit_profile(clean + 0.2 * rng.normal(size=clean.shape), 0.2)
    assert found.closed == (name == "ellipse")
    assert np.sqrt(np.mean(found.distance(clean)[0] ** 2)) < 0.06
    # Distances are those to a fine polyline.
    t = np.linspace(*found.domain, 20_001)
    near = clean + 0.5 * rng.normal(size=clean.shape)
    inside = np.abs(found.project(near) - np.mean(found.domain)) < 0.499 * np.ptp(found.domain)
    expected = KDTree(found.at(t)[0]).query(near)[0]
    np.testing.assert_allclose(np.abs(found.distance(near)[0])[inside], expected[inside], atol=2e-3)


def test_branches_and_gaps_are_no_profile():
    u = np.linspace(-20, 20, 800)
    zero = np.zeros(800)
    with pytest.raises(NoResultError, match="branches"):
        trace(np.concatenate([np.c_[u, zero], np.c_[zero, u]]), 0.1)
    with pytest.raises(NoResultError, match="gap"):
        trace(np.concatenate([np.c_[u, zero], np.c_[u, zero + 30]]), 0.1)


@pytest.mark.parametrize("kind", ["extrusion", "revolution"])
def test_swept_surfaces_are_chosen_and_exact(kind):
    rng = np.random.default_rng(1)
    u, v = rng.random((2, 2500))
    if kind == "extrusion":
        clean = np.c_[curve("sine", u), 40 * v]
    else:
        r = 22 + 8 * np.sin(4 * u)
        clean = np.c_[r * np.cos(4 * v), r * np.sin(4 * v), 40 * u]
    turn = Rotation.random(random_state=2)
    clean = turn.apply(clean) + 30
    fit = choose_shape(clean + 0.25 * rng.normal(size=clean.shape), noise=0.25)
    assert fit.shape.kind == kind
    axis = fit.shape.direction if kind == "extrusion" else fit.shape.axis
    assert abs(axis @ turn.apply([0, 0, 1])) > np.cos(np.radians(0.5))
    assert np.sqrt(np.mean(fit.shape.distance(clean) ** 2)) < 0.08
    # The normal is the gradient of the distance, and the foot lies on the surface.
    near = clean[:100] + 0.5 * rng.normal(size=(100, 3))
    steps = [(fit.shape.distance(near + e) - fit.shape.distance(near - e)) / 2e-5 for e in 1e-5 * np.eye(3)]
    np.testing.assert_allclose(fit.shape.normal(near), np.array(steps).T, atol=1e-4)
    assert np.abs(fit.shape.distance(fit.shape.foot(near))).max() < 1e-6


def test_a_free_surface_becomes_a_spline_whose_feet_are_nearest():
    rng = np.random.default_rng(3)
    u, v = 40 * rng.random((2, 1600))
    points = np.c_[u, v, 3 * np.sin(0.15 * u) * np.cos(0.2 * v)] + 0.2 * rng.normal(size=(1600, 3))
    fit = choose_shape(points, noise=0.2)
    assert fit.shape.kind == "bspline"
    assert fit.rms == pytest.approx(0.2, rel=0.1)
    shape = fit.shape
    grid = np.stack(np.meshgrid(*(np.linspace(*d, 300) for d in shape.surface.domain)), -1).reshape(-1, 2)
    near = points[::8] + 0.5 * rng.normal(size=(200, 3))
    expected = KDTree(shape.surface.evaluate(grid)).query(near)[0]
    found = np.abs(shape.distance(near))
    assert (found <= expected + 1e-9).all()
    assert (found >= expected - 0.1).all()  # the spacing of the net
    np.testing.assert_allclose(np.linalg.norm(near - shape.foot(near), axis=1), found, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(shape.normal(near), axis=1), 1.0)


@pytest.mark.parametrize("kind", ["extrusion", "revolution", "bspline"])
def test_too_little_is_told(kind):
    with pytest.raises(NoResultError):
        fit_shape(kind, np.random.default_rng(0).random((5, 3)), noise=0.1)


def test_a_profile_does_not_follow_what_is_finer_than_the_noise():
    """Points about an arc, on either side of it by turns: no curve explains them, and one that tried would zigzag."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(0.0, 0.5 * np.pi, 3000)
    radius = 9.0 + np.where(np.sin(40.0 * angle) > 0.0, 0.3, -0.3) + rng.normal(scale=0.25, size=3000)
    curve = fit_profile(radius[:, None] * np.c_[np.cos(angle), np.sin(angle)], 0.25)
    t = np.linspace(*curve.domain, 500)
    step = np.diff(curve.spline(t), axis=0)
    turn = np.arctan2(step[1:, 0] * step[:-1, 1] - step[1:, 1] * step[:-1, 0], np.einsum("ij,ij->i", step[1:], step[:-1]))
    assert curve.freedom <= 3 + 9.0 * 0.5 * np.pi / (4.0 * 0.25)
    assert np.abs(np.degrees(turn)).max() < 30.0
