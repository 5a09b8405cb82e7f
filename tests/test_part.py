"""Whole parts on shared edges: simple bodies whose volume is known, with borders as noisy as those read off a scan."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scan2nurbs.brep.borders import _ends, _guide, lay_borders
from scan2nurbs.brep.check import check
from scan2nurbs.brep.part import build_part
from scan2nurbs.brep.solids import Assembled
from scan2nurbs.brep.write_part import write_part
from scan2nurbs.errors import NoResultError, OutputError, ParameterError
from scan2nurbs.faces.complex import Border, LabelledMesh, Topology
from scan2nurbs.part_report import _named, _names_before, _sentence
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

X, Y, Z = np.eye(3)
ZERO = np.zeros(3)
EMPTY = LabelledMesh(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32))


@dataclass(frozen=True)
class Fit:
    """A surface, as the segmentation hands it on."""

    shape: object


@dataclass(frozen=True)
class Body:
    """Surfaces, how they meet, and points on them."""

    shapes: tuple
    borders: tuple
    outward: tuple
    points: np.ndarray
    vertices: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))

    def build(self, noise=0.0, rng=None):
        scale = measure_scale(self.points)
        rng = rng or np.random.default_rng(0)
        borders = [disturbed(b, noise * scale.h, rng) for b in self.borders]
        return build_part(self.points, [Fit(s) for s in self.shapes], topology(borders, self.vertices, self.outward), scale)


def disturbed(border, sigma, rng):
    points = border.points + rng.normal(size=border.points.shape) * sigma
    if border.vertices[0] < 0:
        points[-1] = points[0]
    return Border(points, border.faces, border.vertices)


def topology(borders, vertices, outward):
    """Close the loops of each face: a face is left of its borders."""
    loops = []
    for f in range(len(outward)):
        ways = [(k, forward) for k, b in enumerate(borders) for side, forward in ((0, True), (1, False)) if b.faces[side] == f]
        done = [((k, forward),) for k, forward in ways if borders[k].vertices[0] < 0]
        left = {borders[k].vertices[0 if forward else 1]: (k, forward) for k, forward in ways if borders[k].vertices[0] >= 0}
        while left:
            at, loop = next(iter(left)), []
            while at in left:
                k, forward = left.pop(at)
                loop.append((k, forward))
                at = borders[k].vertices[1 if forward else 0]
            done.append(tuple(loop))
        loops.append(tuple(done))
    n = len(outward)
    closed = (all(min(b.faces) >= 0 for b in borders),)
    zeros = np.zeros(n, np.int32)
    source = np.arange(n, dtype=np.int32)
    return Topology(np.asarray(vertices), tuple(borders), tuple(loops), source, np.array(outward, np.int8), zeros, closed, zeros, EMPTY, ())


def ring(radius, z, faces, n=60):
    t = np.linspace(0, 2 * np.pi, n + 1)
    points = np.column_stack([radius * np.cos(t), radius * np.sin(t), np.full(n + 1, float(z))])
    points[-1] = points[0]
    return Border(points, faces, (-1, -1))


def disc_points(radius, z, step=0.5):
    g = np.arange(-radius, radius, step)
    x, y = (a.ravel() for a in np.meshgrid(g, g))
    keep = x**2 + y**2 < radius**2
    return np.column_stack([x[keep], y[keep], np.full(keep.sum(), float(z))])


def wall_points(radius, z0, z1, step=0.5):
    t, z = np.meshgrid(np.arange(0, 2 * np.pi, step / radius), np.arange(z0, z1, step))
    return np.column_stack([radius * np.cos(t).ravel(), radius * np.sin(t).ravel(), z.ravel()])


def rod(radius=5.0, height=12.0):
    shapes = (Cylinder(ZERO, Z, radius), Plane(ZERO, Z), Plane(height * Z, Z))
    borders = (ring(radius, 0, (0, 1)), ring(radius, height, (2, 0)))
    points = np.concatenate([wall_points(radius, 0, height), disc_points(radius, 0), disc_points(radius, height)])
    return Body(shapes, borders, (1, -1, 1), points)


def box(size=(8.0, 6.0, 5.0), without=()):
    """A box; `without` leaves out faces, whose borders are free then."""
    size = np.array(size)
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * size
    shapes, outward, points = [], [], []
    kept = [f for f in range(6) if f not in without]
    edges = {}
    for f in kept:
        axis, high = divmod(f, 2)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        shapes.append(Plane(np.eye(3)[axis] * size[axis] * high, np.eye(3)[axis]))
        outward.append(1 if high else -1)
        g = np.stack(np.meshgrid(np.arange(0.2, size[a], 0.4), np.arange(0.2, size[b], 0.4)), axis=-1).reshape(-1, 2)
        face = np.full((len(g), 3), size[axis] * high)
        face[:, [a, b]] = g
        points.append(face)
        turn = [(0, 0), (1, 0), (1, 1), (0, 1)]
        weights = {0: 4, 1: 2, 2: 1}
        path = [weights[axis] * high + weights[a] * i + weights[b] * j for i, j in (turn if high else turn[::-1])]
        for u, v in zip(path, [*path[1:], path[0]], strict=True):
            edges[u, v] = kept.index(f)
    borders = []
    for (u, v), left in sorted(edges.items()):
        right = edges.get((v, u), -1)
        if u < v or right < 0:
            borders.append(Border(np.linspace(corners[u], corners[v], 12), (left, right), (u, v)))
    return Body(tuple(shapes), tuple(borders), tuple(outward), np.concatenate(points), corners.astype(float))


def test_a_box_is_a_solid_with_straight_edges():
    model = box().build(noise=0.3)
    assert (model.valid, model.closed, model.n_solids, model.n_free_edges) == (True, True, 1, 0)
    assert model.volume == pytest.approx(240.0, rel=1e-9)
    assert {edge.kind for edge in model.edges} == {"line"}
    assert [face.trimmed for face in model.faces] == ["shared"] * 6
    assert model.coverage == 1.0
    assert model.precision == 1.0


def test_a_box_without_a_lid_stays_a_shell():
    model = box(without=(5,)).build(noise=0.3)
    assert (model.valid, model.closed, model.n_solids, model.n_free_edges, model.volume) == (True, False, 0, 4, 0.0)
    assert sum(edge.angle == 180.0 for edge in model.edges) == 4


def test_a_rod_has_two_circles_and_a_seam():
    model = rod().build(noise=0.3)
    assert (model.valid, model.closed, model.n_solids) == (True, True, 1)
    assert model.volume == pytest.approx(np.pi * 25 * 12, rel=1e-6)
    assert [edge.kind for edge in model.edges] == ["circle", "circle"]
    assert check(model.shape).n_edges == 3


def test_borders_may_come_wherever_they_start():
    body = rod()
    turned = []
    for k, b in enumerate(body.borders):
        points = np.roll(b.points[:-1], 7 + 13 * k, axis=0)
        turned.append(Border(np.vstack([points, points[:1]]), b.faces, b.vertices))
    model = Body(body.shapes, tuple(turned), body.outward, body.points).build()
    assert model.closed
    assert check(model.shape).n_edges == 3


@pytest.mark.parametrize(
    ("shape", "volume"),
    [(Sphere(np.array([1.0, 2.0, 3.0]), 6.0), 4 / 3 * np.pi * 216), (Torus(ZERO, Z, 8.0, 3.0), 2 * np.pi**2 * 8 * 9)],
)
def test_faces_without_borders_are_whole_surfaces(shape, volume):
    rng = np.random.default_rng(1)
    model = Body((shape,), (), (1,), shape.foot(rng.normal(size=(4000, 3)) * 6)).build()
    assert (model.valid, model.closed, model.n_solids) == (True, True, 1)
    assert model.volume == pytest.approx(volume, rel=1e-5)


def test_a_cone_ends_in_its_apex():
    tip = Cone(np.array([0.0, 0.0, 6.0]), -Z, 3.0, np.arctan(0.5))
    points = np.concatenate([disc_points(6.0, 0), *(wall_points(6 - z / 2, z, z + 0.1) for z in np.arange(0, 11.5, 0.5))])
    model = Body((Plane(ZERO, Z), tip), (ring(6.0, 0, (1, 0)),), (-1, 1), points).build(noise=0.2)
    assert (model.valid, model.closed) == (True, True)
    assert model.volume == pytest.approx(np.pi * 36 * 12 / 3, rel=1e-6)


def test_half_a_ball_has_its_pole_amid_the_cap():
    rng = np.random.default_rng(2)
    shell = Sphere(ZERO, 7.0).foot(rng.normal(size=(5000, 3)))
    points = np.concatenate([shell[shell[:, 2] > 0], disc_points(7.0, 0)])
    model = Body((Sphere(ZERO, 7.0), Plane(ZERO, Z)), (ring(7.0, 0, (0, 1)),), (1, -1), points).build(noise=0.3)
    assert (model.valid, model.closed) == (True, True)
    assert model.volume == pytest.approx(2 / 3 * np.pi * 343, rel=1e-5)


def test_a_hole_through_a_box_and_a_ball_within_it():
    body = box((20.0, 20.0, 10.0))
    rng = np.random.default_rng(3)
    middle = np.array([10.0, 10.0, 0.0])
    shift = lambda b: Border(b.points + middle, b.faces, b.vertices)  # noqa: E731
    shapes = (*body.shapes, Cylinder(middle, Z, 3.0), Sphere(np.array([4.0, 4.0, 5.0]), 2.0))
    borders = (*body.borders, shift(ring(3.0, 0, (4, 6))), shift(ring(3.0, 10, (6, 5))))
    points = np.concatenate([body.points, wall_points(3.0, 0, 10) + middle, shapes[-1].foot(rng.normal(size=(500, 3)) * 3 + [4, 4, 5])])
    model = Body(shapes, borders, (*body.outward, -1, -1), points, body.vertices).build(noise=0.1)
    assert (model.valid, model.closed, model.n_solids) == (True, True, 1)
    assert model.volume == pytest.approx(4000 - np.pi * 90 - 4 / 3 * np.pi * 8, rel=1e-5)


def test_a_smooth_border_is_the_line_of_contact():
    """A plane runs into a quarter of a cylinder: an open strip of two faces."""
    radius, length = 4.0, 10.0
    y = np.linspace(0, length, 25)
    line = np.column_stack([np.zeros(25), y, np.full(25, radius)])
    corners = np.array([[0, 0, 4], [0, 10, 4], [-8, 0, 4], [-8, 10, 4], [4, 0, 0], [4, 10, 0]], float)
    t = np.linspace(0, np.pi / 2, 15)
    arc = lambda at: np.column_stack([4 * np.sin(t), np.full(15, at), 4 * np.cos(t)])  # noqa: E731
    straight = lambda a, b, faces: Border(np.linspace(corners[a], corners[b], 20), faces, (a, b))  # noqa: E731
    borders = (
        Border(line, (0, 1), (0, 1)),
        straight(1, 3, (0, -1)),
        straight(3, 2, (0, -1)),
        straight(2, 0, (0, -1)),
        Border(arc(0.0), (1, -1), (0, 4)),
        straight(4, 5, (1, -1)),
        Border(arc(length)[::-1], (1, -1), (5, 1)),
    )
    shapes = (Plane(radius * Z, Z), Cylinder(ZERO, Y, radius))
    u, v = (a.ravel() for a in np.meshgrid(np.arange(-8, 0, 0.3), np.arange(0, length, 0.3)))
    w, v2 = (a.ravel() for a in np.meshgrid(np.arange(0, np.pi / 2, 0.08), np.arange(0, length, 0.3)))
    points = np.concatenate(
        [np.column_stack([u, v, np.full(len(u), radius)]), np.column_stack([radius * np.sin(w), v2, radius * np.cos(w)])]
    )
    model = Body(shapes, borders, (1, 1), points, corners).build(noise=0.3)
    assert (model.valid, model.n_free_edges) == (True, 6)
    seam = model.edges[0]
    assert (seam.mode, seam.kind) == ("contact", "line")
    assert seam.angle < 1e-3
    assert seam.gap < 1e-6


def test_a_part_far_too_small_for_the_kernel_is_scaled():
    body = rod()
    small = Body(
        (Cylinder(ZERO, Z, 5e-4), Plane(ZERO, Z), Plane(12e-4 * Z, Z)),
        tuple(Border(b.points * 1e-4, b.faces, b.vertices) for b in body.borders),
        body.outward,
        body.points * 1e-4,
    )
    model = small.build()
    assert model.closed
    assert model.volume == pytest.approx(np.pi * 25 * 12 * 1e-12, rel=1e-6)


@given(st.lists(st.integers(0, 16).map(lambda k: k / 8), min_size=2, max_size=4, unique=True))
@example([1.875, 1.5, 0.625])
@example([0.75, 1.875, 2.0])
@settings(deadline=None, max_examples=60)
def test_a_loop_that_folds_back_on_itself_has_a_curve(way):
    there_and_back = np.outer([*way, *way[-2::-1]], X)
    (curve,), _ = lay_borders([Border(there_and_back, (0, -1), (-1, -1))], np.empty((0, 3)), [Plane(ZERO, Z)], 1.0)
    assert np.isfinite(curve.curve(curve.curve.samples(20))).all()


def test_no_faces_is_an_error():
    body = rod()
    with pytest.raises(NoResultError, match="no face"):
        build_part(body.points, [], topology([], np.empty((0, 3)), ()), measure_scale(body.points))


def test_relations_are_told_of_the_piece_that_kept_the_name_of_a_face():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [3, 0, 0], [0, 3, 0], [0, 0, 1]])
    mesh = LabelledMesh(corners, np.array([[0, 1, 2], [0, 3, 4], [0, 1, 5]], np.int32), np.array([1, 0, 2], np.int32))
    parted = replace(topology([], np.empty((0, 3)), (1, 1, 1)), mesh=mesh, source=np.array([0, 0, 1], np.int32))
    names = ("plane_0", "plane_2", "cylinder_1")
    assert _names_before(SimpleNamespace(topology=parted, names=names)) == {0: "plane_0", 1: "cylinder_1"}


def test_wrong_parameters_are_told(tmp_path):
    model = rod().build()
    with pytest.raises(ParameterError, match="suffix"):
        write_part(tmp_path / "rod.doc", model, unit="mm")
    with pytest.raises(ParameterError, match="unit"):
        write_part(tmp_path / "rod.step", model, unit="parsec")
    with pytest.raises(ParameterError, match="schema"):
        write_part(tmp_path / "rod.step", model, unit="mm", schema="AP203")
    with pytest.raises(ParameterError, match="origin"):
        write_part(tmp_path / "rod.step", model, unit="mm", origin=(0.0, np.nan, 0.0))
    with pytest.raises(ParameterError, match="deflection"):
        write_part(tmp_path / "rod.stl", model, unit="mm", deflection=-1.0)
    with pytest.raises(OutputError):
        write_part(tmp_path / "none" / "rod.step", model, unit="mm")


def test_faces_stay_where_the_kernel_refuses_all_that_share_edges(monkeypatch):
    def picky(whole):
        found = check(whole.shape)
        return found.valid and found.free_edges >= found.n_edges - 1

    monkeypatch.setattr(Assembled, "sound", property(picky))
    part = rod().build()
    assert part.valid
    assert not part.closed
    assert [face.trimmed for face in part.faces] == ["alone"] * 3
    assert any("edges of its own" in note for note in part.notes)
    assert part.coverage > 0.99


@pytest.mark.parametrize(("caution", "apart"), [(0, 0.05), (1, 0.0)])
def test_with_caution_an_edge_ends_in_its_vertex(caution, apart):
    line = np.column_stack([np.linspace(0, 20, 21), np.zeros(21), np.zeros(21)])
    floor, wall = Plane(np.zeros(3), np.eye(3)[2]), Plane(np.zeros(3), np.eye(3)[1])
    vertices = np.array([[0.0, 0.05, 0.0], [20.0, 0.05, 0.0]])
    guide = _guide(Border(line, (0, 1), (0, 1)), [floor, wall], 1.0, caution)
    assert np.linalg.norm(_ends(guide, vertices, 1.0) - vertices, axis=1) == pytest.approx([apart, apart], abs=1e-6)


def test_directions_have_no_negative_zero():
    assert _sentence({"axis": [-1e-9, 0.0, -1.0]}, {}, "mm") == "axis (0.0000, 0.0000, -1.0000)"


@pytest.mark.parametrize(
    ("note", "named"),
    [
        (
            "Face 2 (plane) does not fit its neighbours (Too wide): it has its own outline.",
            "cone_5 does not fit its neighbours (Too wide): it",
        ),
        ("The surface of face 1 (torus) was bent to meet its neighbours.", "The surface of plane_0 was bent to meet its neighbours."),
        ("The surfaces of faces 1 and 2 lie 0.56 spacings from", "The surfaces of plane_0 and cone_5 lie 0.56 spacings from"),
        ("Faces with outlines of their own were sewn; 3 free edges are left.", "Faces with outlines of their own were sewn; 3 free"),
        ("Face 9 (plane) could not be made.", "a face that was lost could not be made."),
    ],
)
def test_notes_call_faces_by_their_names(note, named):
    assert _named([note], {0: "plane_0", 1: "cone_5"}, 1)[0].startswith(named)


def test_a_face_that_would_leave_out_most_of_its_points_gets_an_outline_of_its_own():
    body = box()
    shapes, borders, outward = body.shapes, body.borders, body.outward
    whole = topology(borders, body.vertices, outward)
    floor = np.array([[0, 0, 0], [8, 0, 0], [8, 6, 0], [0, 6, 0]], float)
    tiles = [floor + np.array([0, 0, 0.001 * k]) for k in range(8)]  # a mesh that says the face is eight times as large as its borders hold
    corners = np.concatenate(tiles)
    quads = np.concatenate([[[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]] for k in range(8)])
    mesh = LabelledMesh(corners, quads.astype(np.int32), np.zeros(len(quads), np.int32))
    scale = replace(measure_scale(body.points), h=0.2)
    part = build_part(body.points, [Fit(s) for s in shapes], replace(whole, mesh=mesh), scale)
    assert any("leave out a part of its points" in note for note in part.notes)
    assert part.faces[0].trimmed != "shared"
