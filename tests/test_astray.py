"""Which pieces are no primitives of the design: those that leave more than noise amid their points; and which may share a profile."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.astray import Amid, look_amid, one_sweep
from scan2nurbs.faces.contacts import face_contacts
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape_fit import fit_shape
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

NOISE = 0.25
X, Y, Z = np.eye(3)
O = np.zeros(3)  # noqa: E741 - the origin
NEAR = np.array([9.0, 2.0, 5.0])


def sheet(height, seed):
    """Points a unit apart with noise over a square, at heights by x."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))
    flat = np.c_[x.ravel(), y.ravel()] + rng.uniform(-0.25, 0.25, (3000, 2))
    return np.c_[flat, height(flat[:, 0])] + rng.normal(scale=NOISE, size=(3000, 3))


def chance(points, kind, label=None):
    label = np.zeros(len(points), np.int32) if label is None else label
    fits = tuple(fit_shape(kind, points[label == m], noise=NOISE) for m in range(label.max() + 1))
    return look_amid(points, label, fits, face_contacts(label, measure_scale(points)), NOISE)


@pytest.mark.parametrize("seed", range(6))
def test_a_cylinder_leaves_noise(seed):
    found = chance(sheet(lambda x: np.sqrt(80.0**2 - (x - 30.0) ** 2), seed), "cylinder")
    assert not found.astray(0)
    assert found.chance[0] > 1e-3


def test_what_bends_unevenly_is_no_cylinder():
    assert chance(sheet(lambda x: 70.0 + 4.0 * np.sin(x / 18.0), 1), "cylinder").astray(0)


def test_points_of_a_neighbour_along_the_border_do_not_count():
    points = sheet(lambda x: 8.0 * np.abs(x / 30.0 - 1.0), 2)
    label = (points[:, 0] > 28.5).astype(np.int32)  # a column and a half of points is given to the wrong plane
    found = chance(points, "plane", label)
    assert not found.astray(0)
    assert not found.astray(1)


def test_of_few_points_nothing_is_known():
    points = sheet(lambda x: 0.0 * x, 3)[:90]
    found = chance(points, "plane")
    assert found.count[0] == 0
    assert found.chance[0] == 1.0


@pytest.mark.parametrize(
    ("chances", "counts", "likely"),
    [
        ((1e-8, 1e-8), (500, 500), True),
        ((1e-8, 0.4), (500, 100), True),  # too few to speak for a primitive
        ((1e-8, 0.4), (500, 400), False),
        ((1e-8, 1.0), (500, 0), True),  # nothing known
        ((1e-8, 1e-3), (500, 400), True),  # not sound itself
        ((0.4, 1e-8), (100, 500), True),  # the other way about
        ((0.4, 0.4), (500, 500), False),
    ],
)
def test_a_sound_neighbour_counts_by_its_points(chances, counts, likely):
    assert Amid(np.array(chances), np.array(counts)).likely((0, 1)) is likely


TURNED = Torus(np.array([0.0, 0.3, 9.0]), Z, 9.0, 3.0)


@pytest.mark.parametrize(
    ("one", "other", "together"),
    [
        (Cylinder(O, Z, 9.0), Cone(5.0 * Z, Z, 9.0, 0.2), True),
        (Cylinder(O, Z, 9.0), TURNED, True),
        (Cylinder(3.0 * X, Z, 9.0), TURNED, False),
        (Cylinder(O, Z, 9.0), Cylinder(20.0 * X, -Z, 11.0), True),  # drawn along Z
        (Cylinder(O, Z, 9.0), Cylinder(O, X, 9.0), False),
        (Cone(O, Z, 9.0, 0.2), Cone(20.0 * X, Z, 9.0, 0.3), False),
        (Sphere(4.0 * Z, 9.0), TURNED, True),
        (Sphere(4.0 * X, 9.0), TURNED, False),
        (Sphere(O, 9.0), Sphere(4.0 * X, 9.0), False),
        (Plane(O, Z), TURNED, True),  # a flange of it
        (Plane(O, X), TURNED, False),
        (Plane(O, X), Cylinder(O, Z, 9.0), True),  # a wall drawn along Z
        (Plane(O, X), Plane(O, Z), False),
    ],
)
def test_primitives_of_one_profile(one, other, together):
    assert one_sweep(one, other, NEAR, 1.0) is together
    assert one_sweep(other, one, NEAR, 1.0) is together


def test_a_freeform_piece_is_of_no_profile():
    points = sheet(lambda x: 70.0 + 4.0 * np.sin(x / 18.0), 1)
    assert not one_sweep(fit_shape("bspline", points, noise=NOISE).shape, Cylinder(O, Z, 9.0), NEAR, 1.0)
