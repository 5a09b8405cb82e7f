"""Faces that do not fit their neighbours, spanned by surfaces between the edges of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scan2nurbs.brep import join, spanned
from scan2nurbs.brep.borders import _filled
from scan2nurbs.brep.measure import area, tolerance
from scan2nurbs.brep.part import ModelParams, build_part
from scan2nurbs.brep.patch import patch_within
from scan2nurbs.brep.solids import assemble
from scan2nurbs.brep.spanned import span, touching
from scan2nurbs.faces.topology import TopologyParams, find_topology
from scan2nurbs.part_readings import build_from_readings
from scan2nurbs.scale import measure_scale
from test_topology import box, noisy

SIZE = (30.0, 24.0, 18.0)


def scanned_box():
    rng = np.random.default_rng(1)
    points, label, fits = box(SIZE, rng)
    points = noisy(points, rng)
    scale = measure_scale(points)
    return points, label, tuple(fits), scale, find_topology(points, label, fits, scale)


def ring(radius, n, height):
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angle), 0.6 * radius * np.sin(angle), height(radius * np.cos(angle))])


def test_a_patch_ends_in_its_loops_and_follows_the_points_between():
    rng = np.random.default_rng(2)

    def height(x):
        return 4.0 * np.sin(0.15 * x)

    outer, hole = ring(20.0, 160, height), ring(6.0, 60, height)[::-1]
    x, y = rng.uniform(-20.0, 20.0, (2, 4000))
    within = (np.hypot(x, y / 0.6) < 19.5) & (np.hypot(x, y / 0.6) > 6.5)
    inner = np.column_stack([x, y, height(x)])[within]
    surface, parameters = patch_within([outer, hole], inner, 1.0, 0.05)
    for loop, uv in zip((outer, hole), parameters, strict=True):
        assert np.linalg.norm(surface.evaluate(uv) - loop, axis=1).max() < 0.1
    assert np.hypot(*parameters[0].T) == pytest.approx(1.0)
    turn = np.unwrap(np.arctan2(*parameters[1].T))
    assert np.all(np.diff(turn) > 0.0)  # the hole's border is passed once, the way it runs
    assert np.hypot(*parameters[1].T).max() < 0.9
    grid = np.column_stack([*np.meshgrid(*[np.linspace(-0.6, 0.6, 25)] * 2)]).reshape(-1, 2)
    between = surface.evaluate(grid[np.hypot(*grid.T) > np.hypot(*parameters[1].T).max()])
    assert np.abs(between[:, 2] - height(between[:, 0])).max() < 0.2


@pytest.mark.parametrize("missing", [[5], [0, 5], [2]])
def test_faces_that_touch_are_spanned_together_and_close_a_box(missing):
    points, _, fits, scale, topology = scanned_box()
    part = build_part(points, fits, topology, scale)
    faces = [face.shapes for face in part.faces]
    widest = 0.5 * scale.h * part.kernel_scale
    found = span(faces, missing, topology, scale.h, part.kernel_scale, widest)
    (by, face), *others = found.items()
    assert not others
    assert by in missing
    assert touching(missing, topology, by) == missing
    assert tolerance(face) <= widest
    assert area(face) == pytest.approx(sum(area(piece) for f in missing for piece in faces[f]), rel=0.03)
    left = [pieces for f, pieces in enumerate(faces) if f not in missing]
    sewn = join.sew([*left, (face,)], widest)
    assert sewn is not None
    whole = assemble([piece for pieces in sewn for piece in pieces])
    assert (whole.n_free_edges, whole.n_solids) == (0, 1)


@pytest.mark.parametrize("refused", [1, 3])
def test_a_smoother_surface_is_tried_where_one_is_invalid_once_it_is_sewn(monkeypatch, refused):
    points, _, fits, scale, topology = scanned_box()
    part = build_part(points, fits, topology, scale)
    faces = [face.shapes for face in part.faces]
    smooth, beside = list[float](), list[int]()

    def patch(loops, inner, h, weight):
        smooth.append(weight)
        return patch_within(loops, inner, h, weight)

    def sew(given, widest):
        beside.append(len(given))
        return join.sew(given, widest) if len(beside) > refused else None

    monkeypatch.setattr(spanned, "patch_within", patch)
    monkeypatch.setattr(spanned, "sew", sew)
    found = span(faces, [5], topology, scale.h, part.kernel_scale, 0.5 * scale.h * part.kernel_scale)
    assert list(found) == ([5] if refused < 3 else [])
    assert smooth == [0.05, 0.2, 0.8][: refused + 1]
    assert set(beside) == {6}, "with the five faces around it"


def test_nothing_is_spanned_that_does_not_follow_its_points():
    points, _, fits, scale, topology = scanned_box()
    part = build_part(points, fits, topology, scale)
    faces = [face.shapes for face in part.faces]
    assert span(faces, [], topology, scale.h, part.kernel_scale, 1.0) == {}
    assert span(faces, list(range(6)), topology, scale.h, part.kernel_scale, 1.0) == {}
    # Five planes of six: their surface would leave the one loop of four edges over all of the box.
    assert span(faces, [0, 1, 2, 3, 4], topology, scale.h, part.kernel_scale, 0.01 * scale.h) == {}


def test_a_face_without_borders_is_not_spanned():
    points, _, fits, scale, topology = scanned_box()
    part = build_part(points, fits, topology, scale)
    whole = tuple(piece for face in part.faces for piece in face.shapes)
    lonely = replace(topology, borders=())
    assert span([whole, (), (), (), (), ()], [5], lonely, scale.h, part.kernel_scale, 1.0) == {}
    assert _filled(np.zeros((1, 3)), 1.0).tolist() == [[0.0, 0.0, 0.0]]


def without_one(given, around, notes):
    """Let a face leave its neighbours."""
    pieces, kinds = list(given.faces), list(given.how)
    pieces[5], kinds[5] = join._alone(5, around)
    notes.append(join._left(5, around, kinds, "would be lost where the part is shown"))
    return join.Joined(pieces, kinds, join._together(pieces), (5,))


def test_a_part_that_stays_open_is_closed_by_a_surface_between_its_neighbours(monkeypatch):
    points, label, fits, scale, topology = scanned_box()
    monkeypatch.setattr(join, "_shown", lambda *given, shown=join._shown: without_one(shown(*given), *given[2:]))
    monkeypatch.setattr(join, "sew", lambda faces, most, real=join.sew: real(faces, most) if most > 0.9 * scale.h else None)
    monkeypatch.setattr("scan2nurbs.part_readings.build_part", lambda *a, **k: build_part(*a, **{**k, "scale": scale}))
    found = build_from_readings(points, label, fits, fits, topology, scale, TopologyParams(), ModelParams())
    assert found.part.closed
    assert found.part.valid
    assert found.part.faces[5].trimmed == "bent"
    assert found.part.volume == pytest.approx(np.prod(SIZE), rel=0.02)
    assert any("takes its place" in note for note in found.part.notes)
    assert not any("has its own outline" in note for note in found.part.notes)


@pytest.mark.parametrize(("share", "closed"), [(0.0, False), (0.05, False), (0.4, True)])
def test_faces_of_a_small_share_are_spanned_at_once(monkeypatch, share, closed):
    points, _, fits, scale, topology = scanned_box()
    monkeypatch.setattr(join, "_shown", lambda *given, shown=join._shown: without_one(shown(*given), *given[2:]))
    monkeypatch.setattr(join, "sew", lambda faces, most, real=join.sew: real(faces, most) if share else None)
    part = build_part(points, fits, topology, scale, spanned=share)
    assert 0.05 < topology.areas[5] / topology.areas.sum() < 0.4
    assert (part.faces[5].trimmed == "bent") is closed
    open_scan = replace(topology, borders=(*topology.borders, replace(topology.borders[0], faces=(0, -1))))
    assert not join._allowed([5], open_scan, share), "what has an end where the scan ends is not closed by that"
    assert join._allowed([5], open_scan, 1.0)
