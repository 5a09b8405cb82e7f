"""Segmentation of whole parts: truth on small bodies, properties, and what cannot be segmented."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.compete import Sheet, fit_regions, link_weights
from scan2nurbs.faces.lost import find_lost
from scan2nurbs.faces.segmentation import Faces, SegmentParams, segment_points
from scan2nurbs.faces.unite import unite
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.primitives import CYLINDER, PLANE, SIZE
from scan2nurbs.scale import measure_scale

NOISE = 0.25


def rectangle(rng, origin, a, b):
    """Points, one per unit of area in a jittered grid, on the parallelogram of sides a and b."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    u, v = np.meshgrid(np.arange(0.5, np.linalg.norm(a)), np.arange(0.5, np.linalg.norm(b)), indexing="ij")
    u, v = u + rng.uniform(-0.25, 0.25, u.shape), v + rng.uniform(-0.25, 0.25, v.shape)
    return np.asarray(origin, float) + u.reshape(-1, 1) * a / np.linalg.norm(a) + v.reshape(-1, 1) * b / np.linalg.norm(b)


def rounded_step(rng, radius=12.0, size=40.0):
    """Two planes at right angles, joined by a quarter of a cylinder that both are tangent to."""
    low = rectangle(rng, [radius, 0, 0], [size, 0, 0], [0, size, 0])
    high = rectangle(rng, [0, 0, radius], [0, 0, size], [0, size, 0])
    flat = rectangle(rng, [0, 0, 0], [radius * np.pi / 2, 0, 0], [0, size, 0])
    angle = flat[:, 0] / radius
    bend = np.c_[radius - radius * np.sin(angle), flat[:, 1], radius - radius * np.cos(angle)]
    return _noisy(rng, [low, high, bend])


def box(rng, size=(36.0, 30.0, 24.0)):
    """The six faces of a box."""
    x, y, z = np.diag(size)
    faces = []
    for a, b, c in ((x, y, z), (y, z, x), (z, x, y)):
        faces += [rectangle(rng, np.zeros(3), a, b), rectangle(rng, c, a, b)]
    return _noisy(rng, faces)


def _noisy(rng, faces):
    points = np.concatenate(faces)
    truth = np.repeat(np.arange(len(faces)), [len(f) for f in faces])
    order = rng.permutation(len(points))
    return (points + rng.normal(scale=NOISE, size=points.shape))[order], truth[order]


def segment(points, **params) -> Faces:
    scale = measure_scale(points)
    return segment_points(points, scale, detect(points, scale, EdgeParams()), SegmentParams(**params))


def mean_iou(truth, label):
    table = np.zeros((truth.max() + 1, label.max() + 1))
    np.add.at(table, (truth[label >= 0], label[label >= 0]), 1)
    union = np.bincount(truth)[:, None] + table.sum(axis=0)[None] - table
    rows, columns = linear_sum_assignment(-table / union)
    return (table / union)[rows, columns].sum() / len(table)


@pytest.fixture(scope="module")
def step():
    points, truth = rounded_step(np.random.default_rng(1))
    return points, truth, segment(points)


def test_box_is_six_planes():
    points, truth = box(np.random.default_rng(0))
    faces = segment(points)
    assert len(faces.fits) == 6
    assert {fit.shape.kind for fit in faces.fits} == {"plane"}
    assert mean_iou(truth, faces.label) > 0.93
    assert faces.smooth == frozenset()


def test_tangent_cylinder_is_told_from_its_planes(step):
    _, truth, faces = step
    assert sorted(fit.shape.kind for fit in faces.fits) == ["cylinder", "plane", "plane"]
    assert mean_iou(truth, faces.label) > 0.85
    radius = next(fit.shape.radius for fit in faces.fits if fit.shape.kind == "cylinder")
    assert radius == pytest.approx(12.0, rel=0.1)
    assert len(faces.smooth) == 2


def test_faces_are_numbered_by_falling_size(step):
    _, _, faces = step
    size = np.bincount(faces.label[faces.label >= 0])
    assert (np.diff(size) <= 0).all()
    assert [fit.n_points for fit in faces.fits] == size.tolist()


def test_same_points_same_faces(step):
    points, _, faces = step
    again = segment(points)
    np.testing.assert_array_equal(again.label, faces.label)


def test_units_do_not_matter(step):
    points, _, faces = step
    scaled = segment(points * 1024.0)
    assert np.mean(scaled.label == faces.label) > 0.99


def test_planes_that_lie_apart_are_two_faces():
    rng = np.random.default_rng(3)
    points, _ = _noisy(rng, [rectangle(rng, [0, 0, 0], [25, 0, 0], [0, 25, 0]), rectangle(rng, [40, 0, 0], [25, 0, 0], [0, 25, 0])])
    faces = segment(points)
    assert len(faces.fits) == 2


def test_whole_cylinder_is_one_face():
    rng = np.random.default_rng(4)
    flat = rectangle(rng, [0, 0, 0], [2 * np.pi * 15, 0, 0], [0, 40, 0])
    angle = flat[:, 0] / 15
    points, _ = _noisy(rng, [np.c_[15 * np.cos(angle), 15 * np.sin(angle), flat[:, 1]]])
    faces = segment(points)
    assert [fit.shape.kind for fit in faces.fits] == ["cylinder"]
    assert faces.fits[0].shape.radius == pytest.approx(15.0, rel=0.01)


def test_outliers_belong_to_no_face():
    rng = np.random.default_rng(5)
    points, _ = box(rng)
    far = rng.uniform(-60, 90, (40, 3))
    faces = segment(np.r_[points, far])
    assert len(faces.fits) == 6
    assert np.mean(faces.label[len(points) :] < 0) > 0.7


def test_only_the_kinds_asked_for(step):
    points, _, _ = step
    faces = segment(points, keep_types=("plane",))
    assert {fit.shape.kind for fit in faces.fits} == {"plane"}


def test_at_most_so_many_faces(step):
    points, _, _ = step
    faces = segment(points, max_faces=2)
    assert len(faces.fits) == 2
    assert faces.label.max() == 1


def test_large_clouds_follow_their_thinned_selves(step):
    points, truth, _ = step
    faces = segment(points, most_points=2500)
    assert len(faces.fits) == 3
    assert mean_iou(truth, faces.label) > 0.8


@pytest.mark.parametrize("n", [3, 4, 12])
def test_few_points_are_no_crash(n):
    points = np.random.default_rng(n).normal(size=(n, 3))
    faces = segment(points)
    assert len(faces.label) == n
    assert len(faces.fits) == faces.label.max() + 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"tolerance": 0.0},
        {"tolerance": float("nan")},
        {"max_faces": 0},
        {"min_points": 5},
        {"most_points": 10},
        {"keep_types": ()},
        {"keep_types": ("plane", "ball")},
    ],
)
def test_parameters_are_checked(wrong):
    with pytest.raises(ParameterError, match="segment_points"):
        SegmentParams(**wrong)


def test_planes_that_nearly_coincide_are_united_and_those_of_a_shallow_crease_are_not():
    """Where each point chose the nearer of two planes their residuals are too small: that is no reason to keep both."""
    n = 60
    united = []
    for seed in range(8, 14):
        rng = np.random.default_rng(seed)
        places = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 2).astype(float)
        tilt = 0.35 * NOISE / n
        cells = build_cells(np.c_[places, np.zeros(n * n)], 3.0)
        places = cells.points[:, :2]
        neighbours, _ = nearest_neighbours(cells, 12, reach=2.5)
        neighbours = np.where(neighbours < 0, np.arange(n * n, dtype=np.int32)[:, None], neighbours)
        noise = rng.normal(scale=NOISE, size=n * n)
        along = places[:, 0] - 0.5 * n
        near = (np.abs(noise - tilt * along - 0.5 * NOISE) > np.abs(noise + tilt * along + 0.5 * NOISE)).astype(np.int32)
        ridge = (along > 0).astype(np.int32)
        faces = []
        for height, label in ((np.zeros(n * n), near), (0.08 * np.abs(along), ridge)):
            points = np.c_[places, height + noise]
            normals = np.tile([0.0, 0.0, 1.0], (n * n, 1))
            sheet = Sheet(points, normals, neighbours, link_weights(normals, neighbours), NOISE, 0.12)
            models = np.zeros((2, SIZE))
            models[:, 1:3], models[:, 6] = 0.5 * n, 1.0
            kinds = np.arange(6) == PLANE
            values = fit_regions(sheet, label, models, kinds)
            faces.append(len(np.unique(unite(sheet, label, models, values, kinds)[0])))
        united.append(faces[0] == 1)
        assert faces[1] == 2
    assert sum(united) >= len(united) - 1  # what the choice took away can be reckoned but for chance


def test_slivers_of_a_large_cylinder_are_united_with_it():
    """Whatever borders they have, they are no surfaces of their own."""
    rng = np.random.default_rng(5)
    radius, n, height = 60.0, 376, 80
    i, z = np.meshgrid(np.arange(n), np.arange(height), indexing="ij")
    angle = (i + rng.uniform(-0.25, 0.25, i.shape)).ravel() / radius
    at = z.ravel() + rng.uniform(-0.25, 0.25, i.size)
    out = np.c_[np.cos(angle), np.sin(angle), np.zeros(len(angle))]
    cells = build_cells((radius + rng.normal(scale=NOISE, size=len(angle)))[:, None] * out + at[:, None] * [0.0, 0.0, 1.0], 3.0)
    neighbours, _ = nearest_neighbours(cells, 8, reach=2.5)
    around = np.arctan2(cells.points[:, 1], cells.points[:, 0]) * radius
    label = np.where((around % 30.0 < 4.0) & (cells.points[:, 2] < 70.0), 1 + around // 30.0 + 10.0, 0.0)
    label = np.unique(label, return_inverse=True)[1].astype(np.int32)
    normals = cells.points * [1.0, 1.0, 0.0] / np.linalg.norm(cells.points[:, :2], axis=1)[:, None]
    sheet = Sheet(cells.points, normals, neighbours, link_weights(normals, neighbours), NOISE, 0.12)
    models = np.zeros((label.max() + 1, SIZE))
    models[:, 0], models[:, 6], models[:, 7] = CYLINDER, 1.0, radius
    kinds = np.isin(np.arange(6), (PLANE, CYLINDER))
    values = fit_regions(sheet, label, models, kinds)
    assert len(models) > 10
    assert len(np.unique(unite(sheet, label, models, values, kinds)[0])) == 1


def test_three_planes_amid_the_noise_of_one_are_united():
    """What goes to the third of them is missing where two are compared; another plane shows what noise leaves."""
    rng = np.random.default_rng(8)
    n = 90
    places = np.stack(np.meshgrid(np.arange(2 * n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 2).astype(float)
    cells = build_cells(np.c_[places, np.zeros(len(places))], 3.0)
    places = cells.points[:, :2]
    neighbours, _ = nearest_neighbours(cells, 12, reach=2.5)
    neighbours = np.where(neighbours < 0, np.arange(len(places), dtype=np.int32)[:, None], neighbours)
    noise = rng.normal(scale=NOISE, size=len(places))
    # Each of the three has a stripe of its own, and a third of the points that noise moves to it elsewhere.
    height = np.array([-0.8, 0.0, 0.8]) * NOISE
    stripe = np.minimum(places[:, 0] // (n / 3), 2).astype(np.int32)
    nearest = np.abs(noise[:, None] - height).argmin(axis=1).astype(np.int32)
    label = np.where(places[:, 0] >= n, 3, np.where(rng.random(len(places)) < 0.35, nearest, stripe)).astype(np.int32)
    points = np.c_[places, noise + 50.0 * (label == 3)]
    sheet = Sheet(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), neighbours, np.ones(neighbours.shape), NOISE, 0.12)
    models = np.zeros((4, SIZE))
    models[:, 1:3], models[:, 3], models[:, 6] = 0.5 * n, [*height, 50.0], 1.0
    kinds = np.arange(6) == PLANE
    values = fit_regions(sheet, label, models, kinds)
    joined, _ = unite(sheet, label, models, values, kinds)
    assert len(np.unique(joined)) == 2


def test_the_bottom_of_a_blind_hole_gets_a_plane_and_stray_points_do_not():
    """Wall and bottom of a narrow hole, all labelled as the wall; a few points beside it that lie in no plane."""
    rng = np.random.default_rng(3)
    turn, z = (g.ravel() for g in np.meshgrid(np.arange(0.0, 2 * np.pi, 1 / 3), np.arange(0.5, 20.0)))
    wall = np.c_[3 * np.cos(turn), 3 * np.sin(turn), z]
    x, y = (g.ravel() for g in np.meshgrid(np.arange(-2.5, 3.0), np.arange(-2.5, 3.0)))
    bottom = np.c_[x, y, np.zeros(len(x))][np.hypot(x, y) < 2.9]
    stray = np.array([0.0, 0.0, 12.0]) + rng.uniform(-1.5, 1.5, (8, 3))
    cells = build_cells(np.vstack([wall, bottom, stray]) + rng.normal(scale=0.1, size=(len(wall) + len(bottom) + 8, 3)), 3.0)
    points = cells.points
    neighbours, _ = nearest_neighbours(cells, 12, reach=2.5)
    neighbours = np.where(neighbours < 0, np.arange(len(points), dtype=np.int32)[:, None], neighbours)
    sheet = Sheet(points, np.full(points.shape, np.nan), neighbours, np.ones(neighbours.shape), 0.1, 0.12)
    models = np.zeros((1, SIZE))
    models[0, 0], models[0, 6], models[0, 7] = CYLINDER, 1.0, 3.0
    label, found = find_lost(sheet, np.zeros(len(points), np.int32), models, 12)
    assert len(found) == 2
    assert found[1, 0] == PLANE
    assert abs(found[1, 6]) > 0.99
    deep = (np.hypot(points[:, 0], points[:, 1]) < 2.5) & (points[:, 2] < 1.0)
    assert deep.sum() > 12
    assert (label[deep] == 1).all()
    assert (label[points[:, 2] > 2.0] == 0).all()


def test_outliers_that_happen_to_lie_in_a_plane_are_of_no_face():
    rng = np.random.default_rng(7)
    points, _ = box(rng)
    # In the plane of a face, far from it and from each other; and enough of them for a face of their own, in no plane of the box.
    beside = np.c_[np.arange(60.0, 300.0, 30.0), np.full(8, 15.0), rng.normal(scale=NOISE, size=8)]
    apart = np.c_[np.repeat(np.arange(4) * 25.0, 5), np.tile(np.arange(5) * 25.0, 4), np.full(20, 80.0)]
    everything = np.vstack([points, beside, apart + rng.normal(scale=NOISE, size=apart.shape)])
    faces = segment(everything)
    assert len(faces.fits) == 6
    assert (faces.label[len(points) :] == -1).all()
    assert (faces.label[: len(points)] >= 0).mean() > 0.99
