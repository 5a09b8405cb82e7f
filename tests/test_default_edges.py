"""The default operator where edges are close to each other, marks are to be thin, and noise hides in few neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

import scan2nurbs as s2n
from scan2nurbs import scale
from scan2nurbs.edges.spacings import spacings_of


def plane(rng: np.random.Generator, a: float, b: float) -> np.ndarray:
    """Points of a rectangle, one a unit of area, on a jittered grid."""
    x, y = np.meshgrid(np.arange(0.5, a), np.arange(0.5, b), indexing="ij")
    return np.c_[x.ravel(), y.ravel()] + rng.uniform(-0.35, 0.35, (x.size, 2))


def box(size: tuple[float, float, float], noise: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Points on a box, and points along its edges."""
    rng = np.random.default_rng(seed)
    faces, edges = [], []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for level in (0.0, size[axis]):
            face = np.full((round(size[others[0]]) * round(size[others[1]]), 3), level)
            face[:, others] = plane(rng, size[others[0]], size[others[1]])
            faces.append(face)
        for u in (0.0, size[others[0]]):
            for v in (0.0, size[others[1]]):
                edge = np.empty((int(4 * size[axis]), 3))
                edge[:, axis], edge[:, others] = np.linspace(0.0, size[axis], len(edge)), (u, v)
                edges.append(edge)
    points = np.concatenate(faces)
    return points + noise * rng.normal(size=points.shape), np.concatenate(edges)


def scores(points: np.ndarray, mask: np.ndarray, edges: np.ndarray, within: float) -> tuple[float, float]:
    """Return precision and recall."""
    precision = float((KDTree(edges).query(points[mask])[0] <= within).mean()) if mask.any() else 0.0
    recall = float((KDTree(points[mask]).query(edges)[0] <= within).mean()) if mask.any() else 0.0
    return precision, recall


@pytest.mark.parametrize(("thickness", "noise"), [(3.0, 0.3), (6.0, 0.5), (7.0, 0.6)])
def test_both_edges_of_a_plate_are_found_under_noise(thickness, noise):
    points, edges = box((50.0, 40.0, thickness), noise)
    precision, recall = scores(points, s2n.detect_edges(points).mask, edges, 2.0)
    assert precision > 0.85
    assert recall > 0.85


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_marks_are_thin_and_without_gaps(noise):
    points, edges = box((50.0, 40.0, 30.0), noise)
    mask = s2n.detect_edges(points).mask
    precision, recall = scores(points, mask, edges, 1.0)
    assert precision > 0.97
    assert recall > 0.97
    assert np.count_nonzero(mask) < 1.6 * len(edges) / 4  # a point and a half for each spacing of an edge


@pytest.mark.parametrize("k", [16, 40, 100])
@pytest.mark.parametrize("noise", [0.3, 0.6, 0.85])
def test_few_neighbours_tell_the_noise_of_a_plane(k, noise, monkeypatch):
    rng = np.random.default_rng(1)
    points = np.c_[plane(rng, 100, 100), np.zeros(10_000)] + noise * rng.normal(size=(10_000, 3))
    monkeypatch.setattr(scale, "NEIGHBOURHOODS", ((k, np.inf),))
    assert scale.measure_scale(points).noise == pytest.approx(noise, rel=0.07)


def test_a_tube_of_a_few_spacings_has_no_edges():
    rng = np.random.default_rng(2)
    v = rng.uniform(0, 2 * np.pi, 12_000)
    u = rng.uniform(0, 2 * np.pi, 12_000)
    kept = rng.uniform(0, 1, 12_000) < (1 + np.cos(v) / 6) / (1 + 1 / 6)
    r = 30.0 + 5.0 * np.cos(v[kept])
    torus = np.c_[r * np.cos(u[kept]), r * np.sin(u[kept]), 5.0 * np.sin(v[kept])] / 0.78
    assert s2n.detect_edges(torus).mask.mean() < 0.002


def carved(noise: float, n: int = 20_000, seed: int = 7) -> np.ndarray:
    """Points of a ball with folds all over, of some two to four spacings and 30 to 50 degrees."""
    rng = np.random.default_rng(seed)
    ball = rng.normal(size=(n, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    depth = 1.0 + 0.05 * np.sin(14 * ball[:, 0] + 3 * np.sin(3 * ball[:, 1])) * np.sin(13 * ball[:, 2])
    points = ball * depth[:, None] * np.sqrt(n / (4.0 * np.pi))
    return points + noise * rng.normal(size=points.shape)


@pytest.mark.parametrize(("noise", "most"), [(0.0, 0.001), (0.25, 0.002), (0.5, 0.025)])
def test_folds_of_a_carved_surface_are_no_edges(noise, most):
    assert s2n.detect_edges(carved(noise)).mask.mean() < most


def thinned(points: np.ndarray, middle: np.ndarray, kept: float, seed: int = 5) -> np.ndarray:
    """Keep all points beyond x of the middle, and only part of the others."""
    rng = np.random.default_rng(seed)
    return points[(points[:, 0] > middle[0]) | (rng.random(len(points)) < kept)]


def test_edges_are_found_where_points_are_sparse():
    points, edges = box((90.0, 50.0, 40.0), 0.0)
    points = thinned(points, np.array([45.0]), 1 / 5)
    points += 0.3 * np.random.default_rng(1).normal(size=points.shape)
    sparse = edges[edges[:, 0] < 40]
    mask = s2n.detect_edges(points).mask
    spacing = np.sqrt(5.0)
    marked = points[mask & (points[:, 0] < 40)]
    assert (KDTree(marked).query(sparse)[0] <= 2 * spacing).mean() > 0.9
    assert (KDTree(edges).query(marked)[0] <= 2 * spacing).mean() > 0.95


def test_an_even_cloud_has_one_spacing_and_an_uneven_one_several():
    points, _ = box((90.0, 50.0, 40.0), 0.3)
    even = scale.measure_scale(points)
    assert [s.h for s in spacings_of(even.cells, even.h)] == [even.h]
    uneven = scale.measure_scale(thinned(points, np.array([45.0]), 1 / 6))
    assert len(spacings_of(uneven.cells, uneven.h)) >= 2


@pytest.mark.parametrize("radius", [8.0, 14.0])
def test_holes_in_the_scan_of_a_closed_part_are_no_edges(radius):
    points, edges = box((160.0, 90.0, 60.0), 0.2)
    middle = np.array([80.0, 45.0, 60.0])
    points = points[np.linalg.norm(points - middle, axis=1) > radius]
    found = s2n.detect_edges(points)
    beside = np.linalg.norm(points - middle, axis=1) < radius + 5
    assert not found.mask[beside].any()
    assert (found.kind[beside] == 3).sum() > radius
    assert (KDTree(points[found.mask]).query(edges)[0] <= 2).mean() > 0.97


def test_a_hole_in_a_sheet_is_an_edge():
    rng = np.random.default_rng(3)
    sheet = np.c_[plane(rng, 160, 120), np.zeros(160 * 120)]
    sheet = sheet[np.linalg.norm(sheet[:, :2] - (80, 60), axis=1) > 14] + 0.2 * rng.normal(size=3)
    mask = s2n.detect_edges(sheet).mask
    beside = np.abs(np.linalg.norm(sheet[:, :2] - (80, 60), axis=1) - 14) < 2.0
    assert mask[beside].sum() > 60


@pytest.mark.parametrize(("bar", "bore"), [(12.0, 8.0), (20.0, 14.0)])
def test_curved_creases_of_curved_faces_are_sharp_without_noise(bar, bore):
    """A round bar that is bored across: a crease whose path was found roughly only would look rounded."""
    rng = np.random.default_rng(1)
    around = plane(rng, 80, round(2 * np.pi * bar))
    angle = 2 * np.pi * around[:, 1] / round(2 * np.pi * bar)
    outer = np.c_[around[:, 0] - 40, bar * np.cos(angle), bar * np.sin(angle)]
    wall = plane(rng, round(2 * np.pi * bore), 2 * bar)
    angle = 2 * np.pi * wall[:, 0] / round(2 * np.pi * bore)
    inner = np.c_[bore * np.cos(angle), bore * np.sin(angle), wall[:, 1] - bar]
    points = np.concatenate((outer[np.hypot(*outer[:, :2].T) > bore], inner[np.hypot(*inner[:, 1:].T) < bar]))
    angle = np.linspace(0, 2 * np.pi, 300)
    rim = np.c_[bore * np.cos(angle), bore * np.sin(angle), np.sqrt(bar**2 - (bore * np.sin(angle)) ** 2)]
    mask = s2n.detect_edges(points).mask
    assert (KDTree(points[mask]).query(rim)[0] <= 1).mean() > 0.97


def test_noise_of_a_thin_plate_is_not_the_distance_of_its_sides():
    points, _ = box((50.0, 40.0, 3.0), 0.8)
    assert scale.measure_scale(points).noise < 1.2
