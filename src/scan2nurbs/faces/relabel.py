"""Labelled points made ready for a surface through them: doubtful labels settled, every point on its face's surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import POINTS_PER_CELL, build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.scale import NEIGHBOUR, Scale
from scan2nurbs.surfaces.shape import Floats, Shape

NEAR = 8
"""Neighbours that have a say in a point's label."""
AGREE = 0.3
"""What a neighbour of another label costs, as half a squared deviation."""
CAP = 8.0
"""Most that a deviation costs: four standard deviations."""
ROUNDS = 3
PARTS = 10
"""Of so many points next to each other one may be left out."""
_SAMPLE = 20_000


@dataclass(frozen=True)
class Samples:
    """Points on the surfaces of their faces.

    Attributes
    ----------
    points, normals : (N, 3) float64
        Feet of the cloud's points and the shapes' unit normals there.
    label : (N,) int32
        Face of each point, none without.
    neighbours : (N, k) int32
        Near points of each, the nearest first; −1 for none.
    spacing : (N,) float64
        Local spacing.
    h : float
        Their usual spacing.
    spread : float
        Standard deviation of the cloud's points across the surface.
    """

    points: Floats
    normals: Floats
    label: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    spacing: Floats
    h: float
    spread: float


def take_samples(
    points: Floats, label: NDArray[np.int32], shapes: Sequence[Shape], scale: Scale, max_points: int, without: int = 0
) -> Samples:
    """Move points onto their faces' surfaces, where their labels are settled and the surface is near.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Face of each point, −1 for none.
    shapes : sequence of Shape
    scale : Scale
    max_points : int
        Every so many of the sorted points is taken of more than these.
    without : int
        Which tenth of the points to leave out, from 1 to 10; 0 for none.
    """
    step = -(-len(points) // max_points)
    rows = scale.cells.order[::step]
    rows = np.delete(rows, np.s_[without - 1 :: PARTS]) if without else rows
    points, label = points[rows], label[rows].astype(np.int32)
    neighbours, _ = _neighbours(points, scale.h * math.sqrt(step))
    spread = max(min(scale.noise, _scatter(points, label, shapes)), 0.02 * scale.h)
    label = settle_labels(points, label, neighbours[:, :NEAR], shapes, spread)
    feet, normals, away = _feet(points, label, shapes)
    # A surface that fits badly is still the face's own: four times what is usual there.
    usual = np.array([np.median(away[label == f]) if np.any(label == f) else 0.0 for f in range(len(shapes))])
    limit = 4.0 * np.maximum(spread, 1.5 * usual)
    keep = label >= 0
    keep[keep] = away[keep] <= limit[label[keep]]
    feet, normals, label = feet[keep], normals[keep], label[keep]
    if len(feet) < 4:
        return Samples(feet, normals, label, np.full((len(feet), 1), -1, np.int32), np.full(len(feet), scale.h), scale.h, spread)
    h = scale.h * math.sqrt(step)
    neighbours, distance = _neighbours(feet, h)
    k = neighbours.shape[1]
    return Samples(feet, normals, label, neighbours, np.maximum(distance * math.sqrt(math.pi / k), 0.25 * h), h, spread)


def _scatter(points: Floats, label: NDArray[np.int32], shapes: Sequence[Shape]) -> float:
    """Return the standard deviation of points from their faces' surfaces, from the median; infinite where none has a face."""
    rows = np.flatnonzero(label >= 0)
    rows = rows[:: max(1, len(rows) // _SAMPLE)]
    if not len(rows):
        return math.inf
    return 1.4826 * math.sqrt(float(np.median(_squares(points[rows], label[rows], shapes))))


def _neighbours(points: Floats, h: float) -> tuple[NDArray[np.int32], Floats]:
    """Return the nearest neighbours (N, k) of every point and the distance (N,) of the last one."""
    cells = build_cells(points, math.sqrt(POINTS_PER_CELL) * h)
    k = min(NEIGHBOUR, len(points) - 1)
    index, distance = nearest_neighbours(cells, k, reach=h * math.sqrt(k / 2))
    neighbours, last = np.empty_like(index), np.empty(len(points))
    neighbours[cells.order] = np.where(index >= 0, cells.order[index], -1)
    last[cells.order] = distance[:, k - 1]
    return neighbours, last


def settle_labels(
    points: Floats, label: NDArray[np.int32], neighbours: NDArray[np.int32], shapes: Sequence[Shape], spread: float
) -> NDArray[np.int32]:
    """Let points change to the label of a neighbour, or take one, where that lowers deviations and disagreement.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        −1 for none.
    neighbours : (N, k) int32
        Near points of each, −1 for none.
    shapes : sequence of Shape
    spread : float
        Standard deviation of the points about their surface.

    Notes
    -----
    Iterated conditional modes of a Potts model (Besag 1986). Points without a label take one where its surface is near.
    """
    given, label = label, label.copy()
    n = len(points)
    exists = neighbours >= 0
    for turn in range(2 * ROUNDS):
        near = np.where(exists, label[neighbours], -1)
        unsettled = np.flatnonzero(((near != label[:, None]) & (near >= 0)).any(axis=1) & (np.arange(n) % 2 == turn % 2))
        if not len(unsettled):
            continue
        options = np.column_stack([label[unsettled], near[unsettled]])
        row, column = np.nonzero(options >= 0)
        pair = np.unique(np.column_stack([row, options[row, column]]), axis=0)
        row, option = pair[:, 0], pair[:, 1].astype(np.int32)
        cost = np.minimum(_squares(points[unsettled[row]], option, shapes) / (2.0 * spread**2), CAP)
        others = near[unsettled[row]]
        cost += AGREE * ((others != option[:, None]) & (others >= 0)).sum(axis=1) - 1e-9 * (option == label[unsettled[row]])
        # A point that lies on no surface stays without one.
        cost[(label[unsettled[row]] < 0) & (cost >= CAP)] = np.inf
        order = np.lexsort((option, cost, row))
        best = order[np.flatnonzero(np.r_[True, row[order][1:] != row[order][:-1]])]
        best = best[np.isfinite(cost[best])]
        label[unsettled[row[best]]] = option[best]
    # Small faces are not to be outvoted altogether.
    before, after = (np.bincount(x[x >= 0], minlength=len(shapes)) for x in (given, label))
    outvoted = after < 0.5 * before
    back = (given >= 0) & outvoted[given]
    label[back] = given[back]
    return label


def _squares(points: Floats, option: NDArray[np.int32], shapes: Sequence[Shape]) -> Floats:
    out = np.empty(len(points))
    for f in np.unique(option):
        rows = option == f
        out[rows] = shapes[f].distance(points[rows]) ** 2
    return np.where(np.isfinite(out), out, np.inf)


def _feet(points: Floats, label: NDArray[np.int32], shapes: Sequence[Shape]) -> tuple[Floats, Floats, Floats]:
    """Return the feet (N, 3) on the faces' surfaces, the normals there and how far the points lie away; infinite without a face."""
    feet, normals, away = points.copy(), np.zeros_like(points), np.full(len(points), np.inf)
    order = np.argsort(label, kind="stable")
    start = np.searchsorted(label[order], np.arange(len(shapes) + 1))
    for f, shape in enumerate(shapes):
        rows = order[start[f] : start[f + 1]]
        if len(rows):
            feet[rows] = shape.foot(points[rows])
            normals[rows] = shape.normal(feet[rows])
            away[rows] = np.linalg.norm(feet[rows] - points[rows], axis=1)
    bad = ~(np.isfinite(feet).all(axis=1) & np.isfinite(normals).all(axis=1))
    away[bad] = np.inf
    return feet, normals, away
