"""Narrow fillets end where a ball touches the two faces that it rolls along, whatever surface the strip's own points gave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scan2nurbs.faces.contacts import face_contacts
from scan2nurbs.faces.fillets import find_fillets
from scan2nurbs.faces.rolling import Corner, corner_of
from scan2nurbs.faces.settle import settle_borders
from scan2nurbs.faces.strips import settle_strips
from scan2nurbs.kernels.primitives import CYLINDER, PLANE, SIZE
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from sheet_samples import sheet_of
from test_settle import LENGTH, NOISE, as_fit, profile, surfaces, wrong

UP, ALONG = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def too_short(true, points):
    """Labels of a strip that lost a third of its points, on the side of the first face."""
    label = true.copy()
    strip = np.flatnonzero(true == 1)
    label[strip[points[strip, 0] < np.quantile(points[strip, 0], 1 / 3)]] = 0
    return label


@pytest.mark.parametrize("degrees", [60, 90, 120])
@pytest.mark.parametrize("radius", [2.5, 4.0])
def test_a_strip_that_ends_too_early_is_a_fillet_again(degrees, radius):
    rng = np.random.default_rng(int(10 * radius) + degrees)
    points, true = profile(np.radians(degrees), radius, rng)
    flat, arc, rising = surfaces(np.radians(degrees), radius)
    wide = as_fit(Cylinder(arc.shape.point + np.array([0.0, 0.0, 0.35 * radius]), ALONG, 1.3 * radius))  # as the other points have it
    scale, given = measure_scale(points), too_short(true, points)
    label, settled = settle_strips(points, given, [flat, wide, rising], face_contacts(given, scale), scale.h, NOISE)
    assert settled == {(0, 1), (1, 2)}
    assert wrong(given, true) > 0.25 * (true == 1).sum()
    # 0.3 of a spacing along both lines of contact.
    assert wrong(label, true) < 0.6 * LENGTH
    assert np.array_equal(settle_borders(points, given, [flat, wide, rising], scale, NOISE), label)


def test_a_chamfer_stays_as_it_is():
    rng = np.random.default_rng(3)
    s, y = rng.uniform(0.0, 45.0, 45 * LENGTH), rng.uniform(0.0, LENGTH, 45 * LENGTH)
    true = np.where(s < 20, 0, np.where(s < 25, 1, 2)).astype(np.int32)
    slope, top = np.sqrt(0.5), 5.0 * np.sqrt(0.5)
    across, rise = np.clip(s - 20, 0, 5), np.maximum(s - 25, 0)
    points = np.column_stack([np.minimum(s, 20) + slope * across, y, slope * across + rise])
    points += rng.normal(scale=NOISE, size=points.shape)
    flat, rising = Plane(np.array([20.0, 0.0, 0.0]), UP), Plane(np.array([20.0 + top, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    bevel = Plane(np.array([20.0, 0.0, 0.0]), np.array([-slope, 0.0, slope]))
    scale = measure_scale(points)
    label, settled = settle_strips(points, true, [as_fit(flat), as_fit(bevel), as_fit(rising)], face_contacts(true, scale), scale.h, NOISE)
    assert settled == frozenset()
    assert np.array_equal(label, true)


def test_a_wide_fillet_is_told_by_its_own_points():
    points, true = profile(np.radians(90.0), 10.0, np.random.default_rng(5))
    scale = measure_scale(points)
    _, settled = settle_strips(points, true, surfaces(np.radians(90.0), 10.0), face_contacts(true, scale), scale.h, NOISE)
    assert settled == frozenset()


def test_a_strip_of_the_wrong_surface_becomes_the_fillet_between_its_neighbours():
    radius = 3.0
    points, true = profile(np.radians(90.0), radius, np.random.default_rng(7))
    label = too_short(true, points)
    sheet, order = sheet_of(points, NOISE)
    sheet = replace(sheet, normals=np.where(true[order, None] == 2, np.array([-1.0, 0.0, 0.0]), UP))
    models = np.zeros((3, SIZE))
    models[:, 0] = PLANE, CYLINDER, PLANE
    models[0, 1:7], models[2, 1:7] = [20.0, 0.0, 0.0, *UP], [20.0 + radius, 0.0, radius, -1.0, 0.0, 0.0]
    models[1, 1:8] = [20.0, 0.0, 1.35 * radius, *ALONG, 1.3 * radius]
    again, found, grown = find_fillets(sheet, label[order], models)
    assert len(grown) == 4
    assert int(grown[3, 0]) == CYLINDER
    assert grown[3, 7] == pytest.approx(radius, abs=0.2)
    assert wrong(np.where(found == 3, 1, found), true[order]) < 0.6 * LENGTH
    assert not np.isnan(again.normals).any(), "a strip that grew by its normals keeps them"


def test_points_of_a_fillet_are_off_it_by_nothing():
    angle = np.linspace(0.05, 0.45, 9) * np.pi
    radius = 2.0
    points = np.column_stack([radius * (1 - np.sin(angle)), np.zeros(9), radius * (1 - np.cos(angle))])
    fields = [np.column_stack([points[:, axis], np.tile(np.eye(3)[axis], (9, 1))]) for axis in (0, 2)]
    corner = corner_of(*fields, np.array([0, 0, 0, 2, 2, 2, 1, 1, 1]))
    assert isinstance(corner, Corner)
    np.testing.assert_allclose(corner.off(radius), 0.0, atol=1e-12)
    assert corner.zone(radius).all()
    assert not corner.zone(0.1 * radius).any()
    found, gain = corner.best_radius(corner.sharp, 0.01)
    assert found == pytest.approx(radius, rel=0.04)
    assert gain > 0.0


def test_faces_that_hardly_turn_are_no_corner():
    flat = np.column_stack([np.ones(4), np.tile(UP, (4, 1))])
    tilted = np.column_stack([np.ones(4), np.tile([0.0, np.sin(0.2), np.cos(0.2)], (4, 1))])
    assert corner_of(flat, tilted, np.array([0, 0, 1, 1])) is None


def test_a_fillet_that_ends_is_not_led_on_beyond_its_end():
    radius = 3.0
    points, true = profile(np.radians(90.0), radius, np.random.default_rng(9))
    sharp, edge = profile(np.radians(90.0), 0.0, np.random.default_rng(10))
    sharp[:, 0] += radius  # where the two planes of the first half meet
    half = LENGTH / 2
    first, second = points[:, 1] < half, sharp[:, 1] > half
    cloud = np.vstack([points[first], sharp[second]])
    true = np.concatenate([true[first], edge[second]])
    flat, arc, rising = surfaces(np.radians(90.0), radius)
    scale = measure_scale(cloud)
    label, settled = settle_strips(cloud, true, [flat, arc, rising], face_contacts(true, scale), scale.h, NOISE)
    assert settled == {(0, 1), (1, 2)}
    assert np.count_nonzero((label == 1) & (cloud[:, 1] > half + 1.5)) == 0
