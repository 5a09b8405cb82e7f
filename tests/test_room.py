"""Faces that leave out most of their points, or reach far beyond them, are on the wrong side of their borders."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.gp import gp_Pln

from scan2nurbs.brep import join, room
from scan2nurbs.brep.room import Room, on_its_own, size_of
from scan2nurbs.errors import InputError
from scan2nurbs.scale import measure_scale
from test_part import box, rod, topology

NOWHERE = np.empty((0, 3))


def sheet(length):
    return (BRepBuilderAPI_MakeFace(gp_Pln(), 0.0, length, 0.0, 10.0).Face(),)


def test_a_large_face_without_a_triangle_has_left_its_room(monkeypatch):
    def nothing(*_, **__):
        raise InputError("None of its faces could be tessellated.")

    built = rod().build()
    monkeypatch.setattr(room, "tessellate", nothing)
    assert Room(NOWHERE, 300.0, 0.0, 1.0, built.kernel_scale).is_left_by(built.faces[0].shapes)
    assert not Room(NOWHERE, 1e6, 0.0, 1.0, built.kernel_scale).is_left_by(built.faces[0].shapes)


def test_a_face_far_from_the_mesh_has_left_its_room():
    x, y = np.meshgrid(np.arange(31.0), np.arange(11.0))
    mesh = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert not Room(mesh, 100.0, 0.0, 1.0, 1.0).is_left_by(sheet(30.0))
    assert Room(mesh, 100.0, 0.0, 1.0, 1.0).is_left_by(sheet(60.0))
    assert not Room(mesh, 601.0, 0.0, 1.0, 1.0).is_left_by(sheet(60.0))
    assert size_of(sheet(60.0), 2.0) == pytest.approx(150.0)


def test_a_face_of_its_own_is_the_one_that_covers_its_points(monkeypatch):
    def chosen(on_surface, on_mesh):
        monkeypatch.setattr(room, "trim_alone", lambda *_: on_surface)
        monkeypatch.setattr(room, "trim_anew", lambda *_: on_mesh)
        monkeypatch.setattr(room, "trim_by_points", lambda *_: ())
        return on_its_own(0, None, topology([], NOWHERE, ()), 1.0, 1.0, Room(NOWHERE, 1000.0, 200.0, 1.0, 1.0))

    small, large, none = sheet(1.0), sheet(30.0), ()
    assert chosen(large, none) is large
    assert chosen(small, large) is large, "the other side of its borders was taken"
    assert chosen(small, none) is small
    assert chosen(none, small) is small
    assert chosen(none, none) == ()


def test_what_leaves_its_neighbours_late_keeps_to_its_points_too(monkeypatch):
    """The outline along its borders is that of all the world: the next way is taken."""
    body = box()
    seen = topology(body.borders, body.vertices, body.outward)
    around = join.Surroundings(body.shapes, seen, measure_scale(body.points).h, 1.0)
    fair = sheet(4.0)
    monkeypatch.setattr(room, "trim_alone", lambda *_: sheet(1e9))
    monkeypatch.setattr(room, "trim_anew", lambda *_: fair)
    monkeypatch.setattr(Room, "of", classmethod(lambda cls, *_: cls(np.zeros((1, 3)), 50.0, 10.0, 1.0, 1.0)))
    assert join._alone(0, around) == (fair, "alone")
