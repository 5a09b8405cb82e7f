"""Rings of a face in its parameters: the region between them, whichever period its parameters lie in."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep.charts import chart_of
from scan2nurbs.brep.layout import Layout
from scan2nurbs.brep.regions import Side, Step, regions
from scan2nurbs.surfaces.torus import Torus

TURN = 2.0 * np.pi


@pytest.mark.parametrize("shift", [0.0, -TURN, TURN])
@pytest.mark.parametrize("begin", [0.6, 5.9])
def test_two_rings_around_a_torus_bound_the_strip_between_them(begin, shift):
    chart = chart_of(Torus(center=np.zeros(3), axis=np.array([0.0, 0.0, 1.0]), major=14.0, minor=7.0), 1.0)
    u = np.linspace(0.0, TURN, 40)
    low = np.c_[u, np.full(40, begin + shift)]
    high = np.c_[u[::-1], np.full(40, begin + shift + 0.4)]
    found = regions(Layout(chart, (True, False), (0.0, begin - 1.0)), [[Step(0, True, low, (0, 0))], [Step(1, True, high, (1, 1))]])
    assert len(found) == 1
    (wire,) = found[0]
    assert sorted(part.piece for part in wire if isinstance(part, Step)) == [0, 1]
    assert sum(isinstance(part, Side) for part in wire) == 2
    line = np.vstack([part.path for part in wire])
    x, y = line.T
    assert 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) == pytest.approx(0.4 * TURN)
