"""From labels and models to faces: ranks, fits, smooth neighbours, and the points that were left out to save time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.compete import Sheet
from scan2nurbs.kernels.labelling import candidate_costs
from scan2nurbs.kernels.nearest import nearest_neighbours, nearest_to
from scan2nurbs.kernels.primitives import CYLINDER, KIND_NAMES, PLANE, SPHERE, TORUS
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape import Shape
from scan2nurbs.surfaces.shape_fit import ShapeFit, fit_shape
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

SMOOTH = 15.0
"""Degrees: faces that turn by less meet smoothly."""
NEARBY = 4


def rank_faces(label: NDArray[np.int32], models: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Number faces by falling size, without gaps."""
    kept, compact, size = np.unique(label[label >= 0], return_inverse=True, return_counts=True)
    order = np.argsort(-size, kind="stable")
    rank = np.empty(len(kept), np.int32)
    rank[order] = np.arange(len(kept))
    out = np.full(len(label), -1, np.int32)
    out[label >= 0] = rank[compact]
    return out, models[kept[order]]


def spread_labels(
    points: NDArray[np.float64],
    scale: Scale,
    part_label: NDArray[np.int32],
    part_scale: Scale,
    models: NDArray[np.float64],
    sheet: Sheet,
) -> NDArray[np.int32]:
    """Give every point of a large cloud the nearest surface among the labels of the nearest points that were segmented."""
    index, _ = nearest_to(part_scale.cells, points, NEARBY)
    candidates = part_label[part_scale.cells.order[index]].astype(np.int32)
    unknown = np.full(points.shape, np.nan)
    local = points / part_scale.h
    costs = candidate_costs(local, unknown, models, candidates, scale.noise * 1.05 / part_scale.h + 1e-9, sheet.tilt)
    best = np.argmin(costs, axis=1)
    return np.where(candidates[:, 0] >= 0, candidates[np.arange(len(points)), best], -1).astype(np.int32)


def shape_of(model: NDArray[np.float64], h: float) -> Shape:
    """Return the shape of a model in the cloud's unit."""
    kind, point, axis = int(model[0]), model[1:4] * h, model[4:7].copy()
    if kind == PLANE:
        return Plane(point=point, direction=axis)
    if kind == SPHERE:
        return Sphere(center=point, radius=float(model[7]) * h)
    if kind == CYLINDER:
        return Cylinder(point=point, axis=axis, radius=float(model[7]) * h)
    if kind == TORUS:
        return Torus(center=point, axis=axis, major=float(model[7]) * h, minor=float(model[8]) * h)
    angle, radius = float(model[8]), float(model[7]) * h
    if radius < 0.0:
        radius, angle = -radius, -angle
    return Cone(point=point, axis=axis if angle >= 0.0 else -axis, radius=radius, half_angle=abs(angle))


def face_fits(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    label: NDArray[np.int32],
    models: NDArray[np.float64],
    noise: float,
    h: float,
    kinds: tuple[str, ...] | None,
) -> tuple[ShapeFit, ...]:
    """Fit the surface of every face to its points, from its model."""
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(len(models) + 1))
    fits = []
    for face, model in enumerate(models):
        mine = order[starts[face] : starts[face + 1]]
        fits.append(_fit(points[mine], normals[mine], model, noise, h))
    return tuple(fits)


def _fit(points: NDArray[np.float64], normals: NDArray[np.float64], model: NDArray[np.float64], noise: float, h: float) -> ShapeFit:
    kind = KIND_NAMES[int(model[0])]
    start = shape_of(model, h)
    try:
        return fit_shape(kind, points, noise=noise, normals=normals, start=start)  # type: ignore[arg-type]
    except NoResultError as reason:
        d = start.distance(points)
        rms = float(np.sqrt((d**2).mean()))
        return ShapeFit(shape=start, n_points=len(points), rms=rms, covariance=None, criterion=float("inf"), notes=(str(reason),))


def smooth_pairs(
    points: NDArray[np.float64], label: NDArray[np.int32], fits: tuple[ShapeFit, ...], scale: Scale
) -> frozenset[tuple[int, int]]:
    """Find the pairs of faces whose surfaces turn by less than `SMOOTH` along half of their common border."""
    order = scale.cells.order
    neighbours, _ = nearest_neighbours(scale.cells, 6, reach=1.5 * scale.h)
    sorted_label = label[order]
    found: dict[tuple[int, int], list[int]] = {}
    i = np.repeat(np.arange(len(label)), neighbours.shape[1])
    j = neighbours.ravel()
    meet = (j >= 0) & (sorted_label[i] >= 0) & (sorted_label[j] > sorted_label[i])
    i, j = i[meet], j[meet]
    code = sorted_label[i].astype(np.int64) * max(len(fits), 1) + sorted_label[j]
    by_code = np.argsort(code, kind="stable")
    borders, first = np.unique(code[by_code], return_index=True)
    smooth = set()
    for border, rows in zip(borders, np.split(i[by_code], first[1:]), strict=True):
        a, b = divmod(int(border), len(fits))
        place = points[order[rows]]
        dot = np.abs(np.einsum("ij,ij->i", fits[a].shape.normal(place), fits[b].shape.normal(place)))
        if len(rows) >= 4 and np.median(dot) > np.cos(np.radians(SMOOTH)):
            smooth.add((a, b))
    return frozenset(smooth)
