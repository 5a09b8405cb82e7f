"""The whole parts are what they say: valid, closed where they are solids, with as many bodies, and the same in the STEP file."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from scan2nurbs.brep.cad import load_cad, tessellate
from scan2nurbs.brep.check import check

sys.path.insert(0, str(Path(__file__).parents[1]))

from examples.parts import PARTS, WHOLE
from examples.parts.make_parts import write_parts


@pytest.mark.parametrize("name", WHOLE)
def test_part_is_a_valid_closed_solid(name):
    part = WHOLE[name]
    shape = part.build()
    found = check(shape)
    assert found.valid
    assert found.closed == (part.bodies > 0)
    assert _solids(shape) == part.bodies
    assert found.n_faces <= 60
    model = tessellate(shape)
    extent = np.ptp(model.corners.reshape(-1, 3), axis=0).max()
    assert found.max_tolerance < 1e-4 * extent
    # A typical face is wider than twelve spacings of a scan of 60,000 points.
    assert np.median(np.sqrt(model.face_area)) > 12 * np.sqrt(model.area / 60_000)


def test_there_are_enough_and_no_name_twice():
    assert len(WHOLE) >= 20
    assert not set(WHOLE) & set(PARTS)
    assert all(part.description.endswith(".") for part in WHOLE.values())


def test_the_file_holds_the_same_part(tmp_path):
    (path,) = write_parts(tmp_path, ["flange"])
    there, here = load_cad(path), tessellate(WHOLE["flange"].build())
    assert there.types == here.types
    assert there.face_area == pytest.approx(here.face_area, rel=1e-3)


def _solids(shape) -> int:
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    found, count = TopExp_Explorer(shape, TopAbs_SOLID), 0
    while found.More():
        count += 1
        found.Next()
    return count
