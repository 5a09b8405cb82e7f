"""Faces become shapes that are valid, also with triangles and in a file; what spoils them leaves its neighbours."""

from __future__ import annotations

import pytest

from scan2nurbs.brep import check as checks
from scan2nurbs.brep import endure, join, solids, viewed
from scan2nurbs.brep.check import is_valid_meshed
from scan2nurbs.brep.endure import endures, spoilt
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.brep.solids import compound
from scan2nurbs.brep.viewed import unseen
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


def found_to_endure(monkeypatch, judge):
    """Let shapes endure by what a judge says."""
    for module in (join, solids):
        monkeypatch.setattr(module, "endures", judge)


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
    monkeypatch.setattr(checks, "_meshes", lambda _shape, _deflection, least, _angle: (least > 0) == (possible == "fine"))
    square = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert not is_valid_meshed(square)
    assert is_valid_meshed(square, every=False)


def test_a_face_that_a_file_spoils_leaves_its_neighbours(monkeypatch):
    found_to_endure(monkeypatch, lambda shape: not is_round(shape))
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
    found_to_endure(monkeypatch, lambda shape: False)
    with pytest.raises(NoResultError):
        rod().build()


def test_all_faces_of_sound_bodies_are_seen():
    for body in (box(), rod()):
        part = body.build(noise=0.3)
        assert unseen([face.shapes for face in part.faces], part.shape) == []


def test_a_face_without_triangles_is_not_seen():
    square, bow_tie = polygon([(0, 0), (9, 0), (9, 9), (0, 9)]), polygon([(20, 0), (29, 9), (29, 0), (20, 9)])
    assert unseen([(square,), (bow_tie,)], compound([square, bow_tie])) == [1]


def test_a_face_that_is_not_seen_leaves_its_neighbours(monkeypatch):
    shown = []

    def once(faces, shape, bent):
        shown.append(shape)
        return [0, 2] if len(shown) == 1 else viewed.unseen(faces, shape, bent)

    monkeypatch.setattr(join, "unseen", once)
    part = box(size=(8.0, 6.0, 5.0)).build()
    assert part.valid
    assert part.coverage > 0.99
    alone = [f for f, face in enumerate(part.faces) if face.trimmed == "alone"]
    assert len(alone) == 1
    assert alone[0] in (0, 2)
    assert part.areas[alone[0]] == min(part.areas[f] for f in (0, 2))
    assert any("would be lost where the part is shown" in note for note in part.notes)


def test_a_part_that_the_kernel_fails_to_show_is_built_all_the_same(monkeypatch):
    def fails(_faces, _shape, _bent):
        raise KernelError("The CAD kernel could not triangulate the part.")

    monkeypatch.setattr(join, "unseen", fails)
    assert box().build().closed


def test_bent_faces_are_shown_with_triangles_of_a_least_size_alone(monkeypatch):
    asked = []

    def note(faces, _deflection, _angle, least):
        asked.append((sorted(faces), least is None))
        return []

    monkeypatch.setattr(viewed, "_lost", note)
    squares = [polygon([(x, 0), (x + 9, 0), (x + 9, 9), (x, 9)]) for x in (0, 20, 40)]
    assert unseen([(square,) for square in squares], compound(squares), wrinkled=[1]) == []
    assert asked == [([0, 1, 2], False)] * 2 + [([0, 2], True)] * 3


def test_a_face_that_coarse_triangles_lose_is_not_asked_for_finer_ones(monkeypatch):
    asked = []

    def lose(faces, _deflection, _angle, _least):
        asked.append(sorted(faces))
        return [1] if 1 in faces else []

    monkeypatch.setattr(viewed, "_lost", lose)
    squares = [polygon([(x, 0), (x + 9, 0), (x + 9, 9), (x, 9)]) for x in (0, 20, 40)]
    assert unseen([(square,) for square in squares], compound(squares)) == [1]
    assert asked == [[0, 1, 2]] + [[0, 2]] * 4


def test_a_face_that_a_file_divides_and_spoils_is_found(monkeypatch):
    faces = [(polygon([(x, 0), (x + 10, 0), (x + 10, 6), (x, 6)]),) for x in (0, 20, 40)]
    assert spoilt(faces, compound([piece for pieces in faces for piece in pieces])) == []
    half, crossed = polygon([(20, 0), (24, 0), (24, 6), (20, 6)]), polygon([(24, 0), (30, 6), (30, 0), (24, 6)])
    monkeypatch.setattr(endure, "read_shape", lambda path: compound([*faces[2], half, crossed, *faces[0]]))
    assert spoilt(faces, compound([piece for pieces in faces for piece in pieces])) == [1]


def test_a_face_that_is_spoilt_where_the_part_is_read_leaves_its_neighbours(monkeypatch):
    told = [[0], []]
    monkeypatch.setattr(join, "spoilt", lambda _faces, _shape: told.pop(0))
    found_to_endure(monkeypatch, lambda shape: len(told) < 2)
    part = box().build()
    assert part.valid
    assert [face.trimmed == "alone" for face in part.faces] == [True, False, False, False, False, False]
    assert part.n_free_edges == 8  # its own four, and those of its neighbours
    assert any("invalid once the part is read from a file: it has its own outline" in note for note in part.notes)


def test_a_face_that_is_invalid_beside_the_others_even_alone_is_left_out(monkeypatch):
    sound = join._is_sound
    monkeypatch.setattr(join, "_is_sound", lambda piece, extent: not is_round(piece) and sound(piece, extent))
    found_to_endure(monkeypatch, lambda shape: not is_round(shape))
    part = rod().build()
    assert part.valid
    assert [face.trimmed for face in part.faces].count("lost") == 1
    assert any("is invalid beside the others: it is left out" in note for note in part.notes)
