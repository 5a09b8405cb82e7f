"""Borders as the mesh draws them, laid as curves on both of their surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep.borders import lay_borders
from scan2nurbs.faces.complex import Border
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane

X, Y, Z = np.eye(3)


def arc(angles: np.ndarray) -> np.ndarray:
    return 20.0 * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])


@pytest.mark.parametrize("hooked", ["neither", "start", "end", "both"])
def test_a_border_that_turns_back_at_its_end_is_followed_all_the_same(hooked):
    """The mesh leads it a few steps beyond its vertex and back."""
    hook, way = np.linspace(0.18, 0.05, 8)[:-1], np.linspace(0.05, 2.0, 80)
    angles = np.concatenate([hook if hooked in ("start", "both") else [], way, 2.05 - hook[::-1] if hooked in ("end", "both") else []])
    border = Border(arc(angles), (0, 1), (0, 1))
    shapes = [Plane(np.zeros(3), Z), Cylinder(np.zeros(3), Z, 20.0)]
    (curve,), vertices = lay_borders([border], arc(angles[[0, -1]]), shapes, 1.0)
    assert curve.curve.kind == "circle"
    assert curve.gap < 1e-6
    along = curve.curve(curve.curve.samples(50))
    np.testing.assert_allclose(along[[0, -1]], vertices, atol=0.01)
    assert np.linalg.norm(np.diff(along, axis=0), axis=1).sum() == pytest.approx(20.0 * abs(angles[-1] - angles[0]), abs=0.1)
