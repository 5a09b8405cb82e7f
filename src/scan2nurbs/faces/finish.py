"""From labels and models to faces: ranks, fits, and the points that were left out to save time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.faces.compete import Sheet
from scan2nurbs.faces.model_shapes import shape_of
from scan2nurbs.kernels.labelling import candidate_costs
from scan2nurbs.kernels.nearest import nearest_to
from scan2nurbs.kernels.primitives import PATCH
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.shape import Kind
from scan2nurbs.surfaces.shape_fit import PRIMITIVES, ShapeFit, choose_shape, fit_shape

NEARBY = 4
ENOUGH = 3000
"""So many points of a face tell its kind."""
ABOUT_AS_NEAR = 1.25
"""A plainer surface may lie farther from the points by this factor than one that they do not determine."""


def rank_faces(label: NDArray[np.int32], most: int | None) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Give faces numbers without gaps, by falling size; those beyond the `most` largest are dissolved.

    Parameters
    ----------
    label : (N,) int32
    most : int, or None for all of them

    Returns
    -------
    label : (N,) int32
    kept : (F,) int64
        What each face was called before.
    """
    kept, compact, size = np.unique(label[label >= 0], return_inverse=True, return_counts=True)
    order = np.argsort(-size, kind="stable")
    rank = np.empty(len(kept), np.int32)
    rank[order] = np.arange(len(kept))
    out = np.full(len(label), -1, np.int32)
    out[label >= 0] = rank[compact]
    order = order[:most]
    out[out >= len(order)] = -1
    return out, kept[order].astype(np.int64)


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
    models: NDArray[np.float64],
    noise: float,
    h: float,
    kinds: Sequence[Kind],
) -> tuple[ShapeFit, ...]:
    """Fit the surface of every face to its points: of the kind of its model, or of a plainer one among `kinds` that does as well."""
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(len(models) + 1))
    fits = []
    for face, model in enumerate(models):
        mine = order[starts[face] : starts[face + 1]]
        p, n = points[mine], normals[mine]
        fits.append(_fit_free(p, n, noise) if int(model[0]) == PATCH else _plainest(_fit(p, n, model, noise, h), p, noise, kinds))
    return tuple(fits)


def _fit(points: NDArray[np.float64], normals: NDArray[np.float64], model: NDArray[np.float64], noise: float, h: float) -> ShapeFit:
    start = shape_of(model, h)
    try:
        return fit_shape(start.kind, points, noise=noise, normals=normals, start=start)
    except NoResultError as reason:
        d = start.distance(points)
        rms = float(np.sqrt((d**2).mean()))
        return ShapeFit(shape=start, n_points=len(points), rms=rms, covariance=None, criterion=float("inf"), notes=(str(reason),))


def _plainest(fit: ShapeFit, points: NDArray[np.float64], noise: float, kinds: Sequence[Kind]) -> ShapeFit:
    """Return a fit of a plainer kind, where the points amid the face do not ask for the kind that it has.

    Labels err along borders: the ring of a plane with some of its fillet passes for the zone of a sphere. And a model may have a radius
    that is lost in the noise.
    """
    own = PRIMITIVES.index(fit.shape.kind)
    if fit.covariance is None:
        return _determined(fit, points, noise, [kind for kind in PRIMITIVES[:own] if kind in kinds])
    plainer: list[Kind] = [kind for kind in PRIMITIVES[: own + 1] if kind in kinds]
    if len(plainer) < 2:
        return fit
    try:
        found = choose_shape(points[:: max(1, len(points) // ENOUGH)], noise=noise, kinds=plainer).shape.kind
        return fit if found == fit.shape.kind else choose_shape(points, noise=noise, kinds=(found,))
    except NoResultError:  # too few of the points are amid the face
        return fit


def _determined(fit: ShapeFit, points: NDArray[np.float64], noise: float, kinds: Sequence[Kind]) -> ShapeFit:
    """Return a fit of a plainer kind for points that do not determine the kind that they have, if it is about as near to them."""
    if not kinds:
        return fit
    try:
        found = choose_shape(points, noise=noise, kinds=kinds)
    except NoResultError:
        return fit
    return found if found.rms <= ABOUT_AS_NEAR * max(fit.rms, noise) else fit


def refits(points: NDArray[np.float64], label: NDArray[np.int32], fits: Sequence[ShapeFit], noise: float) -> list[ShapeFit]:
    """Return the primitives fitted to the points that the faces have now; other surfaces stay.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
    fits : sequence of ShapeFit
        One a label.
    noise : float
        Standard deviation of the points across the surface, in their unit.
    """
    return [_again(fit, points[label == face], noise) if fit.shape.kind in PRIMITIVES else fit for face, fit in enumerate(fits)]


def _again(fit: ShapeFit, points: NDArray[np.float64], noise: float) -> ShapeFit:
    try:
        return replace(fit_shape(fit.shape.kind, points, noise=noise, start=fit.shape), notes=fit.notes)
    except NoResultError:
        return fit


def swept_fits(
    points: NDArray[np.float64], label: NDArray[np.int32], fits: Sequence[ShapeFit], noise: float, kinds: Sequence[Kind]
) -> tuple[ShapeFit, ...]:
    """Return the fits, with extrusions and revolutions instead of B-spline surfaces wherever they explain a face with fewer parameters.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
    fits : sequence of ShapeFit
        One a label.
    noise : float
        Standard deviation of the points across the surface, in their unit.
    kinds : sequence of str
        Kinds that faces may have.
    """
    return tuple(_swept(fit, points[label == k], noise, kinds) if fit.shape.kind == "bspline" else fit for k, fit in enumerate(fits))


def _swept(fit: ShapeFit, points: NDArray[np.float64], noise: float, kinds: Sequence[Kind]) -> ShapeFit:
    return next((found for found in sweeps(points, noise, kinds) if found.criterion < fit.criterion), fit)


def sweeps(points: NDArray[np.float64], noise: float, kinds: Sequence[Kind]) -> Iterator[ShapeFit]:
    """Yield the extruded and the revolved surface of some points, where these explain them.

    Parameters
    ----------
    points : (N, 3) float64
    noise : float
        Standard deviation of the points across the surface, in their unit.
    kinds : sequence of str
        Kinds that may be tried.
    """
    swept: tuple[Kind, ...] = ("extrusion", "revolution")
    for kind in swept:
        if kind not in kinds:
            continue
        try:
            some = points[:: max(1, len(points) // ENOUGH)]
            trial = fit_shape(kind, some, noise=noise)
            if not study(trial.shape.foot(some), trial.shape.distance(some), noise).explained(noise):
                continue
            found = fit_shape(kind, points, noise=noise)
        except (NoResultError, InputError):
            continue
        if study(found.shape.foot(points), found.shape.distance(points), noise).explained(noise):
            yield found


def _fit_free(points: NDArray[np.float64], normals: NDArray[np.float64], noise: float) -> ShapeFit:
    try:
        return fit_shape("bspline", points, noise=noise, normals=normals)
    except (NoResultError, InputError):
        return choose_shape(points, noise=noise, normals=normals)
