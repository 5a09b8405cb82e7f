"""Look for narrow fillets between two faces: strips too narrow to have normals, or a surface, of their own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import MODEL_COST, Sheet, grouped
from scan2nurbs.faces.model_shapes import field
from scan2nurbs.faces.rolling import FEWER, Corner, corner_of
from scan2nurbs.faces.unite import contacts
from scan2nurbs.kernels.gauss_newton import refine
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, SIZE, TORUS

RINGS = 5
LEAST_POINTS = 12
NORMAL_REACH = 1.5
NARROW = 5
"""Strips have at most so many points for each that lies beside either of the two faces: they are about twice as many h wide."""


@dataclass(frozen=True)
class _Place:
    """Where a fillet may be.

    Attributes
    ----------
    points : (N,) int64
    corner : Corner
        Of these points.
    now : (N,) float64
        Distances from the surface that each point has without a fillet.
    n_strip : int
        How many of them, the last ones, are a strip between the two faces.
    """

    points: NDArray[np.int64]
    corner: Corner
    now: NDArray[np.float64]
    n_strip: int


def find_fillets(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]
) -> tuple[Sheet, NDArray[np.int32], NDArray[np.float64]]:
    """Add a cylinder or torus wherever a ball rolled along the border of two faces explains the points better than a sharp edge.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
    models : (M, SIZE) float64

    Returns
    -------
    sheet, label, models : as given
        With the strips labelled, their models appended, and without normals where one-sided ones cannot see the strips.

    Notes
    -----
    The radius of the least robust sum of squares is taken, see `Corner`.
    """
    normals, found, n = sheet.normals.copy(), [models], len(models)
    given, label = label, label.copy()
    for place in _places(sheet, given, models):
        corner = place.corner
        radius = _radius(place, sheet.sigma)
        if radius is None:
            continue
        zone = corner.zone(radius) & (np.abs(corner.off(radius)) < 3.0 * sheet.sigma)
        model = _rolled(sheet, place, radius, zone) if zone.sum() >= LEAST_POINTS else None
        if model is None:
            continue
        label[place.points[corner.zone(radius) & (corner.u > -3.0 * sheet.sigma) & (corner.v > -3.0 * sheet.sigma)]] = n
        if not place.n_strip:  # a strip that grew by its normals keeps them
            normals[place.points[corner.zone(radius, NORMAL_REACH)]] = np.nan
        found.append(model[None])
        n += 1
    return replace(sheet, normals=normals), label, np.concatenate(found)


def _places(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]) -> Iterator[_Place]:
    """Yield where fillets may be: along borders of two faces, and in narrow strips between two faces."""
    pairs, count, _ = contacts(label, sheet.neighbours)
    regions = grouped(label, len(models))
    order, starts = regions
    for (i, j), links in zip(pairs.tolist(), count.tolist(), strict=True):
        if links >= LEAST_POINTS and PATCH not in (int(models[i, 0]), int(models[j, 0])):
            place = _place(sheet, label, models, (i, j), regions)
            if place is not None:
                yield place
    for strip in range(len(models)):
        mine = order[starts[strip] : starts[strip + 1]]
        around = pairs[(pairs == strip).any(axis=1)].sum(axis=1) - strip
        beside = sorted((-int((label[sheet.neighbours[mine]] == face).any(axis=1).sum()), face) for face in around.tolist())[:2]
        if len(mine) < LEAST_POINTS or len(beside) < 2 or len(mine) > -NARROW * beside[1][0]:
            continue
        i, j = sorted(face for _, face in beside)
        if PATCH not in (int(models[i, 0]), int(models[j, 0])):
            place = _place(sheet, label, models, (i, j), regions, strip)
            if place is not None:
                yield place


def _place(
    sheet: Sheet,
    label: NDArray[np.int32],
    models: NDArray[np.float64],
    pair: tuple[int, int],
    regions: tuple[NDArray[np.int32], NDArray[np.int64]],
    strip: int | None = None,
) -> _Place | None:
    """Return the place between two faces that touch, or that a strip lies between; None where they hardly turn, or one is too small."""
    order, starts = regions
    bands = []
    for own, other in (pair, pair[::-1]):
        mine = order[starts[own] : starts[own + 1]]
        band = mine[(label[sheet.neighbours[mine]] == (other if strip is None else strip)).any(axis=1)]
        for _ in range(RINGS):
            wider = np.unique(sheet.neighbours[band])
            band = wider[(wider >= 0) & (label[wider] == own)]
        if len(band) < LEAST_POINTS:
            return None
        bands.append(band)
    if strip is not None:
        bands.append(order[starts[strip] : starts[strip + 1]])
    points = np.concatenate(bands).astype(np.int64)
    side = np.repeat(np.arange(len(bands)), [len(band) for band in bands])
    first, second = (field(models[k], sheet.points[points]) for k in pair)
    corner = corner_of(first, second, side)
    if corner is None:
        return None
    now = corner.sharp
    if strip is not None:
        now[side == 2] = np.abs(field(models[strip], sheet.points[points[side == 2]])[:, 0])
    return _Place(points, corner, now, int((side == 2).sum()))


def _radius(place: _Place, sigma: float) -> float | None:
    """Return the radius of the fillet at a place; None where there is none, or it does not pay."""
    radius, gain = place.corner.best_radius(place.now, sigma)
    if place.n_strip:
        return radius if gain >= -FEWER * np.log(place.n_strip) else None
    n = int((place.corner.zone(radius) & (np.abs(place.corner.off(radius)) < 3.0 * sigma)).sum())
    return radius if n and gain >= MODEL_COST + 2.5 * np.log(n) else None


def _rolled(sheet: Sheet, place: _Place, radius: float, zone: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Return the cylinder or torus whose spine is the curve of the ball's centres."""
    corner = place.corner
    p, c = sheet.points[place.points[zone]], corner.cosine[zone]
    a, b, (m1, m2) = radius - corner.u[zone], radius - corner.v[zone], corner.directions
    along = ((a - c * b) / (1.0 - c * c))[:, None] * m1[zone] + ((b - c * a) / (1.0 - c * c))[:, None] * m2[zone]
    centre = p + along
    middle = centre.mean(axis=0)
    _, width, axes = np.linalg.svd(centre - middle, full_matrices=False)
    width = width / np.sqrt(len(p))
    model = np.zeros(SIZE)
    model[1:4], model[7] = middle, radius
    if width[1] < 0.3 + sheet.sigma:
        model[0], model[4:7] = CYLINDER, axes[0]
    else:
        x, y = (centre - middle) @ axes[0], (centre - middle) @ axes[1]
        (x0, y0, k), *_ = np.linalg.lstsq(np.stack([2.0 * x, 2.0 * y, np.ones(len(x))], axis=1), x * x + y * y, rcond=None)
        major = float(np.sqrt(max(k + x0 * x0 + y0 * y0, 0.0)))
        if np.median(np.abs(np.hypot(x - x0, y - y0) - major)) > 0.5 + sheet.sigma or major < 0.3 * radius:
            return None
        model[0], model[1:4], model[4:7] = TORUS, middle + x0 * axes[0] + y0 * axes[1], axes[2]
        model[7], model[8] = major, radius
    index = place.points[zone].astype(np.int32)
    trial = model.copy()
    refine(trial, sheet.points, index, len(index), sheet.sigma, 4)
    radius_after = trial[7] if int(model[0]) == CYLINDER else trial[8]
    return trial if 0.5 * radius < radius_after < 2.0 * radius else model
