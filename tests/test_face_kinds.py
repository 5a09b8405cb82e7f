"""Kinds of faces: the plainest that the points amid a face ask for."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.compete import Sheet, fit_regions, link_weights
from scan2nurbs.faces.finish import face_fits, swept_fits
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.primitives import CYLINDER, SIZE, SPHERE
from scan2nurbs.surfaces.shape import KINDS
from scan2nurbs.surfaces.shape_fit import fit_shape

NOISE = 0.25


def grid(rng, width, depth):
    """Points, one per unit of area, on [0, width] × [0, depth]."""
    u, v = np.meshgrid(np.arange(0.5, width), np.arange(0.5, depth), indexing="ij")
    return np.column_stack([(u + rng.uniform(-0.25, 0.25, u.shape)).ravel(), (v + rng.uniform(-0.25, 0.25, v.shape)).ravel()])


def ring_with_fillet(rng):
    """A plane ring between radii 15 and 30, and outside of it the first third of a fillet of radius 6 that bends upwards."""
    around, out = (grid(rng, 2 * np.pi * 22.5, 15) * [1 / 22.5, 1]).T
    flat = np.column_stack([(15 + out) * np.cos(around), (15 + out) * np.sin(around), np.zeros_like(out)])
    around, bend = (grid(rng, 2 * np.pi * 31, 3) * [1 / 31, 1 / 6]).T
    radius = 30 + 6 * np.sin(bend)
    fillet = np.column_stack([radius * np.cos(around), radius * np.sin(around), 6 - 6 * np.cos(bend)])
    points = np.vstack([flat, fillet])
    return points + rng.normal(scale=NOISE, size=points.shape)


def ball(rng):
    """A cap of a ball of radius 40."""
    x, y = (grid(rng, 30, 30) - 15).T
    points = np.column_stack([x, y, np.sqrt(40.0**2 - x**2 - y**2)])
    return points + rng.normal(scale=NOISE, size=points.shape)


def sphere(center, radius):
    model = np.zeros(SIZE)
    model[0], model[1:4], model[6], model[7] = SPHERE, center, 1.0, radius
    return model


@pytest.mark.parametrize("seed", range(3))
def test_a_ring_with_some_of_its_fillet_is_a_plane_and_a_ball_a_ball(seed):
    rng = np.random.default_rng(seed)
    points = [ring_with_fillet(rng), ball(rng)]
    label = np.repeat(np.arange(2, dtype=np.int32), [len(p) for p in points])
    points = np.vstack(points)
    models = np.array([sphere([0.0, 0.0, 150.0], 149.0), sphere([0.0, 0.0, 0.0], 40.0)])
    ring, cap = face_fits(points, np.full(points.shape, np.nan), label, models, NOISE, 1.0, KINDS)
    assert ring.shape.kind == "plane"
    assert np.degrees(np.arccos(abs(ring.shape.direction[2]))) < 0.2
    assert cap.shape.kind == "sphere"
    assert abs(cap.shape.radius - 40.0) < 0.5


def test_kinds_that_were_not_asked_for_are_not_tried():
    points = ring_with_fillet(np.random.default_rng(0))
    label = np.zeros(len(points), np.int32)
    models = sphere([0.0, 0.0, 150.0], 149.0)[None]
    (fit,) = face_fits(points, np.full(points.shape, np.nan), label, models, NOISE, 1.0, ["sphere", "torus"])
    assert fit.shape.kind == "sphere"


def cylinder(point, axis, radius):
    model = np.zeros(SIZE)
    model[0], model[1:4], model[4:7], model[7] = CYLINDER, point, axis, radius
    return model


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("kinds", "kind"), [(KINDS, "plane"), (["cylinder"], "cylinder")])
def test_a_strip_does_not_determine_a_radius_that_is_lost_in_its_noise(seed, kinds, kind):
    rng = np.random.default_rng(seed)
    u, v = grid(rng, 20, 4).T
    points = np.column_stack([u, v, np.zeros_like(u)]) + rng.normal(scale=0.5, size=(len(u), 3))
    models = cylinder([0.0, 2.0, -1.2], [1.0, 0.0, 0.0], 1.2)[None]
    (fit,) = face_fits(points, np.full(points.shape, np.nan), np.zeros(len(points), np.int32), models, 0.5, 1.0, kinds)
    assert fit.shape.kind == kind


@pytest.mark.parametrize("seed", range(4))
def test_a_narrow_band_is_of_a_cylinder_not_of_a_sphere(seed):
    rng = np.random.default_rng(seed)
    around, along = (grid(rng, 60, 6) * [1 / 46, 1]).T
    points = np.column_stack([46 * np.cos(around), 46 * np.sin(around), along]) + rng.normal(scale=NOISE, size=(len(along), 3))
    cells = build_cells(points, 2.0)
    neighbours, _ = nearest_neighbours(cells, 12)
    points = cells.points
    normals = np.column_stack([points[:, :2] / np.linalg.norm(points[:, :2], axis=1)[:, None], np.zeros(len(points))])
    sheet = Sheet(points, normals, neighbours, link_weights(normals, neighbours), NOISE, 0.12)
    models = sphere([0.0, 0.0, 3.0], 46.0)[None].copy()
    fit_regions(sheet, np.zeros(len(points), np.int32), models, np.ones(6, np.bool_))
    assert models[0, 0] == CYLINDER


def vessel(rng):
    """A turned wall: its radius swells and shrinks along the axis."""
    around, along = (grid(rng, 180, 60) * [2 * np.pi / 180, 1]).T
    radius = 28 + 5 * np.sin(along / 12)
    points = np.column_stack([radius * np.cos(around), radius * np.sin(around), along])
    return points + rng.normal(scale=NOISE, size=points.shape)


def wavy_sheet(rng):
    """A height field with waves in either direction, of different lengths: nothing swept."""
    x, y = grid(rng, 60, 60).T
    points = np.column_stack([x, y, 3 * np.sin(x / 9) * np.cos(y / 13) + 0.02 * (x - 30) * (y - 20)])
    return points + rng.normal(scale=NOISE, size=points.shape)


def test_turned_faces_are_revolutions_and_wavy_ones_stay_free():
    rng = np.random.default_rng(1)
    points = [vessel(rng), wavy_sheet(rng)]
    label = np.repeat(np.arange(2, dtype=np.int32), [len(p) for p in points])
    free = [fit_shape("bspline", p, noise=NOISE) for p in points]
    points = np.vstack(points)
    turned, wavy = swept_fits(points, label, free, NOISE, KINDS)
    assert turned.shape.kind == "revolution"
    assert np.degrees(np.arccos(abs(turned.shape.axis[2]))) < 0.2
    assert turned.criterion < free[0].criterion
    assert wavy is free[1]
    assert swept_fits(points, label, free, NOISE, ["plane", "bspline"]) == tuple(free)
