"""Faces that are fitted anew by corrections: of the kinds that may be used, unless a correction says otherwise."""

from __future__ import annotations

import re

import numpy as np
import pytest

from scan2nurbs.errors import NoResultError
from scan2nurbs.part import PartParams, part_scan
from scan2nurbs.studio.edits import replay
from scan2nurbs.surfaces.shape import KINDS

ROOF = 12.0
"""Degrees between the two halves, so few that a merged roof is not torn apart."""


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    """A roof of two planes, 30 by 20 each, and noise."""
    rng = np.random.default_rng(3)
    u, v = np.meshgrid(np.arange(0.5, 60.0), np.arange(0.5, 20.0), indexing="ij")
    u, v = (w.ravel() + rng.uniform(-0.25, 0.25, w.size) for w in (u, v))
    z = -np.abs(u - 30.0) * np.tan(np.radians(ROOF))
    return np.column_stack([u, v, z + rng.normal(0, 0.02, len(u))])


def kinds_after(points: np.ndarray, kept: list[str] | None, *steps: dict) -> set[str]:
    """Return the kinds of the faces' surfaces after corrections, as a project or file of corrections has them."""
    keep = [{"set": {"stage": "segment", "name": "keep_types", "value": kept}}]
    params: PartParams = replay([*keep, *({"face": step} for step in steps)]).params
    return {fit.shape.kind for fit in part_scan(points, params).faces.fits}


TOLERANCE = {"tolerance": {"face": 0, "value": 0.05}}


@pytest.mark.parametrize("more", [[], [TOLERANCE]], ids=["merged", "with a tolerance"])
def test_merged_faces_are_of_the_kinds_that_may_be_used(points, more):
    merge = {"merge": [0, 1]}
    assert not kinds_after(points, None, merge, *more) & {"plane", "cone"}
    assert kinds_after(points, ["plane", "cone"], merge, *more) <= {"plane", "cone"}
    assert kinds_after(points, ["plane"], merge, *more) == {"plane"}


def test_a_kind_that_is_asked_for_outweighs_those_that_may_be_used(points):
    asked = {"type": {"face": 0, "kind": "bspline"}}
    assert kinds_after(points, ["plane"], asked) == {"plane", "bspline"}
    assert kinds_after(points, ["plane"], asked, TOLERANCE) == {"plane", "bspline"}


def test_where_nothing_fits_the_face_is_named(points):
    rows = {"indices": list(range(2))}
    for kept, wanted in ((["cylinder", "plane"], "plane or cylinder"), (list(KINDS), "surface")):
        with pytest.raises(NoResultError, match=re.escape(f"cannot be a {wanted}: ")):
            kinds_after(points, kept, {"split": {"face": int(part_scan(points).label[0]), **rows}})
