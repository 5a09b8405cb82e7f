"""Look for narrow fillets between neighbouring faces: strips too narrow to have normals of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import MODEL_COST, Sheet, grouped
from scan2nurbs.faces.model_shapes import field
from scan2nurbs.faces.unite import contacts
from scan2nurbs.kernels.gauss_newton import refine
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import CYLINDER, PATCH, SIZE, TORUS

RADII = 0.9 * 1.15 ** np.arange(16)
"""Radii to try, in h: smaller fillets are as good as sharp at any noise, larger ones are found like every other face."""
RINGS = 5
LEAST_TURN = 25.0
LEAST_POINTS = 12
NORMAL_REACH = 1.5


@dataclass(frozen=True)
class _Corner:
    """Points about the border of two faces: distances from both, positive on the side where the other face lies."""

    points: NDArray[np.int64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    m1: NDArray[np.float64]
    m2: NDArray[np.float64]

    @property
    def cosine(self) -> NDArray[np.float64]:
        """Cosine of the angle between the two directions (N,)."""
        return np.clip(np.einsum("ij,ij->i", self.m1, self.m2), -0.98, 0.98)


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
    In the plane across the border the ball's centre is as far from both faces as its radius r. A point between the two lines of contact
    is off the fillet by sqrt((a² + b² − 2abc) / (1 − c²)) − r, with a, b its distances from both faces less r and c the cosine between
    their normals. The radius of the least robust sum of squares is taken.
    """
    pairs, count, _ = contacts(label, sheet.neighbours)
    order, starts = grouped(label, len(models))
    label, normals, found = label.copy(), sheet.normals.copy(), [models]
    n = len(models)
    for (i, j), links in zip(pairs, count, strict=True):
        if links < LEAST_POINTS or PATCH in (int(models[i, 0]), int(models[j, 0])):
            continue
        corner = _corner(sheet, label, models, int(i), int(j), order, starts)
        if corner is None:
            continue
        radius, gain = _best_radius(corner, sheet.sigma)
        zone = _zone(corner, radius, 0.0) & (np.abs(_off(corner, radius)) < 3.0 * sheet.sigma)
        if radius <= 0.0 or zone.sum() < LEAST_POINTS or gain < MODEL_COST + 2.5 * np.log(zone.sum()):
            continue
        model = _rolled(sheet, corner, radius, zone)
        if model is None:
            continue
        label[corner.points[_zone(corner, radius, 0.0) & (corner.u > -3.0 * sheet.sigma) & (corner.v > -3.0 * sheet.sigma)]] = n
        normals[corner.points[_zone(corner, radius, NORMAL_REACH)]] = np.nan
        found.append(model[None])
        n += 1
    return replace(sheet, normals=normals), label, np.concatenate(found)


def _corner(
    sheet: Sheet,
    label: NDArray[np.int32],
    models: NDArray[np.float64],
    i: int,
    j: int,
    order: NDArray[np.int32],
    starts: NDArray[np.int64],
) -> _Corner | None:
    sides = []
    for own, other in ((i, j), (j, i)):
        mine = order[starts[own] : starts[own + 1]]
        band = mine[(label[sheet.neighbours[mine]] == other).any(axis=1)]
        for _ in range(RINGS):
            wider = np.unique(sheet.neighbours[band])
            band = wider[label[wider] == own]
        if len(band) < LEAST_POINTS:
            return None
        sides.append(band)
    points = np.concatenate(sides)
    first, second = field(models[i], sheet.points[points]), field(models[j], sheet.points[points])
    on_i = np.arange(len(points)) < len(sides[0])
    s1, s2 = np.sign(np.median(first[~on_i, 0])), np.sign(np.median(second[on_i, 0]))
    corner = _Corner(points.astype(np.int64), s1 * first[:, 0], s2 * second[:, 0], s1 * first[:, 1:], s2 * second[:, 1:])
    if np.median(np.abs(corner.cosine)) > np.cos(np.radians(LEAST_TURN)):
        return None
    return corner


def _off(corner: _Corner, radius: float) -> NDArray[np.float64]:
    a, b, c = corner.u - radius, corner.v - radius, corner.cosine
    return np.sqrt(np.maximum(a * a + b * b - 2.0 * a * b * c, 0.0) / (1.0 - c * c)) - radius


def _zone(corner: _Corner, radius: float, margin: float) -> NDArray[np.bool_]:
    """Tell which points lie between the two lines of contact."""
    reach = radius * (1.0 - corner.cosine) + margin
    return (corner.u < reach) & (corner.v < reach)


def _best_radius(corner: _Corner, sigma: float) -> tuple[float, float]:
    sharp = np.minimum(np.abs(corner.u), np.abs(corner.v))

    def cost(residual: NDArray[np.float64]) -> float:
        return float(np.minimum(0.5 * (residual / sigma) ** 2, DISTANCE_CAP).sum())

    before = cost(sharp)
    costs = [cost(np.where(_zone(corner, r, 0.0), _off(corner, r), sharp)) for r in RADII]
    best = int(np.argmin(costs))
    return float(RADII[best]), before - costs[best]


def _rolled(sheet: Sheet, corner: _Corner, radius: float, zone: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Return the cylinder or torus whose spine is the curve of the ball's centres."""
    p = sheet.points[corner.points[zone]]
    c = corner.cosine[zone]
    a, b = radius - corner.u[zone], radius - corner.v[zone]
    along = ((a - c * b) / (1.0 - c * c))[:, None] * corner.m1[zone] + ((b - c * a) / (1.0 - c * c))[:, None] * corner.m2[zone]
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
    index = corner.points[zone].astype(np.int32)
    trial = model.copy()
    refine(trial, sheet.points, index, len(index), sheet.sigma, 4)
    radius_after = trial[7] if int(model[0]) == CYLINDER else trial[8]
    return trial if 0.5 * radius < radius_after < 2.0 * radius else model
