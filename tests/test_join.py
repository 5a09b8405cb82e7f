"""Faces become shapes that are valid, also with triangles and in a file; what spoils them leaves its neighbours."""

from __future__ import annotations

import pytest

from scan2nurbs.brep import check as checks
from scan2nurbs.brep import endure, join
from scan2nurbs.brep.check import is_valid_meshed
from scan2nurbs.brep.endure import endures
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.errors import NoResultError
from test_part import box, rod


def polygon(corners):
    """A plane face within straight edges."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.gp import gp_Pln, gp_Pnt

    made = BRepBuilderAPI_MakePolygon()
    for x, y in corners:
        made.Add(gp_Pnt(float(x), float(y), 0.0))
    made.Close()
    return BRepBuilderAPI_MakeFace(gp_Pln(), made.Wire(), True).Face()


def test_what_comes_back_from_the_file_decides(monkeypatch):
    square = polygon([(0, 0), (10, 0), (10, 6), (0, 6)])
    assert endures(square)
    crossed = polygon([(0, 0), (10, 6), (10, 0), (0, 6)])
    monkeypatch.setattr(endure, "read_shape", lambda path: crossed)
    assert not endures(square)


def test_what_cannot_be_written_does_not_endure(monkeypatch):
    def refuse(*_, **__):
        raise KernelError("write STEP", "no")

    monkeypatch.setattr(endure, "write_step", refuse)
    assert not endures(polygon([(0, 0), (10, 0), (10, 6), (0, 6)]))


def test_a_body_endures():
    assert endures(box().build().shape)


@pytest.mark.parametrize("possible", ["coarse", "fine"])
def test_faces_need_coarse_and_fine_triangles_and_whole_parts_one_of_them(monkeypatch, possible):
    seen = []

    def meshes(shape, deflection, least, angle):
        seen.append(deflection)
        return (deflection == max(seen)) == (possible == "coarse") if len(seen) > 1 else possible == "coarse"

    monkeypatch.setattr(checks, "_meshes", meshes)
    square = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert not is_valid_meshed(square)
    seen.clear()
    assert is_valid_meshed(square, every=False)


def test_a_face_that_a_file_spoils_leaves_its_neighbours(monkeypatch):
    monkeypatch.setattr(join, "endures", lambda shape: not is_round(shape))
    part = rod().build()
    assert part.valid
    assert not part.closed
    assert [face.trimmed for face in part.faces].count("lost") == 1
    assert any("once it is read from a file: it is left out" in note for note in part.notes)


def is_round(shape):
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    from scan2nurbs.brep.read import faces_of

    return any(BRepAdaptor_Surface(face).GetType().name != "GeomAbs_Plane" for face in faces_of(shape))


def test_nothing_that_endures_is_an_error(monkeypatch):
    monkeypatch.setattr(join, "endures", lambda shape: False)
    with pytest.raises(NoResultError):
        rod().build()
