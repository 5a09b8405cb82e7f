"""Freeform faces: told from primitives that meet smoothly, joined up to creases, cut into charts, and their neighbours left alone."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.faces.charts import Turns, charts, turns_of
from scan2nurbs.faces.contacts import Contact, face_contacts, parted_contacts, smooth_contacts
from scan2nurbs.faces.segmentation import SegmentParams, segment_points
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.relations import doubt_tangency
from scan2nurbs.surfaces.shape_fit import fit_shape

NOISE = 0.25


def grid(nx, ny, rng):
    """Jittered places (N, 2), one per unit of area."""
    u, v = np.meshgrid(np.arange(0.5, nx), np.arange(0.5, ny), indexing="ij")
    return np.c_[u.ravel(), v.ravel()] + rng.uniform(-0.25, 0.25, (nx * ny, 2))


def noisy(points, rng, noise=NOISE):
    return points + rng.normal(scale=noise, size=points.shape)


def segment(points):
    scale = measure_scale(points)
    return segment_points(points, scale, detect(points, scale, EdgeParams()), SegmentParams())


def waves(x, y):
    return 5.0 * np.sin(x / 13.0) * np.cos(y / 17.0) + 0.004 * (x - 40.0) ** 2


@pytest.mark.parametrize("noise", [0.1, 0.25])
def test_a_wavy_sheet_is_one_spline_within_the_noise(noise):
    rng = np.random.default_rng(3)
    xy = grid(80, 70, rng)
    true = np.c_[xy, waves(*xy.T)]
    faces = segment(noisy(true, rng, noise))
    size = np.bincount(faces.label[faces.label >= 0])
    assert faces.by_edges  # a crease would have been a border
    assert faces.fits[0].shape.kind == "bspline"
    assert size[0] > 0.97 * len(xy)
    assert np.sqrt(np.mean(faces.fits[0].shape.distance(true[faces.label == 0]) ** 2)) < 0.5 * noise


def test_a_wavy_sheet_ends_at_a_crease():
    """The wall beside it is a plane; its foot follows the waves."""
    rng = np.random.default_rng(5)
    xy = grid(70, 60, rng)
    top = np.c_[xy, waves(*xy.T)]
    yz = grid(60, 40, rng)
    wall = np.c_[np.zeros(len(yz)), yz[:, 0], waves(0.0, yz[:, 0]) - yz[:, 1]]
    points = noisy(np.concatenate([top, wall]), rng)
    truth = np.repeat([0, 1], [len(top), len(wall)])
    faces = segment(points)
    kinds = {}
    for k in (0, 1):
        own = np.bincount(faces.label[(truth == k) & (faces.label >= 0)], minlength=len(faces.fits))
        assert own.max() > 0.95 * np.sum(truth == k)
        kinds[k] = faces.fits[int(own.argmax())].shape.kind
    assert kinds == {0: "bspline", 1: "plane"}


def test_a_large_plane_is_one_face():
    """Not several that nearly coincide, of which each point chose the nearer."""
    rng = np.random.default_rng(7)
    xy = grid(150, 110, rng)
    faces = segment(noisy(np.c_[xy, np.zeros(len(xy))], rng))
    assert [fit.shape.kind for fit in faces.fits] == ["plane"]


def test_tangency_is_doubted_where_it_does_not_hold():
    rng = np.random.default_rng(11)
    xy = grid(40, 40, rng)
    angle = np.linspace(0.0, 0.5 * np.pi, 32)[rng.integers(0, 32, 1200)] + rng.uniform(0, 0.04, 1200)
    along = 40 * rng.random(1200)
    floor = np.c_[xy[:, 0] + 20.0, xy[:, 1], np.zeros(len(xy))]
    fillet = np.c_[20 - 20 * np.sin(angle), along, 20 - 20 * np.cos(angle)]
    for lift, tangent in ((0.0, True), (0.6, False)):
        points = noisy(np.concatenate([floor, fillet + np.array([0.0, 0.0, lift])]), rng)
        label = np.repeat(np.arange(2, dtype=np.int32), [len(floor), len(fillet)])
        fits = [fit_shape(kind, points[label == k], noise=NOISE) for k, kind in enumerate(("plane", "cylinder"))]
        doubt = doubt_tangency(points, label, fits, [(1, 0)], noise=NOISE, h=1.0)
        assert (doubt[0, 1] <= 1.0) is tangent
    two = [fits[0], fits[0]]
    assert doubt_tangency(points, label, two, [(0, 1)], noise=NOISE, h=1.0) == {(0, 1): np.inf}


def blade(rng, opening):
    """Two planes that meet in an edge and open by some degrees: points, labels, fits."""
    xy = grid(40, 60, rng)
    slope = np.tan(np.radians(0.5 * opening))
    sides = [np.c_[xy, s * slope * xy[:, 0]] for s in (1.0, -1.0)]
    points = noisy(np.concatenate(sides), rng)
    label = np.repeat(np.arange(2, dtype=np.int32), len(xy))
    return points, label, tuple(fit_shape("plane", points[label == k], noise=NOISE) for k in (0, 1))


def test_the_sides_of_a_blade_do_not_meet_smoothly():
    points, label, fits = blade(np.random.default_rng(1), opening=10.0)
    scale = measure_scale(points)
    assert smooth_contacts(points, label, face_contacts(label, scale), fits, scale) == ()


def test_the_sides_of_a_shallow_ridge_do():
    points, label, fits = blade(np.random.default_rng(1), opening=10.0)
    points[label == 1, 0] *= -1.0
    fits = tuple(fit_shape("plane", points[label == k], noise=NOISE) for k in (0, 1))
    scale = measure_scale(points)
    found = smooth_contacts(points, label, face_contacts(label, scale), fits, scale)
    assert [contact.pair for contact in found] == [(0, 1)]


def test_charts_see_one_side_each():
    """A tube of twelve strips falls into charts that bend by less than told, and every strip is in one."""
    rng = np.random.default_rng(2)
    uv = grid(120, 30, rng)
    angle = uv[:, 0] / 120 * 2 * np.pi
    radius = 120 / (2 * np.pi)
    points = np.c_[radius * np.cos(angle), radius * np.sin(angle), uv[:, 1]]
    label = (uv[:, 0] // 10).astype(np.int32)
    fits = tuple(fit_shape("cylinder", points[label == k], noise=0.02) for k in range(12))
    scale = measure_scale(points)
    contacts = face_contacts(label, scale)
    smooth = list(smooth_contacts(points, label, contacts, fits, scale))
    turns = turns_of(points, fits, smooth, [])
    assert set(turns.sides(range(12)).values()) == {1.0}  # all around the tube
    found = charts(points, label, fits, list(range(12)), smooth, turns, 65.0)
    assert sorted(m for chart in found for m in chart) == list(range(12))
    assert 3 <= len(found) <= 6
    assert max(map(len, found)) <= 4


def test_what_turns_back_has_its_normals_on_the_other_side():
    points, label, fits = blade(np.random.default_rng(1), opening=10.0)
    scale = measure_scale(points)
    smooth, back = parted_contacts(points, label, face_contacts(label, scale), fits, scale)
    assert (smooth, [contact.pair for contact in back]) == ((), [(0, 1)])
    above, below = (fit.shape.normal(points[label == k])[0, 2] for k, fit in enumerate(fits))
    sides = turns_of(points, fits, smooth, back).sides([0, 1])
    assert sides[0] * above * sides[1] * below < 0


def test_the_longest_borders_tell_the_sides():
    """Around three pieces an odd number of turns cannot hold: the shortest border does not count, nor do those to other pieces."""
    turns = Turns(((0, 1, 90, -1.0), (1, 2, 80, 1.0), (2, 3, 50, -1.0), (0, 2, 10, 1.0)))
    assert turns.sides([0, 1, 2]) == {0: 1.0, 1: -1.0, 2: -1.0}
    assert turns.sides([0, 2]) == {0: 1.0, 2: 1.0}
    assert turns.sides([1, 2, 3]) == {1: 1.0, 2: 1.0, 3: -1.0}


def test_the_sides_of_a_blade_are_two_charts_though_a_few_points_say_that_they_meet_smoothly():
    points, label, fits = blade(np.random.default_rng(1), opening=10.0)
    scale = measure_scale(points)
    _, back = parted_contacts(points, label, face_contacts(label, scale), fits, scale)
    few = [Contact((0, 1), (back[0].sides[0][:5], back[0].sides[1][:5]))]
    for turned, expected in ((back, [[0], [1]]), ([], [[0, 1]])):
        assert charts(points, label, fits, [0, 1], few, turns_of(points, fits, few, turned), 65.0) == expected
