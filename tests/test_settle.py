"""Which of two faces a point beside their border belongs to."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.compete import plainest_models
from scan2nurbs.faces.primitives import _fillets
from scan2nurbs.faces.settle import _kept, settle_borders
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, SIZE, SPHERE
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape_result import ShapeFit
from sheet_samples import sheet_of

NOISE = 0.25
LENGTH = 60


def profile(turn, radius, rng):
    """A strip of an extruded profile: 20 along x, an arc that turns by `turn` with this radius, 20 straight on; with each point's piece."""
    arc = turn * radius
    s, y = (v.ravel() for v in np.meshgrid(np.arange(0.5, 40 + arc), np.arange(0.5, LENGTH), indexing="ij"))
    s, y = s + rng.uniform(-0.4, 0.4, s.shape), y + rng.uniform(-0.4, 0.4, y.shape)
    piece = np.where(s < 20, 0, np.where(s < 20 + arc, 1, 2)).astype(np.int32)
    a = np.clip((s - 20) / max(radius, 1e-9), 0.0, turn)
    beyond = np.maximum(s - 20 - arc, 0.0)
    x = np.minimum(s, 20.0) + radius * np.sin(a) + beyond * np.cos(turn)
    z = radius * (1 - np.cos(a)) + beyond * np.sin(turn)
    points = np.column_stack([x, y, z])
    return points + rng.normal(scale=NOISE, size=points.shape), piece


def as_fit(shape):
    return ShapeFit(shape=shape, n_points=100, rms=NOISE, covariance=None, criterion=0.0)


def surfaces(turn, radius):
    end = np.array([20 + radius * np.sin(turn), 0.0, radius * (1 - np.cos(turn))])
    flat = Plane(point=np.array([20.0, 0.0, 0.0]), direction=np.array([0.0, 0.0, 1.0]))
    rising = Plane(point=end, direction=np.array([-np.sin(turn), 0.0, np.cos(turn)]))
    arc = Cylinder(point=np.array([20.0, 0.0, radius]), axis=np.array([0.0, 1.0, 0.0]), radius=max(radius, 1.0))
    return [as_fit(flat), as_fit(arc), as_fit(rising)]


def nearest(points, fits, label):
    d = np.abs(np.stack([fit.shape.distance(points) for fit in fits]))
    return np.argmin(np.where(np.isin(np.arange(len(fits)), np.unique(label))[:, None], d, np.inf), axis=0).astype(np.int32)


def wrong(found, true):
    return int((found != true).sum())


@pytest.mark.parametrize("degrees", [15, 45, 90, 120])
def test_points_beside_a_crease_get_the_face_on_their_side(degrees):
    rng = np.random.default_rng(degrees)
    turn = np.radians(degrees)
    points, true = profile(turn, 0.0, rng)
    fits, scale = surfaces(turn, 0.0), measure_scale(points)
    given = nearest(points, fits, true)
    found = settle_borders(points, given, fits, scale, NOISE)
    # At a right angle the nearest surface is as good.
    assert wrong(found, true) < (0.6 * wrong(given, true) if degrees < 30 else 1.2 * wrong(given, true))
    # No point is known better than by its noise along the surface: 0.2 of a spacing is about twelve of the sixty on either side.
    assert wrong(found, true) < 0.45 * LENGTH


@pytest.mark.parametrize("radius", [3.0, 6.0])
def test_points_beside_a_line_of_contact_get_the_face_on_their_side(radius):
    rng = np.random.default_rng(int(radius))
    points, true = profile(np.pi / 2, radius, rng)
    fits, scale = surfaces(np.pi / 2, radius), measure_scale(points)
    given = nearest(points, fits, true)
    found = settle_borders(points, given, fits, scale, NOISE)
    assert wrong(found, true) < 0.6 * wrong(given, true)


@pytest.mark.parametrize("degrees", [15, 90])
def test_labels_that_are_right_stay_right(degrees):
    turn = np.radians(degrees)
    points, true = profile(turn, 0.0, np.random.default_rng(1))
    found = settle_borders(points, true, surfaces(turn, 0.0), measure_scale(points), NOISE)
    assert wrong(found, true) < 0.45 * LENGTH


def test_pieces_of_one_plane_and_points_without_a_face_are_left_alone():
    points, true = profile(0.0, 0.0, np.random.default_rng(2))
    label = np.where(points[:, 1] < 30, true, -1).astype(np.int32)
    found = settle_borders(points, label, surfaces(0.0, 0.0), measure_scale(points), NOISE)
    assert (found[label < 0] == -1).all()
    assert wrong(found, label) < 0.1 * len(label)


def test_a_surface_that_does_not_fit_takes_no_points():
    points, true = profile(np.radians(60), 0.0, np.random.default_rng(3))
    fits = surfaces(np.radians(60), 0.0)
    fits[2] = as_fit(Plane(point=np.array([14.0, 0.0, 0.0]), direction=fits[2].shape.direction))
    found = settle_borders(points, true, fits, measure_scale(points), NOISE)
    assert wrong(found, true) < 0.45 * LENGTH


def test_no_face_loses_half_of_its_points():
    label = np.array([0, 0, 0, 1, 1, 1, -1], np.int32)
    np.testing.assert_array_equal(_kept(label, np.array([1, 1, 0, 1, 1, 1, -1], np.int32), 2), label)
    moved = np.array([0, 0, 1, 1, 1, 0, -1], np.int32)
    np.testing.assert_array_equal(_kept(label, moved, 2), moved)


def test_what_passes_for_a_sphere_with_its_fillets_is_a_cylinder_amid_them():
    rng = np.random.default_rng(5)
    s, angle = (v.ravel() for v in np.meshgrid(np.arange(-8.0, 8.5), np.arange(0.0, 40 * np.pi), indexing="ij"))
    inward = np.where(np.abs(s) > 6, 0.25 * (np.abs(s) - 6) ** 2, 0.0)  # a ring of radius 20 that bends inwards at its ends
    r = 20 - inward + rng.normal(scale=NOISE, size=s.shape)
    points = np.column_stack([r * np.cos(angle / 20), r * np.sin(angle / 20), s])
    sheet, _ = sheet_of(points, NOISE)
    ball, tiled = np.zeros(SIZE), np.zeros(SIZE)
    ball[0], ball[6], ball[7] = SPHERE, 1.0, 20.5
    tiled[0] = PATCH
    kinds = np.ones(6, bool)
    label = np.zeros(len(points), np.int32)
    found = plainest_models(sheet, label, ball[None], kinds)
    assert int(found[0, 0]) == CYLINDER
    assert abs(found[0, 7] - 20.0) < 0.2
    assert abs(found[0, 6]) > 0.999
    # Patches, and regions too small to tell, keep their models.
    np.testing.assert_array_equal(plainest_models(sheet, label, tiled[None], kinds), tiled[None])
    few = np.where(np.arange(len(points)) < 40, 0, -1).astype(np.int32)
    np.testing.assert_array_equal(plainest_models(sheet, few, ball[None], kinds), ball[None])
    # Where no fillet is beside it, a region keeps its model whatever its middle asks for.
    np.testing.assert_array_equal(_fillets(sheet, label, ball[None], kinds)[2], ball[None])
