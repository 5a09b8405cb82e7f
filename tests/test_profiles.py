"""Regions that took in their narrow neighbours are divided along their profile."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.compete import grouped
from scan2nurbs.faces.profiles import _flattened, split_profiles
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, PLANE, SIZE
from sheet_samples import sheet_of

NOISE = 0.25
KINDS = np.array([True, True, True, True, True, False])


def plane(height=0.0):
    model = np.zeros(SIZE)
    model[0], model[3], model[6] = PLANE, height, 1.0
    return model


def axle(radius):
    model = np.zeros(SIZE)
    model[0], model[6], model[7] = CYLINDER, 1.0, radius
    return model


def ring(height, rng, turn=2 * np.pi):
    """A flat ring between radii 30 and 42 whose points rise by height(r), and the cylinder that it stands on."""
    r, angle = (v.ravel() for v in np.meshgrid(np.arange(30.5, 42), np.arange(0.0, turn * 36) / 36, indexing="ij"))
    r, angle = r + rng.uniform(-0.4, 0.4, r.shape), angle + rng.uniform(-0.4, 0.4, r.shape) / 36
    top = np.column_stack([r * np.cos(angle), r * np.sin(angle), height(r)])
    z, angle = (v.ravel() for v in np.meshgrid(np.arange(-9.5, -0.5), np.arange(0.0, turn * 30) / 30, indexing="ij"))
    wall = np.column_stack([30 * np.cos(angle), 30 * np.sin(angle), z])
    points = np.vstack([top, wall])
    return points + rng.normal(scale=NOISE, size=points.shape), len(top)


def divided(points, n_top, seed_model):
    sheet, order = sheet_of(points, NOISE)
    label = np.where(order < n_top, 0, 1).astype(np.int32)
    found, models = split_profiles(sheet, label, np.array([seed_model, axle(30.0)]), KINDS)
    return sheet, label, found, models


def test_a_ring_with_a_low_rib_is_three_rings():
    points, n = ring(lambda r: np.where(np.abs(r - 36) < 2, 0.7, 0.0), np.random.default_rng(0))
    sheet, label, found, models = divided(points, n, plane(0.2))
    pieces = np.unique(found[label == 0])
    assert len(pieces) == 3
    assert (found[label == 1] == 1).all()
    r = np.linalg.norm(sheet.points[:, :2], axis=1)
    for k in pieces:
        mine = found == k
        assert int(models[k, 0]) == PLANE
        assert abs(models[k, 6]) > 0.999
        assert abs(np.median(sheet.points[mine, 2]) - (0.7 if abs(np.median(r[mine]) - 36) < 1 else 0.0)) < 0.1
    rib = next(k for k in pieces if abs(np.median(r[found == k]) - 36) < 1)
    assert np.mean(np.abs(r[found == rib] - 36) < 2.6) > 0.95


@pytest.mark.parametrize("seed", range(4))
def test_what_one_surface_explains_is_left_whole(seed):
    points, n = ring(lambda r: 0.0 * r, np.random.default_rng(seed))
    _, label, found, models = divided(points, n, plane())
    np.testing.assert_array_equal(found, label)
    assert len(models) == 2


def test_a_short_arc_of_the_rib_does_not_pay_for_models():
    points, n = ring(lambda r: np.where(np.abs(r - 36) < 2, 0.3, 0.0), np.random.default_rng(1), turn=0.3)
    _, label, found, _ = divided(points, n, plane(0.1))
    np.testing.assert_array_equal(found, label)


def test_patches_are_left_alone():
    points, n = ring(lambda r: np.where(np.abs(r - 36) < 2, 0.7, 0.0), np.random.default_rng(2))
    patch = plane(0.2)
    patch[0] = PATCH
    _, label, found, _ = divided(points, n, patch)
    np.testing.assert_array_equal(found, label)


def test_an_extruded_strip_with_a_groove_is_three_strips():
    rng = np.random.default_rng(3)
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0.5, 12), np.arange(0.5, 80), indexing="ij"))
    top = np.column_stack([x, y, np.where(np.abs(x - 6) < 2, -0.7, 0.0)])
    z, y = (v.ravel() for v in np.meshgrid(np.arange(-9.5, -0.5), np.arange(0.5, 80), indexing="ij"))
    wall = np.column_stack([0.0 * z, y, z])
    points = np.vstack([top, wall]) + rng.normal(scale=NOISE, size=(len(top) + len(wall), 3))
    sheet, order = sheet_of(points, NOISE)
    label = np.where(order < len(top), 0, 1).astype(np.int32)
    side = plane()
    side[4:7] = [1.0, 0.0, 0.0]
    found, models = split_profiles(sheet, label, np.array([plane(-0.2), side]), KINDS)
    assert len(np.unique(found[label == 0])) == 3
    groove = [k for k in range(len(models)) if k != 1 and abs(np.median(sheet.points[found == k, 0]) - 6) < 1]
    assert len(groove) == 1
    assert abs(np.median(sheet.points[found == groove[0], 2]) + 0.7) < 0.15


def test_a_plane_takes_the_place_of_a_fit_that_went_astray_and_of_no_other():
    points, n = ring(lambda r: 0.0 * r, np.random.default_rng(4))
    sheet, order = sheet_of(points, NOISE)
    label = np.where(order < n, 0, 1).astype(np.int32)
    for astray in (axle(5.0), plane(9.0)):
        models, values = np.array([astray, axle(30.0)]), np.array([2.0 * n, 300.0])
        _flattened(sheet, grouped(label, 2), models, values)
        assert int(models[0, 0]) == PLANE
        assert abs(models[0, 6]) > 0.9999
        assert abs(models[0, 3]) < 0.05
        assert values[0] < 0.6 * n
        np.testing.assert_array_equal(models[1], axle(30.0))
        assert values[1] == 300.0
