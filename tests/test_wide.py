"""Surfaces of faces, extended to where their borders lie and hardly farther."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep.wide import widened
from scan2nurbs.surfaces.bspline import bicubic
from scan2nurbs.surfaces.spline_shape import SplineShape


def bent_tube(begin: float, end: float) -> tuple[SplineShape, np.ndarray]:
    """A tube of radius 8 around most of a ring, and two of its rings (2, K, 3)."""
    angle, turn = np.linspace(0.0, 2.0 * np.pi, 33), np.linspace(0.0, 1.0, 30)

    def rings(at):
        bend = 4.0 * at
        spine = np.column_stack([40.0 * np.cos(bend), 40.0 * np.sin(bend), 0.0 * at])
        across = np.column_stack([np.cos(bend), np.sin(bend), 0.0 * at])
        offset = np.cos(angle)[:, None, None] * across + np.sin(angle)[:, None, None] * np.array([0.0, 0.0, 1.0])
        return spine + 8.0 * offset

    grid = rings(turn)
    grid[-1] = grid[0]
    shape = SplineShape(bicubic((angle, turn), grid, (True, False)))
    return shape, rings(np.array([begin, end])).transpose(1, 0, 2)


def test_a_surface_is_not_extended_farther_than_a_border_may_lie():
    """A tube that is extended by much of its length comes back to itself."""
    shape, ends = bent_tube(-0.1, 1.1)
    length = 40.0 * 4.0
    wide = widened(shape, ends.reshape(-1, 3), 0.5)
    assert wide.surface.closed == (True, False)
    low, high = wide.surface.domain[1]
    assert -8.0 / length < low < 0.0
    assert 1.0 < high < 1.0 + 8.0 / length


@pytest.mark.parametrize("beyond", [0.005, 0.012])
def test_borders_a_few_spacings_beyond_a_surface_are_reached(beyond):
    shape, ends = bent_tube(-beyond, 1.0 + beyond)
    wide = widened(shape, ends.reshape(-1, 3), 0.5)
    low, high = wide.surface.domain[1]
    assert low < -beyond
    assert high > 1.0 + beyond
    assert np.linalg.norm(wide.foot(ends.reshape(-1, 3)) - ends.reshape(-1, 3), axis=1).max() < 0.1
