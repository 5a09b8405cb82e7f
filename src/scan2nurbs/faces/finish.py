"""From labels and models to faces: ranks, fits, smooth neighbours, and the points that were left out to save time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.faces.compete import Sheet
from scan2nurbs.faces.model_shapes import shape_of
from scan2nurbs.kernels.labelling import candidate_costs
from scan2nurbs.kernels.nearest import nearest_neighbours, nearest_to
from scan2nurbs.kernels.primitives import PATCH
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.shape import Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit, choose_shape, fit_shape

SMOOTH = 15.0
"""Degrees: faces that turn by less meet smoothly."""
NEARBY = 4
FREE_KINDS: tuple[Kind, ...] = ("bspline",)


def rank_faces(
    label: NDArray[np.int32], group: NDArray[np.int32], most: int | None
) -> tuple[NDArray[np.int32], list[NDArray[np.int64]]]:
    """Sort faces by falling size, number them without gaps, and list each one's models; faces beyond the `most` largest are dissolved."""
    kept, compact, size = np.unique(label[label >= 0], return_inverse=True, return_counts=True)
    order = np.argsort(-size, kind="stable")
    rank = np.empty(len(kept), np.int32)
    rank[order] = np.arange(len(kept))
    out = np.full(len(label), -1, np.int32)
    out[label >= 0] = rank[compact]
    order = order[:most]
    out[out >= len(order)] = -1
    return out, [np.flatnonzero(group == kept[k]) for k in order]


def spread_labels(
    points: NDArray[np.float64], part_label: NDArray[np.int32], part_scale: Scale, models: NDArray[np.float64], sheet: Sheet
) -> NDArray[np.int32]:
    """Give every point of a large cloud the nearest surface among the labels of the nearest points that were segmented."""
    index, _ = nearest_to(part_scale.cells, points, NEARBY)
    candidates = part_label[part_scale.cells.order[index]].astype(np.int32)
    unknown = np.full(points.shape, np.nan)
    costs = candidate_costs(points / part_scale.h, unknown, models, candidates, sheet.sigma, sheet.tilt)
    best = np.argmin(costs, axis=1)
    return np.where(candidates[:, 0] >= 0, candidates[np.arange(len(points)), best], -1).astype(np.int32)


def face_fits(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    label: NDArray[np.int32],
    models: list[NDArray[np.float64]],
    noise: float,
    h: float,
) -> tuple[ShapeFit, ...]:
    """Fit the surface of every face to its points: of the kind of its model, or freely where it has several."""
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(len(models) + 1))
    fits = []
    for face, pieces in enumerate(models):
        mine = order[starts[face] : starts[face + 1]]
        if len(pieces) > 1 or int(pieces[0, 0]) == PATCH:
            fits.append(_fit_free(points[mine], normals[mine], pieces, noise, h))
        else:
            fits.append(_fit(points[mine], normals[mine], pieces[0], noise, h))
    return tuple(fits)


def _fit(points: NDArray[np.float64], normals: NDArray[np.float64], model: NDArray[np.float64], noise: float, h: float) -> ShapeFit:
    start = shape_of(model, h)
    try:
        return fit_shape(start.kind, points, noise=noise, normals=normals, start=start)
    except NoResultError as reason:
        d = start.distance(points)
        rms = float(np.sqrt((d**2).mean()))
        return ShapeFit(shape=start, n_points=len(points), rms=rms, covariance=None, criterion=float("inf"), notes=(str(reason),))


def _fit_free(points: NDArray[np.float64], normals: NDArray[np.float64], pieces: NDArray[np.float64], noise: float, h: float) -> ShapeFit:
    for kind in FREE_KINDS:
        try:
            return fit_shape(kind, points, noise=noise, normals=normals)
        except (NoResultError, InputError):
            continue
    nearest = [piece for piece in pieces if int(piece[0]) != PATCH]
    if nearest:
        return _fit(points, normals, nearest[0], noise, h)
    return choose_shape(points, noise=noise, normals=normals)


def smooth_pairs(
    points: NDArray[np.float64], label: NDArray[np.int32], fits: tuple[ShapeFit, ...], scale: Scale
) -> frozenset[tuple[int, int]]:
    """Find the pairs of faces whose surfaces turn by less than `SMOOTH` along half of their common border."""
    order = scale.cells.order
    neighbours, _ = nearest_neighbours(scale.cells, 6, reach=1.5 * scale.h)
    sorted_label = label[order]
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
