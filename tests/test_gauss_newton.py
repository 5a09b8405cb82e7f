"""Fits of primitives in blocks: the same steps as a plain twin's, whatever the number of points, and truth where there is no noise."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.kernels.gauss_newton import BLOCK, MOST, refine, settle
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import CONE, CYLINDER, PLANE, SIZE, SPHERE, TORUS, distance_of
from scan2nurbs.kernels.refits import misfit

SIGMA = 0.2
TILT = np.array([0.2, -0.3, 0.9]) / np.linalg.norm([0.2, -0.3, 0.9])
MODELS = {PLANE: (0.0, 0.0), CYLINDER: (9.0, 0.0), CONE: (9.0, 0.3), SPHERE: (12.0, 0.0), TORUS: (14.0, 5.0)}


def model(kind, axis=TILT, point=(1.0, 2.0, 3.0), off=0.0):
    m = np.zeros(SIZE)
    m[0], m[1:4], m[4:7] = kind, point, axis
    m[7], m[8] = np.array(MODELS[kind]) * (1.0 + off)
    return m


def scattered(kind, n, noise=SIGMA):
    """Points of about a third of a primitive, drawn onto it from a box around some place of it."""
    rng = np.random.default_rng(n + kind)
    m = model(kind)
    points = rng.uniform(-8.0, 8.0, (n, 3)) + m[1:4] + 10.0 * np.array([0.8, 0.6, 0.1])
    for _ in range(20):
        for k, p in enumerate(points):
            d, *normal = distance_of(m, *p)
            points[k] = p - d * np.array(normal)
    return points + rng.normal(scale=noise, size=points.shape)


def started(kind):
    """A model that is a little off."""
    axis = TILT + np.array([0.03, 0.02, -0.01])
    return model(kind, axis / np.linalg.norm(axis), (1.2, 1.9, 3.1), off=0.05)


def distances(m, points):
    return np.array([distance_of(m, *p)[0] for p in points])


def derivatives(m, p, size):
    """Return the distance of a point, and its derivatives by moving, by turning and by shape, each by small differences."""
    kind, step = int(m[0]), 1e-6
    d, *normal = distance_of(m, *p)
    offset = (np.asarray(p) - m[1:4]) / size
    row = [*(-np.array(normal)), *(-np.cross(offset, normal))]
    for place, scale in {PLANE: (), CYLINDER: ((7, 1.0),), SPHERE: ((7, 1.0),)}.get(kind, ((7, 1.0), (8, size if kind == CONE else 1.0))):
        more, less = m.copy(), m.copy()
        more[place] += step
        less[place] -= step
        row.append((distance_of(more, *p)[0] - distance_of(less, *p)[0]) / (2.0 * step * scale))
    return d, row


def twin_step(m, points):
    """One step of `refine` from a plain reading of its notes; return the model and the robust mean square before it."""
    m, kind = m.copy(), int(m[0])
    points = points[:: max(1, len(points) // MOST)]
    centre = points.mean(axis=0)
    size = np.sqrt(((points - centre) ** 2).sum(axis=1).mean())
    along = (centre - m[1:4]) @ m[4:7]
    if kind == PLANE:
        m[1:4] = centre - along * m[4:7]
    if kind in (CYLINDER, CONE):
        m[1:4] += along * m[4:7]
        m[7] += along * np.tan(m[8])
    found = [derivatives(m, p, size) for p in points]
    d, rows = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    weight = (1.0 + (d / (12.0 * SIGMA)) ** 2) ** -2.0
    a = rows.T @ (weight[:, None] * rows)
    step = np.linalg.solve(a + 1e-8 * np.trace(a) * np.eye(len(a)), -rows.T @ (weight * d))
    m[1:4] += step[:3]
    axis = m[4:7] + np.cross(step[3:6] / size, m[4:7])
    m[4:7] = axis / np.linalg.norm(axis)
    if kind != PLANE:
        m[7] += step[6]
    if kind in (CONE, TORUS):
        m[8] += step[7] / (size if kind == CONE else 1.0)
    return m, float((weight * d**2).sum() / weight.sum())


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("n", [40, BLOCK - 1, BLOCK, BLOCK + 1, 2 * MOST + 5])
def test_a_step_is_that_of_the_twin(kind, n):
    points, m = scattered(kind, n), started(kind)
    expected, square = twin_step(m, points)
    assert refine(m, points, np.arange(n, dtype=np.int32), n, SIGMA, 1) == pytest.approx(square, rel=1e-9)
    # Points, not parameters, since a cone's point may lie anywhere along its axis.
    np.testing.assert_allclose(distances(m, points), distances(expected, points), atol=1e-5)


@pytest.mark.parametrize("kind", MODELS)
def test_without_noise_the_truth_comes_out(kind):
    points, m = scattered(kind, 300, noise=0.0), started(kind)
    assert refine(m, points, np.arange(300, dtype=np.int32), 300, 1e-3, 12) < 1e-18
    assert np.abs(distances(m, points)).max() < 1e-8
    last = 8 if kind == CONE else 7
    np.testing.assert_allclose(np.abs(m[last:9]), MODELS[kind][last - 7 :], atol=1e-6)


def test_only_the_points_that_are_listed_are_read():
    points = scattered(CYLINDER, 200)
    listed = np.arange(0, 200, 2, dtype=np.int32)
    few, many = started(CYLINDER), started(CYLINDER)
    refine(few, points, listed, 100, SIGMA, 3)
    points[1::2] = np.nan
    refine(many, points, np.concatenate([listed, listed[:7]]), 100, SIGMA, 3)
    np.testing.assert_array_equal(few, many)


@pytest.mark.parametrize("kind", MODELS)
def test_settled_models_fit_all_points_and_misfits_count_all(kind):
    """A fit to one point in ten leaves more of all of them: here by what ten times half its parameters are worth, but for chance."""
    n = 10 * MOST
    points, index, m = scattered(kind, n), np.arange(n, dtype=np.int32), started(kind)
    refine(m, points, index, n, SIGMA, 12)
    some = misfit(m, points, index, n, SIGMA)
    settle(m, points, index, n, SIGMA)
    off = distances(m, points) / SIGMA
    assert misfit(m, points, index, n, SIGMA) == pytest.approx(np.minimum(0.5 * off**2, DISTANCE_CAP).sum(), rel=1e-12)
    assert misfit(m, points, index, n, SIGMA) < some - 1.0
