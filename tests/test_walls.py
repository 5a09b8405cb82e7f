"""Narrow strips that are flat walls, or sharp edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from scan2nurbs.faces.compete import LINK_COST, Sheet
from scan2nurbs.faces.walls import straighten
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, PLANE, SIZE

SIGMA, LONG = 0.25, 40.0
KINDS = np.arange(PATCH + 1) != PATCH


def _model(kind: int, point: tuple[float, ...], axis: tuple[float, ...], radius: float = 0.0) -> np.ndarray:
    out = np.zeros(SIZE)
    out[0], out[1:4], out[4:7], out[7] = kind, point, np.array(axis) / np.linalg.norm(axis), radius
    return out


def _swept(*profiles: np.ndarray, seed: int = 0) -> tuple[Sheet, np.ndarray]:
    """Sweep polylines (K, 2) in x, z along y, a point on each unit of area; return the noisy cloud and the profile of every point."""
    rng = np.random.default_rng(seed)
    points, source = [], []
    for k, line in enumerate(profiles):
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        n = round(length[-1] * LONG)
        at = rng.uniform(0.0, length[-1], n)
        points.append(np.column_stack([np.interp(at, length, line[:, 0]), rng.uniform(0.0, LONG, n), np.interp(at, length, line[:, 1])]))
        source.append(np.full(n, k, np.int32))
    clean = np.concatenate(points)
    cloud = clean + rng.normal(0.0, SIGMA, clean.shape)
    near = np.asarray(KDTree(cloud).query(cloud, k=13)[1], np.int32)[:, 1:]
    weights = np.full(near.shape, LINK_COST, np.float32)
    return Sheet(cloud, np.full(cloud.shape, np.nan), near, weights, SIGMA, 0.12), np.concatenate(source)


def _tubed(sheet: Sheet, label: np.ndarray, tube: np.ndarray, strip: int, width: float) -> np.ndarray:
    """Let a tube take the points near it."""
    away = np.abs(np.hypot(sheet.points[:, 0] - tube[1], sheet.points[:, 2] - tube[3]) - tube[7])
    beside = np.hypot(sheet.points[:, 0] - tube[1], sheet.points[:, 2] - tube[3]) < width
    return np.where((label == strip) | (beside & (away < 2.0 * SIGMA)), strip, label).astype(np.int32)


FLOOR = np.array([[0.0, 0.0], [20.0, 0.0]])
TOP = np.array([[-20.0, 4.0], [0.0, 4.0]])
WALL = np.array([[0.0, 0.0], [0.0, 4.0]])


@pytest.mark.parametrize("seed", range(5))
def test_the_wall_of_a_shallow_step_is_flat(seed: int) -> None:
    sheet, true = _swept(FLOOR, TOP, WALL, seed=seed)
    tube = _model(CYLINDER, (2.2, 0.0, 2.0), (0.0, 1.0, 0.0), 2.3)
    models = np.stack([_model(PLANE, (0, 0, 0), (0, 0, 1)), _model(PLANE, (0, 0, 4), (0, 0, 1)), tube])
    label, found = straighten(sheet, _tubed(sheet, true, tube, 2, 4.0), models, KINDS)
    assert int(found[2, 0]) == PLANE
    assert abs(found[2, 4]) > np.cos(np.radians(3.0))
    assert (label == true).mean() > 0.97


def test_a_bevel_along_a_sharp_edge_is_no_face() -> None:
    """Noise rounds an edge, too: of ten, two may stay."""
    kept = 0
    for seed in range(10):
        sheet, true = _swept(FLOOR, np.array([[0.0, 0.0], [0.0, 20.0]]), seed=seed)
        bevel = _model(PLANE, (0.7, 0.0, 0.7), (1.0, 0.0, 1.0))
        models = np.stack([_model(PLANE, (0, 0, 0), (0, 0, 1)), _model(PLANE, (0, 0, 0), (1, 0, 0)), bevel])
        given = np.where((sheet.points[:, [0, 2]] < 1.5).all(axis=1), 2, true).astype(np.int32)
        label, _ = straighten(sheet, given, models, KINDS)
        kept += bool((label == 2).any())
        assert (label == true).mean() > 0.97 or (label == 2).any()
    assert kept <= 2


@pytest.mark.parametrize("seed", range(5))
def test_a_wall_that_goes_on_as_a_plane_nearby_is_its_part(seed: int) -> None:
    """A wall of four spacings beside a step is the low end of a high side."""
    sheet, true = _swept(FLOOR, TOP, WALL, seed=seed)
    true = np.where((true == 2) & (sheet.points[:, 1] < 8.0), 3, true)
    plane, tube = _model(PLANE, (0, 0, 0), (1, 0, 0)), _model(CYLINDER, (2.2, 0.0, 2.0), (0.0, 1.0, 0.0), 2.3)
    models = np.stack([_model(PLANE, (0, 0, 0), (0, 0, 1)), _model(PLANE, (0, 0, 4), (0, 0, 1)), tube, plane])
    given = _tubed(sheet, true, tube, 2, 4.0)
    given[sheet.points[:, 1] < 8.0] = true[sheet.points[:, 1] < 8.0]
    label, _ = straighten(sheet, given, models, KINDS)
    assert not (label == 2).any()
    assert (label[true == 2] == 3).mean() > 0.85


@pytest.mark.parametrize("radius", [2.0, 4.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_fillet_stays(radius: float, seed: int) -> None:
    angle = np.linspace(np.pi, 1.5 * np.pi, 30)
    arc = radius * np.column_stack([1.0 + np.cos(angle), 1.0 + np.sin(angle)])
    sheet, true = _swept(np.array([[radius, 0.0], [20.0, 0.0]]), np.array([[0.0, radius], [0.0, 20.0]]), arc, seed=seed)
    ball = _model(CYLINDER, (radius, 0.0, radius), (0.0, 1.0, 0.0), radius)
    models = np.stack([_model(PLANE, (0, 0, 0), (0, 0, 1)), _model(PLANE, (0, 0, 0), (1, 0, 0)), ball])
    label, found = straighten(sheet, true, models, KINDS)
    np.testing.assert_array_equal(label, true)
    np.testing.assert_array_equal(found, models)


def test_planes_that_nobody_allowed_are_not_chosen() -> None:
    sheet, true = _swept(FLOOR, TOP, WALL)
    tube = _model(CYLINDER, (2.2, 0.0, 2.0), (0.0, 1.0, 0.0), 2.3)
    models = np.stack([_model(PLANE, (0, 0, 0), (0, 0, 1)), _model(PLANE, (0, 0, 4), (0, 0, 1)), tube])
    kinds = KINDS.copy()
    kinds[PLANE] = False
    _, found = straighten(sheet, _tubed(sheet, true, tube, 2, 4.0), models, kinds)
    assert int(found[2, 0]) == CYLINDER


def test_a_strip_that_goes_on_as_a_curved_face_is_its_piece() -> None:
    """A narrow flat strip between a cylinder that it is tangent to and a wall: freeform faces come in such pieces, and are joined later."""
    angle = np.linspace(0.0, 0.9, 40)
    arc = np.column_stack([-20.0 * np.sin(angle), 20.0 - 20.0 * np.cos(angle)])
    sheet, true = _swept(arc, np.array([[3.0, 0.0], [3.0, 20.0]]), np.array([[0.0, 0.0], [3.0, 0.0]]))
    models = np.stack(
        [_model(CYLINDER, (0, 0, 20), (0, 1, 0), 20.0), _model(PLANE, (3, 0, 0), (1, 0, 0)), _model(PLANE, (0, 0, 0), (0, 0, 1))]
    )
    label, _ = straighten(sheet, true, models, KINDS)
    np.testing.assert_array_equal(label, true)
