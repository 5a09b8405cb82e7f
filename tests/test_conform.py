"""Surfaces that are bent to reach the borders of their faces, and parts that close by it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from scan2nurbs.brep.alone import trim_anew, trim_by_points
from scan2nurbs.brep.check import is_valid
from scan2nurbs.brep.conform import _folds_within, conformed, mesh_surface
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.part import build_part
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.orient import outward_signs
from scan2nurbs.faces.topology import find_topology
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

X, Y, Z = np.eye(3)
ZERO = np.zeros(3)


@dataclass
class Fit:
    shape: object


def rectangle(width, depth, lift):
    """A closed loop around [0, width] × [0, depth]; `lift` gives its height over (x, y)."""
    s = np.linspace(0.0, 1.0, 200)
    corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth], [0, 0]], float)
    xy = np.vstack([a + s[:, None] * (b - a) for a, b in itertools.pairwise(corners)])
    return np.column_stack([xy, lift(*xy.T)])


@given(st.floats(-2.0, 2.0), st.floats(20.0, 80.0))
@settings(deadline=None, max_examples=15)
def test_a_plane_reaches_a_border_that_leaves_it_and_stays_elsewhere(height, width):
    loop = rectangle(width, 30.0, lambda x, y: height * np.exp(-((x - width / 2) ** 2 + y**2) / 9.0))
    bent = conformed(Plane(ZERO, Z), [loop], 1.0)
    assert np.abs(bent.distance(loop)).max() < 0.15
    away = np.column_stack([np.linspace(1, width - 1, 40), np.full(40, 12.0), np.zeros(40)])
    assert np.abs(bent.distance(away)).max() < 0.03


def test_a_surface_that_meets_its_border_is_left_as_it_was():
    t = np.linspace(0.0, 1.2, 80)
    path = np.concatenate([np.column_stack([t, 0 * t]), np.column_stack([1.2 + 0 * t, t]), np.column_stack([t[::-1], 1.2 + 0 * t])])
    for shape, at in (
        (Cylinder(ZERO, Z, 20.0), lambda u, v: [20 * np.cos(u), 20 * np.sin(u), 20 * v]),
        (Cone(ZERO, Z, 20.0, 0.3), lambda u, v: [(20 + 5 * v * np.tan(0.3)) * np.cos(u), (20 + 5 * v * np.tan(0.3)) * np.sin(u), 5 * v]),
        (Torus(ZERO, Z, 30.0, 8.0), lambda u, v: [(30 + 8 * np.cos(v)) * np.cos(u), (30 + 8 * np.cos(v)) * np.sin(u), 8 * np.sin(v)]),
        (Sphere(ZERO, 25.0), lambda u, v: [25 * np.cos(v) * np.cos(u), 25 * np.cos(v) * np.sin(u), 25 * np.sin(v)]),
    ):
        loop = np.column_stack(at(*path.T))
        inner = np.column_stack(at(np.linspace(0.1, 1.1, 30), np.linspace(0.1, 1.1, 30)))
        bent = conformed(shape, [np.vstack([loop, loop[:1]])], 1.0)
        assert np.abs(bent.distance(inner)).max() < 1e-3


def test_a_tube_stays_closed():
    t = np.linspace(0.0, 2 * np.pi, 200)
    low = np.column_stack([10 * np.cos(t), 10 * np.sin(t), np.zeros(200)])
    off = 10 + 1.5 * np.exp(-((t - 0.1) ** 2) / 0.02) + 1.5 * np.exp(-((t - 0.1 - 2 * np.pi) ** 2) / 0.02)
    high = np.column_stack([off * np.cos(t), off * np.sin(t), np.full(200, 20.0)])
    bent = conformed(Cylinder(ZERO, Z, 10.0), [low, high[::-1]], 1.0)
    assert bent.surface.closed == (True, False)
    control = bent.surface.control_points
    np.testing.assert_allclose(control[0], control[-1], atol=1e-9)
    assert np.abs(bent.distance(np.vstack([low, high]))).max() < 0.2


def test_what_cannot_be_bent_is_said():
    t = np.linspace(0.0, 2 * np.pi, 100)
    cap = np.column_stack([6 * np.cos(t), 6 * np.sin(t), np.full(100, 8.0)])
    with pytest.raises(NoResultError, match="pole"):
        conformed(Sphere(ZERO, 10.0), [cap], 1.0, Z)
    with pytest.raises(NoResultError, match="far"):
        conformed(Plane(ZERO, Z), [rectangle(20.0, 20.0, lambda x, y: 9.0 * (x > 10))], 1.0)
    with pytest.raises(NoResultError, match="fold"):
        conformed(Plane(ZERO, Z), [rectangle(60.0, 30.0, lambda x, y: 4.0 * np.sin(2.2 * (x + y)))], 1.0)


def stepped(step):
    """A block with a low step across its top, of which no face has the wall: points, labels, and the planes."""
    rng = np.random.default_rng(2)
    points, labels, planes = [], [], []

    def side(origin, u, v, width, depth):
        a, b = (g.ravel() + rng.uniform(-0.3, 0.3, g.size) for g in np.meshgrid(np.arange(0.5, width), np.arange(0.5, depth)))
        points.append(origin + np.clip(a, 0, width)[:, None] * u + np.clip(b, 0, depth)[:, None] * v)
        labels.append(np.full(len(a), len(planes)))
        planes.append(Fit(Plane(np.array(origin, float), np.cross(u, v))))

    side([0, 0, 0], X, Y, 40, 20)
    side([0, 0, 10], X, Y, 20, 20)
    side([20, 0, 10 + step], X, Y, 20, 20)
    side([0, 0, 0], Y, Z, 20, 10)
    side([40, 0, 0], Y, Z, 20, 10 + step)
    for y in (0, 20):
        side([0, y, 0], X, Z, 40, 10)
        high = np.array([[x, y, 10 + z] for x in np.arange(20.5, 40) for z in np.arange(0.5, step)]).reshape(-1, 3)
        points.append(high)
        labels.append(np.full(len(high), len(planes) - 1))
    wall = np.array([[20, y, 10 + z] for y in np.arange(0.5, 20) for z in np.arange(0.3, step, 0.8)])
    points.append(wall)
    labels.append(np.where(wall[:, 2] < 10 + step / 2, 1, 2))
    cloud = np.concatenate(points)
    return cloud + rng.normal(scale=0.1, size=cloud.shape), np.concatenate(labels).astype(np.int32), planes


@pytest.mark.parametrize("step", [1.3, 2.0])
def test_a_step_that_no_face_was_found_for_does_not_open_a_part(step):
    points, label, planes = stepped(step)
    scale = measure_scale(points)
    part = build_part(points, planes, find_topology(points, label, planes, scale), scale)
    assert part.valid
    assert part.closed
    assert [face.trimmed for face in part.faces].count("bent") == 1
    assert any("was bent to meet its neighbours" in note for note in part.notes)
    assert part.max_tolerance <= 0.5 * scale.h
    assert part.volume == pytest.approx(40 * 20 * 10 + 20 * 20 * step, rel=0.01)
    assert part.coverage > 0.99


def signs_of(points, normals, patch):
    neighbours = KDTree(points).query(points, 13)[1][:, 1:].astype(np.int32)
    return outward_signs(points, normals, patch, neighbours, np.full(len(points), 2.0))


def lattice(low, high, z):
    x, y = (g.ravel() for g in np.meshgrid(np.arange(low, high), np.arange(0.0, 20.0)))
    return np.column_stack([x, y, np.full(len(x), z)])


def test_planes_on_both_sides_of_a_low_step_look_the_same_way_and_those_of_a_thin_wall_do_not():
    for b, same in ((lattice(20.1, 40.0, 1.5), True), (lattice(0.3, 20.0, 1.5), False)):
        a = lattice(0.0, 20.0, 0.0)
        points = np.concatenate([a, b])
        patch = np.repeat([0, 1], [len(a), len(b)]).astype(np.int32)
        for turn in (1.0, -1.0):
            normals = np.where(patch[:, None] == 0, Z, turn * Z)
            found = signs_of(points, normals, patch)
            assert bool(found[0] == turn * found[1]) is same


def box():
    """A block of six planes, their normals inward and outward as they come: points, labels, planes."""
    rng = np.random.default_rng(4)
    points, labels, fits = [], [], []
    for origin, u, v, depth in (
        (ZERO, X, Y, 20),
        (10 * Z, X, Y, 20),
        (ZERO, Y, Z, 10),
        (20 * X, Y, Z, 10),
        (ZERO, X, Z, 10),
        (20 * Y, X, Z, 10),
    ):
        a, b = (g.ravel() + rng.uniform(-0.3, 0.3, g.size) for g in np.meshgrid(np.arange(0.5, 20), np.arange(0.5, depth)))
        points.append(origin + a[:, None] * u + b[:, None] * v)
        labels.append(np.full(len(a), len(fits)))
        fits.append(Fit(Plane(np.array(origin, float), np.cross(u, v))))
    cloud = np.concatenate(points)
    return cloud + rng.normal(scale=0.1, size=cloud.shape), np.concatenate(labels).astype(np.int32), fits


def test_a_surface_through_the_mesh_has_its_normals_on_the_side_of_the_surface_it_stands_for():
    cloud, labels, fits = box()
    scale = measure_scale(cloud)
    topology = find_topology(cloud, labels, fits, scale)
    assert set(topology.outward.tolist()) == {-1, 1}
    for f, source in enumerate(topology.source):
        points = cloud[labels == source]
        agree = np.einsum("nk,nk->n", mesh_surface(topology, f, scale.h).normal(points), fits[source].shape.normal(points))
        assert np.median(agree) > 0.99


def test_a_face_that_holds_a_pole_of_a_narrow_torus_is_not_lost():
    cloud, labels, fits = box()
    # The top was taken for a torus whose tube is wider than its ring: within it lies a dent where the surface passes through its axis.
    fits[1] = Fit(Torus(center=np.array([10.0, 10.0, -89.9]), axis=Z, major=5.0, minor=100.0))
    scale = measure_scale(cloud)
    topology = find_topology(cloud, labels, fits, scale)
    part = build_part(cloud, fits, topology, scale)
    assert part.valid
    assert part.closed
    assert not any(face.trimmed == "lost" for face in part.faces)
    assert part.volume == pytest.approx(20 * 20 * 10, rel=0.03)
    alone = trim_anew(int(np.flatnonzero(topology.source == 1)[0]), topology, scale.h, 1.0)
    assert len(alone) == 1
    assert is_valid(alone[0])


@pytest.mark.parametrize("shape", ["own", "narrow torus"])
def test_a_face_whose_borders_are_of_no_use_is_trimmed_by_its_points(shape):
    cloud, labels, fits = box()
    scale = measure_scale(cloud)
    topology = find_topology(cloud, labels, fits, scale)
    for f, source in enumerate(topology.source):
        own = fits[source].shape if shape == "own" else Torus(center=np.array([10.0, 10.0, -89.9]), axis=Z, major=5.0, minor=100.0)
        (face,) = trim_by_points(f, own, replace(topology, loops=((),) * topology.n_faces), scale.h, 1.0)
        assert is_valid(face)
        # An outline runs up to a spacing outside of its points.
        around = 4.0 * np.sqrt(topology.areas[f]) * scale.h
        assert 0.95 * topology.areas[f] < rough_area(face) < topology.areas[f] + 1.2 * around


@pytest.mark.parametrize(("middle", "seen"), [((4.0, 4.0), True), ((8.5, 4.0), False), ((1.5, 1.5), False), ((6.2, 5.0), True)])
def test_only_folds_that_a_face_shows_count(middle, seen):
    """The face is a square with a hole; a grid that is flat but for a fold lies under it."""
    axis = np.linspace(0.0, 10.0, 51)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    hill = np.exp(-((u - middle[0]) ** 2 + (v - middle[1]) ** 2) / 0.1)
    grid = np.stack([u - 1.5 * (u - middle[0]) * hill, v, np.zeros_like(u)], axis=2)
    square, hole = (np.array([(a, a), (b, a), (b, b), (a, b)]) for a, b in ((0.5, 6.0), (1.0, 2.0)))
    assert _folds_within(grid, (axis, axis), [square, hole], tube=False) is seen
    flat = np.stack([u, v, np.zeros_like(u)], axis=2)
    assert not _folds_within(flat, (axis, axis), [square, hole], tube=False)


@pytest.mark.parametrize(("at", "seen"), [(1.0, False), (5.0, True), (9.0, False)])
def test_of_a_tube_only_what_lies_between_its_ends_counts(at, seen):
    axis = np.linspace(0.0, 10.0, 51)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    grid = np.stack([u, v - 1.5 * (v - at) * np.exp(-((v - at) ** 2) / 0.1), np.zeros_like(u)], axis=2)
    ends = [np.column_stack([axis, np.full(51, height)]) for height in (3.0, 7.0)]
    assert _folds_within(grid, (axis, axis), ends, tube=True) is seen


@pytest.mark.parametrize(("at", "seen"), [((2.0, 7.5), True), ((7.0, 7.5), False), ((7.0, 2.5), True), ((2.0, 2.5), False)])
def test_the_ends_of_a_tube_may_be_slanted(at, seen):
    """The tube lies between two loops that rise and fall by three about heights of four and seven."""
    axis = np.linspace(0.0, 10.0, 51)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    hill = np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / 0.1)
    grid = np.stack([u, v - 1.5 * (v - at[1]) * hill, np.zeros_like(u)], axis=2)
    rise = 3.0 * np.sin(axis / 10.0 * 2.0 * np.pi)
    ends = [np.column_stack([axis + 20.0, height + rise]) for height in (4.0, 7.0)]
    assert _folds_within(grid, (axis, axis), ends, tube=True) is seen
