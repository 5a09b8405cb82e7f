"""Borders that cross are found, but for loops that are shorter than triangles."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep import shared
from scan2nurbs.brep.crossing import borders_cross
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.occ import silence, to_surface
from scan2nurbs.brep.overlay import crossings
from scan2nurbs.brep.solids import compound
from scan2nurbs.brep.viewed import unseen
from scan2nurbs.surfaces.bspline import bicubic
from test_join import polygon
from test_part import rod


def sheet(*wires):
    """A face of a slightly bent B-spline surface of 10 by 10 within polygons given in its parameters, which are nearly lengths."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepLib import BRepLib
    from OCP.Geom2d import Geom2d_Line
    from OCP.gp import gp_Dir2d, gp_Pnt2d

    silence()
    u = np.linspace(0.0, 10.0, 6)
    grid = np.stack(np.meshgrid(u, u, indexing="ij"), axis=2)
    surface = to_surface(bicubic((u, u), np.dstack([grid, 0.002 * grid[..., 0] ** 2]), (False, False)))
    made = None
    for corners in wires:
        wire = BRepBuilderAPI_MakeWire()
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            step = np.subtract(b, a, dtype=float)
            line = Geom2d_Line(gp_Pnt2d(*map(float, a)), gp_Dir2d(*step.tolist()))
            wire.Add(BRepBuilderAPI_MakeEdge(line, surface, 0.0, float(np.linalg.norm(step))).Edge())
        made = BRepBuilderAPI_MakeFace(surface, wire.Wire(), False) if made is None else made
        if corners is not wires[0]:
            made.Add(wire.Wire())
    face = made.Face()
    BRepLib.BuildCurves3d_s(face)
    return face


OUTER = [(1, 1), (9, 1), (9, 9), (1, 9)]
TWISTED = [(1, 1), (9, 1), (9, 9), (3, 9), (3, 7), (4, 7), (4, 9.5), (1, 9.5)]
"""Its edges cross near (4, 9): the loop from there, by way of (3, 9) and (3, 7), and back is 6 long."""


@pytest.mark.parametrize(("least", "found"), [(0.5, True), (5.0, True), (8.0, False)])
def test_borders_that_cross_are_found_by_the_length_of_their_loop(least, found):
    assert borders_cross(sheet(TWISTED), least) is found


@pytest.mark.parametrize("least", [0.01, 1.0])
def test_borders_that_do_not_cross(least):
    assert not borders_cross(sheet(OUTER), least)
    assert not borders_cross(sheet(OUTER, [(3, 3), (3, 5), (5, 5), (5, 3)]), least)


def test_a_hole_that_crosses_its_border_does_so_at_any_length():
    assert borders_cross(sheet(OUTER, [(3, 3), (3, 9.5), (5, 9.5), (5, 3)]), 100.0)


def test_a_face_turned_over_is_the_same():
    from OCP.TopoDS import TopoDS

    assert not borders_cross(TopoDS.Face(sheet(OUTER).Reversed()), 0.1)
    assert borders_cross(TopoDS.Face(sheet(TWISTED).Reversed()), 0.1)


def test_seams_and_poles_do_not_cross():
    for face in rod().build().faces:
        assert not any(borders_cross(piece, 0.1) for piece in face.shapes)


def test_crossings_name_loops_and_segments():
    square, bow_tie = np.array([(0, 0), (4, 0), (4, 4), (0, 4.0)]), np.array([(9, 0), (12, 3), (12, 0), (9, 3.0)])
    assert crossings([square]) == []
    assert crossings([square, bow_tie]) == [(1, 0, 1, 2)]
    assert sorted(crossings([square, square + 1.0])) == [(0, 1, 1, 0), (0, 2, 1, 3)]


def test_a_tangled_face_is_lost_without_being_shown(monkeypatch):
    from scan2nurbs.brep import viewed

    shown = []
    monkeypatch.setattr(viewed, "_lost", lambda faces, *_: shown.append(sorted(faces)) or [])
    square, tangled = polygon([(20, 0), (29, 0), (29, 9), (20, 9)]), sheet(TWISTED)
    assert unseen([(square,), (tangled,)], compound([square, tangled])) == [1]
    assert shown == [[0]] * 5


def test_a_face_with_a_short_tangle_is_shown_with_triangles_of_a_least_size_alone(monkeypatch):
    from scan2nurbs.brep import viewed

    shown, curved, square = [], sheet(OUTER), polygon([(20, 0), (29, 0), (29, 9), (20, 9)])
    monkeypatch.setattr(viewed, "_lost", lambda faces, _deflection, _angle, least: shown.append((sorted(faces), least is not None)) or [])
    # A loop that is longer than the fine deflections, and shorter than four of them.
    size = (rough_area(curved) + rough_area(square)) ** 0.5
    monkeypatch.setattr(viewed, "longest_lobe", lambda _face, _step: 0.005 * size)
    assert unseen([(curved,), (square,)], compound([curved, square])) == []
    assert shown == [([0, 1], True)] * 2 + [([1], False)] * 3


def test_a_tangled_face_is_not_asked_for_fine_triangles(monkeypatch):
    asked = []
    monkeypatch.setattr(shared, "is_valid", lambda face: True)
    monkeypatch.setattr(shared, "is_valid_meshed", lambda face, every: asked.append(every) or True)
    tangled = sheet(TWISTED)
    assert shared._fault([tangled], True, 0.5) == "Its borders cross."
    assert (shared._fault([tangled], False, 0.5), shared._fault([tangled], True, 50.0)) == ("", "")
    assert asked == [False, True]


def test_a_plane_whose_borders_cross_is_shown_all_the_same(monkeypatch):
    from scan2nurbs.brep import viewed

    shown = []
    monkeypatch.setattr(viewed, "_lost", lambda faces, *_: shown.append(sorted(faces)) or [])
    bow_tie = polygon([(20, 0), (29, 9), (29, 0), (20, 9)])
    assert borders_cross(bow_tie, 1.0)
    assert unseen([(bow_tie,)], bow_tie) == []
    assert shown == [[0]] * 5
