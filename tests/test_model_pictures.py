"""Pictures of models: every pixel of a face is drawn, what lies behind is not, and colours are those of the nearest points."""

from __future__ import annotations

import io

import matplotlib.image
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from scan2nurbs.report.part_pictures import model_deviation_picture, model_picture
from scan2nurbs.report.triangles import rasterise_triangles
from scan2nurbs.report.view import View, choose_view, places

SIZE = {"width": 300, "height": 240}


def body(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The hull of points on a ball, its triangles turned outwards, each a face; one of them far from zero."""
    points = np.random.default_rng(seed).normal(size=(n, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    inwards = np.einsum("ti,ti->t", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), hull.equations[:, :3]) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    return corners + 100.0 * seed, np.arange(len(corners), dtype=np.int32)


def cylinder(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The side of a cylinder about z, one face of strips as long as it is."""
    angle = np.linspace(0.0, 2 * np.pi, n + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    low, high = (np.column_stack([ring, np.full(n + 1, z)]) for z in (-2.0, 2.0))
    corners = np.concatenate([np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)])
    return corners, np.zeros(2 * n, np.int32)


def pixels(view: View, width: int, height: int) -> np.ndarray:
    """Centres of all pixels along right and up, row by row."""
    across = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2) + 0.5
    return view.low + across * (view.high - view.low) / (width, height)


def view_of(corners: np.ndarray) -> View:
    return choose_view(corners.reshape(-1, 3))


@pytest.mark.parametrize(("n", "seed"), [(8, 0), (60, 1), (3000, 2)])
def test_no_pixel_inside_a_convex_body_lacks_a_face_that_looks_at_the_eye(n, seed):
    corners, face = body(n, seed)
    view = view_of(corners)
    raster = rasterise_triangles(corners, face, view, **SIZE)
    outline = ConvexHull(view.project(corners.reshape(-1, 3))[:, :2])
    outside = (pixels(view, **SIZE) @ outline.equations[:, :2].T + outline.equations[:, 2]).max(axis=1)
    pixel = float(view.high[0] - view.low[0]) / SIZE["width"]
    index = raster.index.ravel()
    assert (index[outside < 0.0] >= 0).all()
    assert (index[outside > 0.1 * pixel] == -1).all()
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ view.axes.T
    seen = index[outside < -2 * pixel]
    assert (normal[seen, 2] > 0.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_triangle_is_seen(seed):
    corners = np.random.default_rng(seed).uniform(-1, 1, (25, 3, 3))
    view = View(np.eye(3), np.full(2, -1.0), np.full(2, 1.0))
    raster = rasterise_triangles(corners, np.arange(25, dtype=np.int32), view, width=60, height=60)
    depth = np.full((25, 3600), -np.inf)
    for row, (a, b, c) in zip(depth, corners, strict=True):
        weight = np.linalg.solve(np.column_stack([b - a, c - a])[:2], (pixels(view, 60, 60) - a[:2]).T)
        inside = (weight.min(axis=0) >= 0) & (weight.sum(axis=0) <= 1)
        row[inside] = a[2] + (np.array([b - a, c - a])[:, 2] @ weight)[inside]
    known = np.isfinite(depth.max(axis=0))
    nearness, index = raster.nearness.ravel(), raster.index.ravel()
    # Pixels at the very border of a triangle may be drawn though their centre lies outside.
    same = np.isclose(nearness, depth.max(axis=0), rtol=0, atol=1e-9) & (index == depth.argmax(axis=0))
    assert same[known].mean() > 0.97
    assert (nearness[known] >= depth.max(axis=0)[known] - 1e-9).all()
    assert (index[~known] == -1).mean() > 0.97


def test_places_lie_on_their_triangles():
    corners, face = body(100, 3)
    view = view_of(corners)
    raster = rasterise_triangles(corners, face, view, **SIZE)
    index = raster.index[raster.index >= 0]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[index]
    off = np.einsum("ni,ni->n", places(raster, view) - corners[index, 0], normal / np.linalg.norm(normal, axis=1, keepdims=True))
    assert np.quantile(np.abs(off), 0.98) < 1e-9  # at borders a pixel's centre may lie outside


def test_within_a_face_the_shading_is_smooth_and_between_faces_it_is_not():
    corners, face = cylinder(24)
    upright = View(np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]), np.array([-1.2, -2.4]), np.array([1.2, 2.4]))
    steps = [
        np.abs(np.diff(rasterise_triangles(corners, faces, upright, width=240, height=480).shade[240, 30:-30])).max()
        for faces in (face, np.arange(len(face), dtype=np.int32))
    ]
    assert steps[0] < 0.03
    assert steps[1] > 0.06


def test_triangles_without_area_and_no_triangles_at_all():
    view = View(np.eye(3), np.full(2, -1.0), np.full(2, 1.0))
    none = rasterise_triangles(np.empty((0, 3, 3)), np.empty(0, np.int32), view, width=8, height=6)
    assert none.index.shape == (6, 8)
    edge_on = np.array([[[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0.5]], [[0, 0, 0], [0, 0, 0], [0, 0, 0]], [[-3, -3, 0], [3, -3, 0], [0, 3, 0.0]]])
    seen = rasterise_triangles(edge_on, np.zeros(3, np.int32), view, width=8, height=6)
    assert set(np.unique(seen.index)) <= {-1, 2}
    assert np.isfinite(seen.shade).all()


def test_many_layers_are_drawn_in_pieces_with_the_same_result(monkeypatch):
    corners, face = body(500, 4)
    view = view_of(corners)
    whole = rasterise_triangles(corners, face, view, **SIZE)
    monkeypatch.setattr("scan2nurbs.report.triangles._AT_ONCE", 500)
    pieces = rasterise_triangles(corners, face, view, **SIZE)
    assert np.array_equal(whole.index, pieces.index)
    assert np.array_equal(whole.shade, pieces.shade)


def image(picture) -> np.ndarray:
    return matplotlib.image.imread(io.BytesIO(picture.png))[..., :3]


@pytest.mark.parametrize("n", [30, 3000])
def test_the_picture_of_a_body_has_no_specks(n):
    corners, face = body(n)
    ring = 1.2 * np.column_stack([np.cos(t := np.linspace(0, 2 * np.pi, 90)), np.sin(t), 0 * t])
    one, other = (image(model_picture(corners, np.zeros_like(face), unit="mm", edges=[ring * 0.5])) for _ in range(2))
    assert np.array_equal(one, other)
    white = (one > 0.97).all(axis=2)
    height, width = white.shape
    middle = white[int(0.35 * height) : int(0.65 * height), int(0.4 * width) : int(0.6 * width)]
    assert not middle.any()


def test_the_deviations_of_the_nearest_points_are_shown_and_bare_places_are_dark():
    plate = np.array([[[-3, -1, 0], [3, -1, 0], [3, 1, 0]], [[-3, -1, 0], [3, 1, 0], [-3, 1, 0.0]]])
    points = np.column_stack([np.random.default_rng(0).uniform(-1, 1, (6000, 2)) * [3, 1], np.zeros(6000)])
    points = points[np.abs(points[:, 0]) > 0.8]
    deviation = np.where(points[:, 0] > 0, 0.5, -0.5)
    deviation[:40] = np.nan
    shown = image(model_deviation_picture(plate, np.zeros(2, np.int32), points, deviation, unit="mm", spacing=0.05))
    flat = shown.reshape(-1, 3)
    red, blue = flat[:, 0] > flat[:, 2] + 0.3, flat[:, 2] > flat[:, 0] + 0.3
    dark = (flat.max(axis=1) < 0.5) & (np.ptp(flat, axis=1) < 0.12) & (flat.min(axis=1) > 0.2)
    assert red.mean() > 0.1
    assert blue.mean() > 0.1
    assert dark.mean() > 0.05
    nothing = model_deviation_picture(plate, np.zeros(2, np.int32), points, np.full(len(points), np.nan), unit="mm", spacing=0.05)
    assert nothing.png.startswith(b"\x89PNG")
