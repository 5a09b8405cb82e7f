"""Small faces that fit nowhere are given up for their neighbours, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scan2nurbs import part_readings
from scan2nurbs.brep.part import ModelParams, build_part
from scan2nurbs.cloud import as_cloud
from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.faces.dissolve import dissolve
from scan2nurbs.faces.segmentation import Faces
from scan2nurbs.faces.topology import TopologyParams, find_topology
from scan2nurbs.part_faces import Parted, by_topology
from scan2nurbs.part_readings import Reading, build_from_readings, without_dissolved, without_relations
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.relations import Related, Relation
from scan2nurbs.surfaces.shape_fit import fit_shape
from test_topology import Fit, box, noisy

SIZE = (30.0, 24.0, 18.0)
STRIP = 6


def with_strip(width):
    """A box along one edge of which a strip that wide is a face of its own, which leans from one of its planes to the other."""
    rng = np.random.default_rng(1)
    points, label, fits = box(SIZE, rng)
    x, z = points[:, 0], points[:, 2]
    near = ((label == 1) & (z > SIZE[2] - width)) | ((label == 5) & (x > SIZE[0] - width))
    label = np.where(near, STRIP, label).astype(np.int32)
    lean = Plane(np.array([SIZE[0] - 0.25 * width, 0.0, SIZE[2] - 0.25 * width]), np.sqrt(0.5) * np.array([1.0, 0.0, 1.0]))
    points = noisy(points, rng)
    return points, label, (*fits, Fit(lean)), measure_scale(points)


def test_points_of_a_strip_go_to_the_nearest_of_the_faces_beside_it():
    points, label, fits, scale = with_strip(2.0)
    topology = find_topology(points, label, fits, scale)
    faces = np.flatnonzero(topology.source == STRIP)
    given = dissolve(points, label, [fit.shape for fit in fits], topology, faces, scale.h)
    assert given is not None
    assert given.faces == (STRIP,)
    assert STRIP not in given.label
    was = label == STRIP
    assert np.array_equal(given.label[~was], label[~was])
    assert np.isin(given.label[was], (1, 5)).mean() > 0.9  # at its ends others are as near
    assert set(given.label[was].tolist()) <= {1, 2, 3, 5}
    assert 0.0 < given.off < 3.5 * scale.noise


def test_a_face_that_its_neighbours_do_not_explain_stays():
    points, label, fits, scale = with_strip(2.0)
    topology = find_topology(points, label, fits, scale)
    face = int(np.flatnonzero(topology.source == 2)[0])
    assert dissolve(points, label, [fit.shape for fit in fits], topology, [face], scale.h) is None


def without_the_strip(monkeypatch):
    """Read a box whose strip never fits."""
    points, label, fits, scale = with_strip(2.0)

    def build(points, fits, topology, *given, **how):
        part = build_part(points, fits, topology, *given, **how)
        apart = [replace(face, trimmed="alone") if face.number == STRIP else face for face in part.faces]
        return replace(part, faces=tuple(apart), closed=False, n_free_edges=4) if STRIP in topology.source else part

    monkeypatch.setattr(part_readings, "build_part", build)
    topology = find_topology(points, label, fits, scale)
    return points, label, fits, scale, build_from_readings(points, label, fits, fits, topology, scale, TopologyParams(), ModelParams())


def test_a_part_is_closed_without_a_strip_that_fits_nowhere(monkeypatch):
    *_, found = without_the_strip(monkeypatch)
    assert found.part.closed
    assert found.part.valid
    assert found.part.volume == pytest.approx(np.prod(SIZE), rel=0.02)
    assert found.dissolved is not None
    assert found.dissolved.faces == (STRIP,)


def test_what_was_given_up_is_said_and_no_longer_there(monkeypatch):
    points, label, fits, _, found = without_the_strip(monkeypatch)
    cloud = as_cloud(points)
    scale = measure_scale(cloud.points)
    faces = Faces(label, fits, frozenset({(1, 5), (1, STRIP)}))  # type: ignore[arg-type] - planes are all that is asked of fits
    parted = Parted(cloud, scale, detect(cloud.points, scale, EdgeParams()), faces, np.arange(7, dtype=np.int32), 7)
    given = without_dissolved(parted, found)
    assert f"plane_{STRIP} was given up" in given.faces.notes[-1]
    left = by_topology(given, found.topology)
    assert len(left.faces.fits) == 6
    assert sorted(left.numbers.tolist()) == [0, 1, 2, 3, 4, 5]
    assert len(left.faces.smooth) == 1
    assert np.bincount(left.faces.label, minlength=6).min() > 0
    untouched = Reading(found.part, found.topology, found.fits)
    assert without_dissolved(parted, untouched) is parted


def test_a_piece_of_a_face_gets_a_number_that_no_face_had_and_says_whose_piece_it_is():
    points = np.array([[x + apart, y, 0.0] for apart in (0.0, 20.0) for x in range(8) for y in range(8 - int(apart > 0))])
    cloud, triangles = as_cloud(points), np.array([[0, 1, 8], [64, 65, 71]])
    fit = fit_shape("plane", cloud.points, noise=0.1)
    faces = Faces(np.zeros(len(points), np.int32), (fit,), frozenset())
    parted = Parted(cloud, measure_scale(cloud.points), None, faces, np.array([4], np.int32), 7)  # type: ignore[arg-type] - edges are not asked
    mesh = SimpleNamespace(vertices=cloud.points, triangles=triangles, face=np.array([1, 0]))
    topology = SimpleNamespace(source=np.array([0, 0]), areas=np.array([42.0, 49.0]), mesh=mesh)
    found = by_topology(parted, topology)  # type: ignore[arg-type] - what is asked of a topology
    assert found.numbers.tolist() == [7, 4]
    assert found.free == 8
    assert np.bincount(found.faces.label).tolist() == [56, 64]
    assert [*found.faces.fits[0].notes[len(fit.notes) :]] == ["A piece of face 4: corrections know it by that number."]
    assert found.faces.fits[1].notes == fit.notes


def test_relations_of_a_face_that_was_given_up_are_not_listed(monkeypatch):
    *_, found = without_the_strip(monkeypatch)
    relations = (Relation("parallel", (0, 1), 0.1, 0.0, 0.0), Relation("parallel", (2, STRIP), 0.1, 0.0, 0.0))
    kept = without_relations(Related(found.fits, relations, ()), found, [f"plane_{k}" for k in range(7)])
    assert kept.relations == relations[:1]
    assert kept.notes == ()


def test_no_face_is_given_up_where_that_closes_nothing(monkeypatch):
    points, label, fits, scale = with_strip(2.0)

    def build(points, fits, topology, *given, **how):
        part = build_part(points, fits, topology, *given, **how)
        apart = STRIP if STRIP in topology.source else 0  # without the strip another face does not fit
        faces = [replace(face, trimmed="alone") if face.number == apart else face for face in part.faces]
        return replace(part, faces=tuple(faces), closed=False, n_free_edges=4)

    monkeypatch.setattr(part_readings, "build_part", build)
    topology = find_topology(points, label, fits, scale)
    found = build_from_readings(points, label, fits, fits, topology, scale, TopologyParams(), ModelParams())
    assert found.dissolved is None
