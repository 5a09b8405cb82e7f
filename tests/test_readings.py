"""Other readings of a part's borders where a face does not fit its neighbours."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from scan2nurbs import part_readings
from scan2nurbs.brep.part import ModelParams, build_part
from scan2nurbs.brep.solids import Assembled
from scan2nurbs.faces.relabel import PARTS, take_samples
from scan2nurbs.faces.topology import TopologyParams, find_topology
from scan2nurbs.part_readings import READINGS, Reading, build_from_readings, without_relations
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.relations import Related, Relation
from test_topology import Fit, box, noisy

SIZE = (30.0, 24.0, 18.0)


@dataclass(frozen=True)
class Made:
    """What a comparison of readings looks at of a model's face."""

    trimmed: str


def scanned_box():
    rng = np.random.default_rng(1)
    points, label, fits = box(SIZE, rng)
    points = noisy(points, rng)
    return points, label, tuple(fits), measure_scale(points)


def tilted(fits, face, towards, degrees):
    """Turn a plane by a relation that should not have been imposed."""
    angle, shape = np.radians(degrees), fits[face].shape
    direction = np.cos(angle) * shape.direction + np.sin(angle) * fits[towards].shape.direction
    moved = Fit(replace(shape, direction=direction / np.linalg.norm(direction)))
    return tuple(moved if f == face else fit for f, fit in enumerate(fits))


def read(points, label, fits, unrelated, scale):
    topology = find_topology(points, label, fits, scale)
    return build_from_readings(points, label, fits, unrelated, topology, scale, TopologyParams(), ModelParams())


def test_a_relation_that_spoils_a_part_is_given_up():
    points, label, fits, scale = scanned_box()
    related = tilted(fits, 5, 2, 60.0)
    assert not build_part(points, related, find_topology(points, label, related, scale), scale).closed
    found = read(points, label, related, fits, scale)
    assert found.part.valid
    assert found.part.closed
    assert found.part.coverage > 0.99
    assert found.part.volume == pytest.approx(np.prod(SIZE), rel=0.02)
    assert found.released == {5}
    assert found.fits[5] is fits[5]


def open_box(seed, floor):
    """Points at random on a box whose bottom was not seen, with the kinds of its five planes."""
    rng = np.random.default_rng(seed)
    points, label, fits = [], [], []
    for axis, end in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 1)):
        place = rng.uniform(0, 1, (int(3000 * (600, 800, 1200)[axis] / 2600), 3))
        place[:, axis] = end
        points.append(place * [40, 30, 20])
        label.append(np.full(len(place), len(fits)))
        fits.append(Fit(Plane(np.array([40.0, 30, 20]) * end * np.eye(3)[axis], (2.0 * end - 1) * np.eye(3)[axis])))
    cloud = np.vstack(points)
    cloud += rng.normal(0, 0.15, cloud.shape)
    kept = cloud[:, 2] > floor
    return cloud[kept], np.concatenate(label)[kept].astype(np.int32), tuple(fits)


@pytest.mark.parametrize(("seed", "fill_holes"), [(0, False), (1, False), (2, False), (3, False), (0, True)])
def test_edges_run_out_into_the_rim_of_an_open_scan(seed, fill_holes):
    points, label, fits = open_box(seed, 1.0)
    scale, params = measure_scale(points), TopologyParams(fill_holes=fill_holes)
    topology = find_topology(points, label, fits, scale, params)
    found = build_from_readings(points, label, fits, fits, topology, scale, params, ModelParams())
    assert found.part.valid
    assert [face.trimmed for face in found.part.faces] == ["shared"] * 5
    assert found.part.n_free_edges == 4
    assert found.part.max_tolerance < 0.25 * scale.h
    # No surface closes the bottom, however far it is extended.
    assert any("left open" in note for note in found.part.notes) == fill_holes


@pytest.mark.parametrize("radius", [2.0, 5.0])
def test_a_hole_in_the_data_is_as_large_as_it_is(radius):
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(0.0, 30.0, (6000, 2)), np.zeros(6000)])
    points = noisy(points[np.hypot(points[:, 0] - 15.0, points[:, 1] - 15.0) > radius], rng, 0.03)
    label, fits = np.zeros(len(points), np.int32), (Fit(Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))),)
    scale = measure_scale(points)
    part = read(points, label, fits, fits, scale).part
    rim, hole = sorted((edge.length for edge in part.edges), reverse=True)
    assert 0.0 < hole / (2.0 * np.pi) - radius < 0.5 * scale.h
    assert 120.0 - 12.0 * scale.h < rim < 120.0
    assert part.area == pytest.approx(900.0 - np.pi * radius**2, rel=0.01)
    assert min(part.coverage, part.precision) > 0.999


def test_what_fits_is_read_once(monkeypatch):
    points, label, fits, scale = scanned_box()
    counted = []
    monkeypatch.setattr(part_readings, "build_part", lambda *given, **how: counted.append(0) or build_part(*given, **how))
    found = read(points, label, fits, fits, scale)
    assert found.part.closed
    assert found.released == frozenset()
    assert len(counted) == 1


def test_there_are_so_many_readings_and_no_more(monkeypatch):
    points, label, fits, scale = scanned_box()
    whole = build_part(points, fits, find_topology(points, label, fits, scale), scale)
    one_apart = replace(whole, closed=False, n_free_edges=3, faces=(replace(whole.faces[0], trimmed="alone"), *whole.faces[1:]))
    counted, tried = [], []

    def build(*_, params, fine=False, other_way=False, spanned=0.0, **__):
        (tried if spanned == 1.0 else counted).append((params.bearable, fine, other_way))
        return one_apart

    monkeypatch.setattr(part_readings, "build_part", build)
    assert not read(points, label, fits, fits, scale).part.closed
    assert READINGS == 3
    assert counted == [(0.5, False, False), (1.0, False, True), (1.0, True, True), (1.0, True, False)]
    assert len(tried) == 2


def test_what_had_to_be_bent_all_over_is_not_read_again(monkeypatch):
    points, label, fits, scale = scanned_box()
    whole = build_part(points, fits, find_topology(points, label, fits, scale), scale)
    counted, tried = [], []

    def build(*_, spanned=0.0, **__):
        (tried if spanned == 1.0 else counted).append(0)
        return replace(whole, closed=False, n_free_edges=3, faces=tuple(replace(face, trimmed=how) for face, how in hows))

    monkeypatch.setattr(part_readings, "build_part", build)
    for bent, builds, spans in ((2, 4, 2), (3, 2, 1)):
        hows = list(zip(whole.faces, ["alone", *["bent"] * bent, *["shared"] * (5 - bent)], strict=True))
        counted.clear()
        tried.clear()
        read(points, label, fits, fits, scale)
        assert (len(counted), len(tried)) == (builds, spans)


def test_wide_tolerances_are_taken_where_narrow_ones_leave_a_part_open(monkeypatch):
    points, label, fits, scale = scanned_box()
    whole = build_part(points, fits, find_topology(points, label, fits, scale), scale)
    one_apart = replace(whole, closed=False, n_free_edges=3, faces=(replace(whole.faces[0], trimmed="alone"), *whole.faces[1:]))
    monkeypatch.setattr(part_readings, "build_part", lambda *_, params, **__: whole if params.bearable > 0.5 else one_apart)
    found = read(points, label, fits, fits, scale)
    assert found.part.closed
    assert found.released == frozenset()


def test_faces_that_are_in_no_shell_are_not_closed_and_read_again(monkeypatch):
    points, label, fits, scale = scanned_box()
    counted = []

    def good(whole):
        """Find the shells of the first reading invalid, and sound what is in none."""
        return not whole.joined or len(counted) > 1

    monkeypatch.setattr(Assembled, "good", property(good))
    monkeypatch.setattr(part_readings, "build_part", lambda *given, **how: counted.append(0) or build_part(*given, **how))
    first = build_part(points, fits, find_topology(points, label, fits, scale), scale)
    assert (first.joined, first.closed, first.n_solids, first.n_apart) == (False, False, 0, 0)
    assert first.n_free_edges == 24, "four of every face, as in a file"
    assert first.volume == 0.0
    assert any("not joined to shells" in note for note in first.notes)
    found = read(points, label, fits, fits, scale)
    assert found.part.closed
    assert len(counted) == 2


def test_each_reading_leaves_out_another_tenth():
    points, label, fits, scale = scanned_box()
    shapes = [fit.shape for fit in fits]
    counts = [len(take_samples(points, label, shapes, scale, 10**6, without).points) for without in range(PARTS + 1)]
    assert sum(counts[0] - count for count in counts[1:]) == pytest.approx(counts[0], rel=0.02)
    first, second = (find_topology(points, label, fits, scale, reading=reading) for reading in (1, 2))
    assert (first.n_faces, len(first.borders), len(first.vertices)) == (6, 12, 8)
    assert (second.n_faces, len(second.borders), len(second.vertices)) == (6, 12, 8)
    assert not np.array_equal(first.mesh.vertices, second.mesh.vertices)


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        ({"valid": True}, {"valid": False, "closed": True}),
        ({"closed": True}, {"closed": False}),
        ({"closed": False, "coverage": 0.99}, {"closed": True, "coverage": 0.5}),
        ({"closed": True, "coverage": 0.985}, {"closed": False, "coverage": 0.99}),
        ({"closed": False, "n_free_edges": 9}, {"closed": False, "faces": (Made("alone"),), "n_free_edges": 3}),
        ({"closed": False, "n_free_edges": 3}, {"closed": False, "n_free_edges": 9}),
        ({"closed": False, "faces": (Made("alone"),), "n_free_edges": 9}, {"closed": False, "joined": False, "n_free_edges": 3}),
    ],
)
def test_the_better_of_two_readings(better, worse):
    points, label, fits, scale = scanned_box()
    topology = find_topology(points, label, fits, scale)
    whole = build_part(points, fits, topology, scale)
    one, other = (Reading(replace(whole, **changed), topology, fits) for changed in (better, worse))
    assert one.betters(other)
    assert not other.betters(one)


def test_relations_of_released_faces_are_not_listed():
    points, label, fits, scale = scanned_box()
    topology = find_topology(points, label, fits, scale)
    part = build_part(points, fits, topology, scale)
    relations = (Relation("parallel", (0, 1), 0.1, 0.0, 0.0), Relation("parallel", (2, 3), 0.1, 0.0, 0.0))
    related = Related(fits, relations, ("Said before.",))
    names = [f"plane_{f}" for f in range(6)]
    kept = without_relations(related, Reading(part, topology, fits, frozenset({3})), names)
    assert kept.relations == relations[:1]
    assert kept.notes[0] == "Said before."
    assert "plane_3" in kept.notes[1]
    assert without_relations(related, Reading(part, topology, fits), names) == related
