"""Pieces of one surface that strips and profiles left behind are one region in the end."""

from __future__ import annotations

import numpy as np

from scan2nurbs.faces.primitives import _united
from scan2nurbs.kernels.primitives import PLANE, SIZE, SPHERE
from sheet_samples import sheet_of

NOISE = 0.25
KINDS = np.array([True, True, True, True, True, False])


def plane(normal, height=0.0):
    model = np.zeros(SIZE)
    model[0], model[1:4], model[4:7] = PLANE, height * np.array(normal), normal
    return model


def test_two_pieces_of_a_plane_become_one_and_their_neighbour_keeps_its_model():
    rng = np.random.default_rng(0)
    x, y = (v.ravel() + rng.uniform(-0.3, 0.3, 900) for v in np.meshgrid(np.arange(0.5, 30), np.arange(0.5, 30)))
    floor, wall = np.column_stack([x, y, 0.0 * x]), np.column_stack([0.0 * x, x, y + 0.5])
    points = np.vstack([floor, wall]) + rng.normal(scale=NOISE, size=(1800, 3))
    sheet, order = sheet_of(points, NOISE)
    label = np.where(order >= 900, 2, np.where(points[order, 1] < 12.0, 0, 1)).astype(np.int32)
    ball = np.zeros(SIZE)  # nearly the wall: what a fit anew would not leave
    ball[0], ball[1:4], ball[7] = SPHERE, [-5000.0, 15.0, 15.0], 5000.0
    models = np.array([plane([0.0, 0.01, 1.0]), plane([0.0, -0.01, 1.0]), ball])
    found, joined = _united(sheet, label, models, KINDS)
    assert len(np.unique(found[order < 900])) == 1
    assert (found[order >= 900] == 2).all()
    kept = int(found[order < 900][0])
    assert int(joined[kept, 0]) == PLANE
    assert abs(joined[kept, 6]) > 0.9999
    np.testing.assert_array_equal(joined[2], ball)
    np.testing.assert_array_equal(models[2], ball)
