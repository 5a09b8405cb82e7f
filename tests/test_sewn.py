"""Faces with outlines of their own: sewn to their neighbours within the tolerance, and only then."""

from __future__ import annotations

import numpy as np

from scan2nurbs.brep.check import check
from scan2nurbs.brep.sewn import sew
from scan2nurbs.brep.solids import assemble


def loose_box(gap):
    """The six faces of a box, each with edges of its own; the last one lies a gap off its place."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt

    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal, across = np.zeros(3), np.zeros(3)
            normal[axis], across[(axis + 1) % 3] = side, 1.0
            place = 5.0 * normal + (gap * normal if (axis, side) == (2, 1.0) else 0.0)
            plane = gp_Pln(gp_Ax3(gp_Pnt(*place), gp_Dir(*normal), gp_Dir(*across)))
            faces.append((BRepBuilderAPI_MakeFace(plane, -5.0, 5.0, -5.0, 5.0).Face(),))
    return faces


def test_faces_within_the_tolerance_become_a_closed_solid():
    faces = loose_box(0.05)
    assert assemble([face for (face,) in faces]).n_free_edges == 24
    sewn = sew(faces, 0.2)
    assert sewn is not None
    whole = assemble([face for pieces in sewn for face in pieces])
    assert (whole.n_free_edges, whole.n_solids) == (0, 1)
    found = check(whole.shape)
    assert found.valid
    assert found.max_tolerance <= 0.2
    assert abs(found.volume - 1000.0) < 10.0


def test_a_face_beyond_the_tolerance_stays_free():
    sewn = sew(loose_box(1.0), 0.2)
    assert sewn is not None
    assert assemble([face for pieces in sewn for face in pieces]).n_free_edges == 8


def test_nothing_is_sewn_where_nothing_meets():
    assert sew(loose_box(0.0)[:1], 0.2) is None
