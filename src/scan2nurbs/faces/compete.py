"""Models compete for points: labels, fits and the set of models are improved in turns until each model pays for itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.model_shapes import signed_distances
from scan2nurbs.kernels.growth import DISTANCE_CAP, NONE_COST
from scan2nurbs.kernels.labelling import candidate_costs, choose_labels, nearby_labels
from scan2nurbs.kernels.offers import fill_candidates, offer_models
from scan2nurbs.kernels.pieces import label_pieces
from scan2nurbs.kernels.primitives import FREEDOM
from scan2nurbs.kernels.proposals import NOTICEABLE
from scan2nurbs.kernels.refits import criterion, refit_all, refit_amid
from scan2nurbs.kernels.runner import kernel, run_ranges

CANDIDATES = 8
REGIONS = 2
LINK_COST = 0.25
ACROSS_CREASE = 0.5
MODEL_COST = 12.0
OUTLYING = 5.0
"""No point of a surface lies so many standard deviations off it."""
LONGEST = 8.0
"""Points farther apart than so many h are no neighbours on a face, however sparse it is."""


@dataclass(frozen=True)
class Sheet:
    """A cloud in units of h with its graph: what every step of a segmentation works on.

    Attributes
    ----------
    points, normals : (N, 3) float64
        Points, and normals as lines, NaN where undefined.
    neighbours : (N, k) int32
    weights : (N, k) float32
        What it costs two neighbours to differ; less across creases.
    sigma, tilt : float
        Noise of points across the surface, in h, and of normals, as a sine.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    neighbours: NDArray[np.int32]
    weights: NDArray[np.float32]
    sigma: float
    tilt: float


def along_the_surface(
    points: NDArray[np.float64], normals: NDArray[np.float64], neighbours: NDArray[np.int32], sigma: float
) -> NDArray[np.int32]:
    """Cut the links that leap from one side of a thin wall to the other: along the normals of both ends, farther than noise goes.

    Returns
    -------
    (N, k) int32
        The neighbours; cut links and missing neighbours lead from a point to itself.
    """
    out = neighbours.copy()
    own = np.arange(len(points), dtype=np.int32)
    for k in range(neighbours.shape[1]):
        j = neighbours[:, k]
        step = points[j] - points
        length = np.linalg.norm(step, axis=1)
        here, there = np.abs(np.einsum("ij,ij->i", step, normals)), np.abs(np.einsum("ij,ij->i", step, normals[j]))
        leap = (np.minimum(here, there) > 0.75 * length) & (np.minimum(here, there) > 4.0 * sigma)
        out[:, k] = np.where((j < 0) | leap, own, j)
    return out


def link_weights(normals: NDArray[np.float64], neighbours: NDArray[np.int32]) -> NDArray[np.float32]:
    """Weigh the links of a graph: full along the surface, little where normals break."""
    out = np.full(neighbours.shape, LINK_COST, np.float32)
    for k in range(neighbours.shape[1]):
        dot = np.abs(np.einsum("ij,ij->i", normals, normals[neighbours[:, k]]))
        out[:, k] *= np.where(dot > 0.9, 1.0, ACROSS_CREASE)
        out[neighbours[:, k] == np.arange(len(normals)), k] = 0.0
    return out


def select(candidates: NDArray[np.int32], costs: NDArray[np.float32], models: NDArray[np.float64]) -> NDArray[np.int32]:
    """Leave out the models that others replace at less than they cost, the most dispensable first.

    Returns
    -------
    (N, K) int32
        The candidates that are left.
    """
    candidates = candidates.copy()
    n = len(models)
    if n == 0:
        return candidates
    freedom = np.array(FREEDOM)[models[:, 0].astype(int)]
    alive = np.zeros(n, bool)
    alive[np.unique(candidates[candidates >= 0])] = True
    while alive.any():
        loss, size = np.zeros(n), np.zeros(n, np.int64)
        _losses(candidates, costs, alive, loss, size)
        surplus = loss - MODEL_COST - 0.5 * freedom * np.log(np.maximum(size, 2))
        surplus[~alive] = np.inf
        worst = int(np.argmin(surplus))
        if not surplus[worst] < 0.0:
            break
        alive[worst] = False
    candidates[(candidates >= 0) & ~alive[candidates]] = -1
    return candidates


@kernel
def _losses(candidates, costs, alive, loss, size):
    for i in range(len(candidates)):
        best, second, own = NONE_COST, NONE_COST, -1
        for k in range(candidates.shape[1]):
            label = candidates[i, k]
            if label < 0 or not alive[label]:
                continue
            if costs[i, k] < best:
                best, second, own = costs[i, k], best, label
            elif costs[i, k] < second:
                second = costs[i, k]
        if own >= 0:
            loss[own] += max(second - best - NOTICEABLE, 0.0)
            size[own] += 1


def label_points(sheet: Sheet, models: NDArray[np.float64], candidates: NDArray[np.int32]) -> NDArray[np.int32]:
    """Let the candidates compete for the points."""
    costs = candidate_costs(sheet.points, sheet.normals, models, candidates, sheet.sigma, sheet.tilt)
    return choose_labels(candidates, costs, sheet.neighbours, sheet.weights)


def nearby(sheet: Sheet, label: NDArray[np.int32], rings: int) -> NDArray[np.int32]:
    """Return the labels near every point (N, K)."""
    out = np.full((len(label), CANDIDATES), -1, np.int32)
    nearby_labels(label, sheet.neighbours, rings, out)
    return out


def offered(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], rings: int) -> NDArray[np.int32]:
    """Return the models that may explain each point (N, K): those it connects to along points that follow them, and those nearby."""
    order, starts = grouped(label, len(models))
    candidates, offers = np.empty((len(label), CANDIDATES), np.int32), np.empty((len(label), CANDIDATES))
    offer_models(sheet.points, sheet.normals, sheet.neighbours, order, starts, models, sheet.sigma, sheet.tilt, candidates, offers)
    fill_candidates(candidates, nearby(sheet, label, rings))
    return candidates


def adopt(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], rings: int) -> NDArray[np.int32]:
    """Give points without a label the nearest surface among the labels nearby, where it passes within three standard deviations."""
    label = label.copy()
    for _ in range(2):
        lost = np.flatnonzero(label < 0)
        if not len(lost):
            break
        candidates = nearby(sheet, label, rings)[lost]
        unknown = np.full((len(lost), 3), np.nan)
        costs = candidate_costs(sheet.points[lost], unknown, models, candidates, sheet.sigma, sheet.tilt)
        best = np.argmin(costs, axis=1)
        rows = np.arange(len(lost))
        near = costs[rows, best] < DISTANCE_CAP
        label[lost[near]] = candidates[rows, best][near]
    return label


def drop_outliers(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]) -> NDArray[np.int32]:
    """Take the label from points that lie far from their surface, and farther than their neighbours do, or that have no neighbour on it."""
    order, starts = grouped(label, len(models))
    d = np.zeros(len(label))
    for i, model in enumerate(models):
        mine = order[starts[i] : starts[i + 1]]
        d[mine] = signed_distances(model, sheet.points[mine])
    others = sheet.neighbours != np.arange(len(label))[:, None]
    same = others & (label[sheet.neighbours] == label[:, None])
    mean = np.where(same, d[sheet.neighbours], 0.0).sum(axis=1) / np.maximum(same.sum(axis=1), 1)
    nearest = np.linalg.norm(sheet.points[sheet.neighbours] - sheet.points[:, None], axis=2)
    alone = ~(same & (nearest < LONGEST)).any(axis=1)
    return np.where(alone | (np.abs(d - mean) > OUTLYING * sheet.sigma), -1, label).astype(np.int32)


def split_pieces(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], least: int, *, strips: bool = False
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give every connected piece of a label its own model; pieces of fewer than `least` points lose their label.

    Points that are neighbours are connected; where labels may be strips too narrow for that, all that have a neighbour in common are.
    Outliers have only each other for neighbours, but farther away than any gap between points of a face.
    """
    piece = label_pieces(sheet.points, label, sheet.neighbours, LONGEST, strips=strips)
    good = (label >= 0) & (np.bincount(piece)[piece] >= least)
    kept, first, compact = np.unique(piece[good], return_index=True, return_inverse=True)
    out = np.full(len(label), -1, np.int32)
    out[good] = compact
    return out, models[label[good][first]].copy() if len(kept) else models[:0]


def depths(label: NDArray[np.int32], neighbours: NDArray[np.int32], most: int = 6) -> NDArray[np.int32]:
    """Count the rings from every point to another label, up to `most`."""
    same = (label[neighbours] == label[:, None]) | (neighbours < 0)
    inside = same.all(axis=1)
    depth = inside.astype(np.int32)
    for _ in range(most - 1):
        inside = inside & inside[neighbours].all(axis=1)
        depth += inside
    return depth


def fit_regions(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], kinds: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Refit all models to their points in place, changing kinds where that pays; return their criteria (M,)."""
    order, starts = grouped(label, len(models))
    values = np.empty(len(models))
    depth = depths(label, sheet.neighbours)

    def refit(start: int, stop: int) -> None:
        refit_all(sheet.points, sheet.normals, sheet.neighbours, order, starts, depth, kinds, sheet.sigma, start, stop, models, values)

    run_ranges(refit, len(models), size=REGIONS)
    return values


def criteria(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the criteria (M,) of models on their regions as they are."""
    order, starts = grouped(label, len(models))
    regions = zip(models, starts[:-1], starts[1:], strict=True)
    return np.array([criterion(model, sheet.points, order[a:b], b - a, sheet.sigma) for model, a, b in regions])


def plainest_models(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], kinds: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the models, of the kinds that the points amid the regions ask for.

    A region that has taken in some of the fillet along its border passes for something bent: a ring of a plane for the zone of a sphere.
    The fillet is seen only beside the plane.
    """
    order, starts = grouped(label, len(models))
    depth, out = depths(label, sheet.neighbours), models.copy()

    def refit(start: int, stop: int) -> None:
        refit_amid(sheet.points, sheet.normals, sheet.neighbours, order, starts, depth, kinds, sheet.sigma, start, stop, out)

    run_ranges(refit, len(models), size=REGIONS)
    return out


def grouped(label: NDArray[np.int32], n: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Sort the points by label: group l is order[starts[l]:starts[l + 1]]."""
    order = np.argsort(label, kind="stable").astype(np.int32)
    starts = np.searchsorted(label[order], np.arange(n + 1))
    return order, starts
