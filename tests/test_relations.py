"""Relations between primitives: found where they hold, exact once imposed, and dropped where the points speak against them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from primitive_samples import PRIMITIVES, placed
from scan2nurbs.errors import ParameterError
from scan2nurbs.surfaces import constraints
from scan2nurbs.surfaces.jets import jet_pair
from scan2nurbs.surfaces.relations import RelationParams, impose_relations
from scan2nurbs.surfaces.shape_fit import fit_shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS, moved

NOISE, SIZE = 0.25, 40.0


def block(rng, *, radius=6.0, lean=0.0, turn=None):
    """A floor, a wall (leaning by some degrees) and a fillet between them, fitted one by one: points, labels, fits."""
    u, v = SIZE * rng.random((2, 1200))
    floor = np.c_[u + radius, v, np.zeros(1200)]
    wall = Rotation.from_euler("y", lean, degrees=True).apply(np.c_[np.zeros(1200), v, u + radius])
    a = 0.5 * np.pi * rng.random(300)
    fillet = np.c_[radius * (1 - np.cos(a)), SIZE * rng.random(300), radius * (1 - np.sin(a))]
    points = np.concatenate([floor, wall, fillet])
    if turn is not None:
        points = turn.apply(points)
    points = points + NOISE * rng.normal(size=points.shape)
    label = np.repeat(np.arange(3, dtype=np.int32), [1200, 1200, 300])
    kinds = ("plane", "plane", "cylinder")
    return points, label, [fit_shape(k, points[label == i], noise=NOISE) for i, k in enumerate(kinds)]


def impose(points, label, fits, smooth=(), **params):
    return impose_relations(points, label, fits, noise=NOISE, h=1.0, smooth=smooth, params=RelationParams(**params))


@pytest.mark.parametrize("seed", range(3))
def test_a_fillet_becomes_exactly_tangent(seed):
    rng = np.random.default_rng(seed)
    points, label, fits = block(rng, turn=Rotation.random(random_state=seed))
    related = impose(points, label, fits, smooth=[(0, 2), (1, 2)])
    floor, wall, fillet = (fit.shape for fit in related.fits)
    for plane in (floor, wall):
        assert abs(plane.direction @ fillet.axis) < 1e-12
        assert abs(abs((fillet.point - plane.point) @ plane.direction) - fillet.radius) < 1e-10 * SIZE
    assert abs(floor.direction @ wall.direction) < 1e-12
    assert {r.kind for r in related.relations} >= {"perpendicular", "tangent"}
    tangent = next(r for r in related.relations if r.kind == "tangent")
    assert 0 < tangent.length < NOISE
    assert 0 < tangent.angle < 2
    assert abs(fillet.radius - 6.0) < abs(fits[2].shape.radius - 6.0) + 0.1
    assert all(new.rms < 1.05 * old.rms for new, old in zip(related.fits, fits, strict=True))


def test_what_does_not_hold_is_not_imposed():
    points, label, fits = block(np.random.default_rng(0), lean=2.0)
    related = impose(points, label, fits)
    lean = np.degrees(np.arcsin(abs(related.fits[0].shape.direction @ related.fits[1].shape.direction)))
    assert lean == pytest.approx(2.0, abs=0.2)
    assert not any(r.kind == "perpendicular" and r.faces == (0, 1) for r in related.relations)


def test_a_pair_that_is_not_smooth_is_told():
    points, label, fits = block(np.random.default_rng(0), radius=6.0)
    points[label == 2] += [8.0, 0.0, 8.0]
    fits[2] = fit_shape("cylinder", points[label == 2], noise=NOISE)
    related = impose(points, label, fits, smooth=[(0, 2), (1, 2)])
    assert not any(r.kind == "tangent" for r in related.relations)
    assert sum("not tangent" in note for note in related.notes) == 2


def test_tiny_faces_do_no_harm():
    rng = np.random.default_rng(4)
    points, label, fits = block(rng)
    tiny = np.c_[2 * rng.random((8, 2)) + 60, np.zeros(8)] + NOISE * rng.normal(size=(8, 3))
    points, label = np.concatenate([points, tiny]), np.concatenate([label, np.full(8, 3, np.int32)])
    fits.append(fit_shape("plane", tiny, noise=NOISE))
    related = impose(points, label, fits, smooth=[(0, 2), (1, 2), (0, 3)])
    assert all(new.rms < 1.05 * old.rms for new, old in zip(related.fits[:3], fits[:3], strict=True))
    assert sum(r.kind == "tangent" for r in related.relations) == 2


def test_one_axis_is_shared():
    rng = np.random.default_rng(1)
    parts, label = [], []
    for i, (radius, low) in enumerate(((10.0, 0.0), (16.0, 30.0))):
        a, z = 2 * np.pi * rng.random(800), low + 25 * rng.random(800)
        parts.append(np.c_[radius * np.cos(a), radius * np.sin(a), z])
        label += [i] * 800
    ball = rng.normal(size=(600, 3))
    parts.append(12 * ball / np.linalg.norm(ball, axis=1)[:, None] + [0, 0, 70])
    label = np.array(label + [2] * 600, np.int32)
    points = np.concatenate(parts) + NOISE * rng.normal(size=(2200, 3))
    fits = [fit_shape(k, points[label == i], noise=NOISE) for i, k in enumerate(("cylinder", "cylinder", "sphere"))]
    related = impose(points, label, fits)
    first, second, sphere = (fit.shape for fit in related.fits)
    assert [r.kind for r in related.relations] == ["coaxial", "coaxial"]
    assert np.linalg.norm(np.cross(first.axis, second.axis)) < 1e-12
    for place in (second.point, sphere.center):
        assert np.linalg.norm(np.cross(place - first.point, first.axis)) < 1e-9


def test_splines_and_no_relations_leave_fits_alone():
    points, label, fits = block(np.random.default_rng(0))
    assert impose(points, label, fits, smooth=[(0, 2)], kinds=()).fits == tuple(fits)
    assert impose_relations(points, label, [], noise=NOISE, h=1.0).fits == ()


@pytest.mark.parametrize("wrong", [{"kinds": ("similar",)}, {"angle": -1.0}, {"max_rise": np.inf}])
def test_wrong_parameters_are_told(wrong):
    with pytest.raises(ParameterError, match="relations"):
        RelationParams(**wrong)


def _equations():
    pairs = [(a, b) for a in PRIMITIVES for b in PRIMITIVES]
    for a, b in pairs:
        ways = constraints.tangencies(PRIMITIVES[a], PRIMITIVES[b])
        if "sphere" not in (a, b):
            ways = [*ways, constraints.parallel, constraints.perpendicular]
        if a in ("cylinder", "cone", "torus"):
            ways = [*ways, constraints.on_axis]
        if "plane" not in (a, b):
            ways = [*ways, constraints.equal_radius]
        for k, way in enumerate(ways):
            yield pytest.param(a, b, way, id=f"{a}-{b}-{k}")


@pytest.mark.parametrize(("a", "b", "way"), list(_equations()))
def test_slopes_of_equations_are_those_of_differences(a, b, way):
    turns = Rotation.random(2, random_state=5)
    s = placed(PRIMITIVES[a], turns[0], np.array([1.0, 2.0, -1.0]), 0.1)
    t = placed(PRIMITIVES[b], turns[1], np.array([-0.5, 0.3, 0.7]), 0.13)
    frames = [(j.x, j.y) for j in jet_pair(s, t)]
    n = len(COLUMNS[a])

    def values(step):
        # Components are taken along the frames of the start.
        jets = jet_pair(moved(s, step[:n]), moved(t, step[n:]))
        jets = [dataclasses.replace(j, x=x, y=y) for j, (x, y) in zip(jets, frames, strict=True)]
        return np.array([float(j.value) for j, _ in way(*jets)])

    steps = 1e-6 * np.eye(n + len(COLUMNS[b]))
    expected = np.array([(values(e) - values(-e)) / 2e-6 for e in steps]).T
    np.testing.assert_allclose(constraints.evaluate(way, s, t).slope, expected, atol=1e-7)


def test_a_relation_costs_a_large_face_nothing_of_what_its_points_tell():
    rng = np.random.default_rng(5)
    turn, height = rng.uniform(0, 2 * np.pi, 20_000), rng.uniform(0, 30, 20_000)
    pipe = np.c_[10 * np.cos(turn), 10 * np.sin(turn), height]
    radius, angle = 10 * np.sqrt(rng.uniform(size=3000)), rng.uniform(0, 2 * np.pi, 3000)
    lid = np.c_[radius * np.cos(angle), radius * np.sin(angle), np.zeros(3000)]
    points = np.vstack([pipe, lid]) + rng.normal(scale=NOISE, size=(23_000, 3))
    label = np.repeat([0, 1], [20_000, 3000]).astype(np.int32)
    fits = [fit_shape("cylinder", points[:20_000], noise=NOISE), fit_shape("plane", points[20_000:], noise=NOISE)]
    mixed = rng.permutation(23_000)
    related = [impose(points, label, fits), impose(points[mixed], label[mixed], fits)]
    for found in related:
        assert [relation.kind for relation in found.relations] == ["parallel"]
        sigma = found.fits[0].uncertainty["radius"]
        assert sigma == pytest.approx(fits[0].uncertainty["radius"], rel=0.1)
        assert abs(found.fits[0].shape.radius - fits[0].shape.radius) < 0.1 * sigma
