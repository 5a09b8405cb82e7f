"""Cell complexes of solids whose faces, borders and vertices are known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.double import part_double_edges
from scan2nurbs.faces.gaps import is_pinhole
from scan2nurbs.faces.sheet import Sheet, drop_triangles, span_sheet
from scan2nurbs.faces.topology import TopologyParams, _bubbles, find_topology
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus
from topology_faults import topology_faults

NOISE = 0.25


@dataclass
class Fit:
    shape: object


def grid(a, b, jitter, rng):
    """Points about 1 apart in the rectangle [0, a] × [0, b]."""
    x, y = np.meshgrid(np.arange(0.5, a), np.arange(0.5, b), indexing="ij")
    p = np.column_stack([x.ravel(), y.ravel()])
    return np.clip(p + rng.uniform(-jitter, jitter, p.shape), 0, (a, b))


def box(size, rng, *, without=()):
    """Points, labels and planes of a box; the planes' normals point to either side at random."""
    points, label, fits = [], [], []
    for axis in range(3):
        for side in (0, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            uv = grid(size[u], size[v], 0.3, rng)
            p = np.zeros((len(uv), 3))
            p[:, u], p[:, v], p[:, axis] = uv[:, 0], uv[:, 1], side * size[axis]
            normal = np.zeros(3)
            normal[axis] = rng.choice([-1.0, 1.0])
            fits.append(Fit(Plane(np.eye(3)[axis] * side * size[axis], normal)))
            if (axis, side) not in without:
                points.append(p)
                label.append(np.full(len(p), len(fits) - 1, np.int32))
    return np.concatenate(points), np.concatenate(label), fits


def noisy(points, rng, noise=NOISE):
    return points + rng.normal(size=points.shape) * noise


def solve(points, label, fits, **params):
    topology = find_topology(points, label, fits, measure_scale(points), TopologyParams(**params))
    assert topology_faults(topology) == []
    return topology


def counts(topology):
    return topology.n_faces, len(topology.borders), len(topology.vertices)


def assert_outward(topology, fits, middle):
    """Every face's normal, turned outward, points away from the middle of a convex body."""
    mesh = topology.mesh
    centre = mesh.vertices[mesh.triangles].mean(axis=1)
    for f in range(topology.n_faces):
        p = centre[mesh.face == f]
        n = fits[topology.source[f]].shape.normal(p) * topology.outward[f]
        assert np.einsum("ij,ij->i", n, p - middle).mean() > 0
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", np.cross(a, b), c) > 0  # counter-clockwise seen from outside


@pytest.mark.parametrize("noise", [0.0, 0.25, 0.5])
def test_a_box_has_six_faces_twelve_borders_and_eight_vertices_where_its_planes_meet(noise):
    rng = np.random.default_rng(1)
    size = np.array([20.0, 15.0, 4.0])
    points, label, fits = box(size, rng)
    topology = solve(noisy(points, rng, noise), label, fits)
    assert counts(topology) == (6, 12, 8)
    assert topology.closed == (True,)
    assert all(len(loops) == 1 and len(loops[0]) == 4 for loops in topology.loops)
    corners = np.array(sorted(map(tuple, topology.vertices.round(6))))
    assert np.allclose(corners, [[x, y, z] for x in (0, size[0]) for y in (0, size[1]) for z in (0, size[2])], atol=1e-6)
    for border in topology.borders:
        for f in border.faces:
            assert np.abs(fits[topology.source[f]].shape.distance(border.points)).max() < 1e-6
    assert_outward(topology, fits, size / 2)


def test_loops_turn_counter_clockwise_seen_from_outside():
    rng = np.random.default_rng(2)
    points, label, fits = box((12.0, 10.0, 8.0), rng)
    topology = solve(noisy(points, rng), label, fits)
    for f, (loop,) in enumerate(topology.loops):
        line = np.concatenate([topology.borders[b].points[:: 1 if forward else -1][:-1] for b, forward in loop])
        area = 0.5 * np.cross(line, np.roll(line, -1, axis=0)).sum(axis=0)
        normal = fits[topology.source[f]].shape.direction * topology.outward[f]
        assert area @ normal > 50


def test_a_box_without_its_lid_is_open_and_is_closed_when_holes_are_filled():
    rng = np.random.default_rng(3)
    points, label, fits = box((12.0, 10.0, 8.0), rng, without=[(2, 1)])
    points = noisy(points, rng)
    topology = solve(points, label, fits)
    assert topology.closed == (False,)
    assert counts(topology) == (5, 12, 8)
    assert sum(b.faces[1] < 0 for b in topology.borders) == 4
    assert solve(points, label, fits, fill_holes=True).closed == (True,)


def test_a_sheet_has_one_free_border():
    rng = np.random.default_rng(4)
    uv = grid(15, 12, 0.3, rng)
    points = noisy(np.column_stack([uv, np.zeros(len(uv))]), rng, 0.1)
    topology = solve(points, np.zeros(len(points), np.int32), [Fit(Plane(np.zeros(3), np.array([0.0, 0.0, 1.0])))])
    assert counts(topology) == (1, 1, 0)
    assert topology.borders[0].faces == (0, -1)
    assert topology.closed == (False,)


def rod(radius, height, rng):
    """Points, labels and surfaces of a cylinder with flat ends."""
    uv = grid(2 * np.pi * radius, height, 0.3, rng)
    side = np.column_stack([radius * np.cos(uv[:, 0] / radius), radius * np.sin(uv[:, 0] / radius), uv[:, 1]])
    disc = grid(2 * radius, 2 * radius, 0.3, rng) - radius
    disc = disc[np.linalg.norm(disc, axis=1) < radius]
    ends = [np.column_stack([disc, np.full(len(disc), z)]) for z in (0.0, height)]
    axis = np.array([0.0, 0.0, 1.0])
    fits = [Fit(Cylinder(np.zeros(3), axis, radius)), Fit(Plane(np.zeros(3), axis)), Fit(Plane(height * axis, axis))]
    return np.concatenate([side, *ends]), np.repeat(np.arange(3, dtype=np.int32), [len(side), len(disc), len(disc)]), fits


def test_a_rod_has_two_circles_without_vertices():
    rng = np.random.default_rng(5)
    points, label, fits = rod(6.0, 15.0, rng)
    topology = solve(noisy(points, rng), label, fits)
    assert counts(topology) == (3, 2, 0)
    assert sorted(len(loops) for loops in topology.loops) == [1, 1, 2]
    for border in topology.borders:
        assert np.allclose(np.linalg.norm(border.points[:, :2], axis=1), 6.0, atol=1e-3)
    assert_outward(topology, fits, np.array([0, 0, 7.5]))


def test_a_sphere_and_a_torus_have_no_border_and_their_handles_are_counted():
    rng = np.random.default_rng(6)
    v = rng.normal(size=(900, 3))
    ball = 7.0 * v / np.linalg.norm(v, axis=1)[:, None]
    topology = solve(noisy(ball, rng, 0.1), np.zeros(900, np.int32), [Fit(Sphere(np.zeros(3), 7.0))])
    assert (counts(topology), topology.closed, topology.genus.tolist()) == ((1, 0, 0), (True,), [0])
    u, w = rng.uniform(0, 2 * np.pi, (2, 2500))
    ring = np.column_stack([(10 + 4 * np.cos(w)) * np.cos(u), (10 + 4 * np.cos(w)) * np.sin(u), 4 * np.sin(w)])
    topology = solve(noisy(ring, rng, 0.1), np.zeros(2500, np.int32), [Fit(Torus(np.zeros(3), np.array([0.0, 0.0, 1.0]), 10.0, 4.0))])
    assert (counts(topology), topology.closed, topology.genus.tolist()) == ((1, 0, 0), (True,), [1])


def test_two_bodies_stay_two():
    rng = np.random.default_rng(7)
    a, label_a, fits_a = box((10.0, 9.0, 8.0), rng)
    b, label_b, fits_b = rod(4.0, 9.0, rng)
    points = np.concatenate([a, b + np.array([20.0, 5.0, 0.0])])
    moved = [Fit(Cylinder(np.array([20.0, 5.0, 0.0]), np.array([0.0, 0.0, 1.0]), 4.0)), *fits_b[1:]]
    topology = solve(noisy(points, rng), np.concatenate([label_a, label_b + 6]), [*fits_a, *moved])
    assert topology.closed == (True, True)
    assert counts(topology) == (9, 14, 8)
    assert {frozenset(topology.source[topology.body == k].tolist()) for k in (0, 1)} == {frozenset(range(6)), frozenset({6, 7, 8})}


def test_borders_of_smooth_neighbours_lie_on_both():
    """A plate with a rounded edge: plane, quarter of a cylinder, plane."""
    rng = np.random.default_rng(8)
    flat, arc = grid(14, 20, 0.3, rng), grid(5 * np.pi / 2, 20, 0.3, rng)
    t = arc[:, 0] / 5
    points = np.concatenate(
        [
            np.column_stack([-flat[:, 0], flat[:, 1], np.full(len(flat), 5.0)]),
            np.column_stack([5 * np.sin(t), arc[:, 1], 5 * np.cos(t)]),
            np.column_stack([np.full(len(flat), 5.0), flat[:, 1], -flat[:, 0]]),
        ]
    )
    label = np.repeat(np.arange(3, dtype=np.int32), [len(flat), len(arc), len(flat)])
    fits = [
        Fit(Plane(np.array([0, 0, 5.0]), np.array([0, 0, 1.0]))),
        Fit(Cylinder(np.zeros(3), np.array([0, 1.0, 0]), 5.0)),
        Fit(Plane(np.array([5.0, 0, 0]), np.array([-1.0, 0, 0]))),
    ]
    topology = solve(noisy(points, rng), label, fits)
    assert (topology.n_faces, topology.closed) == (3, (False,))
    between = [b for b in topology.borders if b.faces[1] >= 0]
    assert len(between) == 2
    for border in between:
        assert 15 < np.linalg.norm(np.diff(border.points, axis=0), axis=1).sum() < 26
        for f in border.faces:
            assert np.abs(fits[topology.source[f]].shape.distance(border.points)).max() < 0.15
    assert np.ptp(topology.outward * np.array([1, 1, -1])[topology.source]) == 0


@settings(deadline=None, max_examples=8, phases=[Phase.generate])
@given(seed=st.integers(0, 1000), swapped=st.floats(0, 0.1), lost=st.floats(0, 0.1))
def test_soiled_labels_leave_a_box_a_box(seed, swapped, lost):
    rng = np.random.default_rng(seed)
    points, label, fits = box((14.0, 11.0, 7.0), rng)
    points = noisy(points, rng)
    wrong = rng.random(len(label)) < swapped
    label = np.where(wrong, rng.integers(0, 6, len(label)), label)
    label = np.where(rng.random(len(label)) < lost, -1, label).astype(np.int32)
    topology = solve(points, label, fits)
    assert (counts(topology), topology.closed) == ((6, 12, 8), (True,))


@settings(deadline=None, max_examples=4, phases=[Phase.generate])
@given(seed=st.integers(0, 1000), scale=st.floats(1e-3, 1e3))
def test_motion_and_scale_change_nothing_but_places(seed, scale):
    rng = np.random.default_rng(seed)
    points, label, fits = box((12.0, 9.0, 7.0), rng)
    points = noisy(points, rng)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    shift = rng.normal(size=3) * 10
    moved = [Fit(Plane(scale * (f.shape.point @ q.T + shift), f.shape.direction @ q.T)) for f in fits]
    topology = solve(scale * (points @ q.T + shift), label, moved)
    assert (counts(topology), topology.closed) == ((6, 12, 8), (True,))


def test_half_edges_of_a_sheet_pair_and_run_against_each_other():
    v = np.random.default_rng(12).normal(size=(700, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]
    sheet = span_sheet(v, v, 0.13)
    half = np.arange(len(sheet.twin))
    start, end = sheet.triangles.ravel(), np.roll(sheet.triangles, -1, axis=1).ravel()
    assert (sheet.twin >= 0).all()
    assert np.array_equal(sheet.twin[sheet.twin], half)
    assert np.array_equal(start[sheet.twin], end)
    opened = drop_triangles(sheet, half[::3] // 3 % 5 > 0)
    inner = opened.twin >= 0
    assert np.array_equal(opened.twin[opened.twin[inner]], np.flatnonzero(inner))


def test_double_edges_are_parted():
    """Two tetrahedra's surfaces glued along one edge: four triangles share it, by pairs."""
    triangles = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 3], [2, 1, 3], [0, 1, 4], [1, 0, 5], [0, 4, 5], [4, 1, 5]], np.int32)
    twin = np.full(24, -1, np.int32)
    for body in (range(12), range(12, 24)):
        ends = {(int(triangles[h // 3, h % 3]), int(triangles[h // 3, (h + 1) % 3])): h for h in body}
        for (u, v), h in ends.items():
            twin[h] = ends[v, u]
    place = np.random.default_rng(13).normal(size=(6, 3))
    sheet, more = part_double_edges(Sheet(np.arange(6, dtype=np.int32), triangles, twin), place)
    start, end = sheet.triangles.ravel(), np.roll(sheet.triangles, -1, axis=1).ravel()
    assert len(set(zip(start.tolist(), end.tolist(), strict=True))) == len(start) == 30
    assert np.array_equal(start[sheet.twin], end)
    assert np.allclose(more[6], place[:2].mean(axis=0))


def test_faults_of_a_complex_are_told():
    rng = np.random.default_rng(14)
    points, label, fits = box((12.0, 9.0, 7.0), rng)
    topology = solve(points, label, fits)
    first = topology.borders[0]
    wrong = replace(first, faces=(first.faces[1], first.faces[0]))
    assert any("another face on its left" in f for f in topology_faults(replace(topology, borders=(wrong, *topology.borders[1:]))))
    assert any("Euler" in f for f in topology_faults(replace(topology, genus=topology.genus + 1)))
    assert any("said to be open" in f for f in topology_faults(replace(topology, closed=(False,))))
    assert any("not walked" in f for f in topology_faults(replace(topology, loops=((), *topology.loops[1:]))))


def test_the_same_comes_out_twice():
    rng = np.random.default_rng(9)
    points, label, fits = box((12.0, 9.0, 7.0), rng)
    a, b = (solve(points, label, fits) for _ in range(2))
    assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    assert np.array_equal(a.mesh.triangles, b.mesh.triangles)
    assert a.loops == b.loops


def test_large_clouds_are_thinned():
    rng = np.random.default_rng(10)
    points, label, fits = box((30.0, 24.0, 16.0), rng)
    topology = solve(noisy(points, rng, 0.1), label, fits, max_points=1200)
    assert counts(topology) == (6, 12, 8)
    assert len(topology.mesh.vertices) < len(points)


def test_too_few_points_and_bad_parameters_are_refused():
    points, label, fits = box((5.0, 5.0, 5.0), np.random.default_rng(11))
    with pytest.raises(NoResultError, match="too few"):
        find_topology(points, np.full(len(label), -1, np.int32), fits, measure_scale(points))
    with pytest.raises(ParameterError, match="'reach'"):
        TopologyParams(reach=0.5)


def test_a_small_gap_within_a_face_is_closed_and_a_large_one_stays():
    rng = np.random.default_rng(4)
    xy = np.stack(np.meshgrid(np.arange(60.0), np.arange(50.0), indexing="ij"), axis=-1).reshape(-1, 2) + rng.uniform(
        -0.25, 0.25, (3000, 2)
    )
    for radius, borders in ((3.7, 1), (7.0, 2)):
        kept = xy[np.hypot(xy[:, 0] - 30, xy[:, 1] - 25) > radius]
        points = noisy(np.c_[kept, np.zeros(len(kept))], rng)
        label = np.zeros(len(points), np.int32)
        topology = solve(points, label, [Fit(Plane(np.zeros(3), np.array([0.0, 0.0, 1.0])))])
        assert len(topology.loops[0]) == borders


def test_gaps_between_faces_are_closed_up_to_a_quarter_of_those_within_one():
    """A strip of triangles of half a unit each, two of which lie in no data, between points of two faces."""
    points = np.array([[i // 2, i % 2, 0.0] for i in range(12)], float)
    triangles = np.array(
        [[2 * k, 2 * k + 2, 2 * k + 1] for k in range(5)] + [[2 * k + 1, 2 * k + 2, 2 * k + 3] for k in range(5)], np.int32
    )
    sheet = Sheet(np.arange(12, dtype=np.int32), triangles, np.full(30, -1, np.int32))
    covered = np.ones(10, bool)
    covered[2] = False
    one, two = np.zeros(12, np.int32), (np.arange(12) % 2).astype(np.int32)
    for label, most, closed in ((one, 0.6, 1), (one, 0.4, 0), (two, 2.4, 1), (two, 1.6, 0)):
        assert is_pinhole(sheet, points, label, covered, most).sum() == closed


def test_what_closes_up_on_one_flat_face_is_a_bubble():
    tetrahedron = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    edges = [(int(t[k]), int(t[(k + 1) % 3])) for t in tetrahedron for k in range(3)]
    twin = np.array([edges.index((v, u)) for u, v in edges])
    triangles = np.concatenate([tetrahedron + 4 * k for k in range(3)] + [[[12, 13, 14]]]).astype(np.int32)
    twins = np.concatenate([*(twin + 12 * k for k in range(3)), [-1, -1, -1]]).astype(np.int32)
    sheet = Sheet(np.arange(15, dtype=np.int32), triangles, twins)
    # On a plane alone, on a sphere alone, on both, and on a plane but open.
    region = np.repeat([0, 1, 0, 1, 0], [4, 4, 3, 1, 3]).astype(np.int32)
    np.testing.assert_array_equal(_bubbles(sheet, region, ["plane", "sphere"]), np.repeat([True, False], [4, 9]))


def test_a_bubble_beside_a_part_is_left_out_and_told():
    rng = np.random.default_rng(2)
    points, label, fits = box((30.0, 24.0, 18.0), rng)
    scale = measure_scale(points)
    before = find_topology(points, label, fits, scale)
    # Points of a narrow tube far from the part, which were taken for one cylinder; its ends are rounded, and are of it, too.
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-4, 4, 17)))
    radius = 3.0 * np.sqrt(1 - (np.abs(v) / 4.2) ** 6)
    tube = np.c_[60 + radius * np.cos(u), radius * np.sin(u), v]
    cloud, labels = np.vstack([points, tube]), np.r_[label, np.full(len(tube), len(fits))].astype(np.int32)
    ball = Fit(Sphere(np.array([60.0, 0, 0]), 3.5))
    assert find_topology(cloud, labels, [*fits, ball], measure_scale(cloud)).n_faces == before.n_faces + 1
    parted = find_topology(cloud, labels, [*fits, Fit(_Blob(ball.shape))], measure_scale(cloud))
    assert parted.n_faces == before.n_faces
    assert parted.closed == before.closed
    assert any("Closed specks" in note for note in parted.notes)
    assert topology_faults(parted) == []


class _Blob:
    """A ball that says of itself that it is a cylinder: what noise makes of the two sides of a thin one."""

    kind = "cylinder"

    def __init__(self, ball):
        self.ball = ball

    def __getattr__(self, name):
        return getattr(self.ball, name)
