"""How near a result comes to the truth: scores of edges, kinds, curves, faces and models, each a dictionary of plain numbers.

Definitions
-----------
edge precision   share of the points marked that lie within t of a sharp edge; points near a faint edge only are not counted
edge recall      share of the sharp samples with a marked point within t;       t = 1, 2 and 4 h
curve precision  share of the curves' length within 1 h of a sharp edge; what is near a faint edge only is not counted
curve recall     share of the sharp samples within 2 h of a curve
face IoU         mean over true faces of the IoU under the best one-to-one matching; f1 counts matches with IoU above 0.5
coverage         share of the true places within 1 h of the model;  precision   share of the model within 1 h of the true surface
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree

from benchmarks.truth import Truth
from scan2nurbs.brep.cad import CadPart, tessellate

Floats = NDArray[np.float64]


def f1(precision: float, recall: float) -> float:
    return 2 * precision * recall / max(precision + recall, 1e-12)


def distance_to(places: Floats, points: Floats) -> Floats:
    """Return how far each point is from the nearest place; infinite where there is none."""
    return KDTree(places).query(points)[0] if len(places) and len(points) else np.full(len(points), np.inf)


def _precision(truth: Truth, points: Floats, within: float) -> float:
    hit = distance_to(truth.edges.sharp, points) <= within
    counted = hit | (distance_to(truth.edges.faint, points) > within)
    return float(hit.sum() / counted.sum()) if counted.any() else float(len(truth.edges.sharp) == 0)


def score_edges(truth: Truth, mask: NDArray[np.bool_]) -> dict[str, dict[str, float]]:
    """Score the points marked, at tolerances of 1, 2 and 4 h."""
    marked = truth.points[mask]
    back = distance_to(marked, truth.edges.sharp)
    scores = {}
    for t in (1, 2, 4):
        precision = _precision(truth, marked, t * truth.h)
        recall = float((back <= t * truth.h).mean()) if len(back) else 1.0
        scores[f"t{t}"] = {"precision": precision, "recall": recall, "f1": f1(precision, recall)}
    return scores


def score_curves(truth: Truth, curves: list[Floats]) -> dict[str, float]:
    """Score curves, each given as points evenly spaced at h/2 or less."""
    points = np.concatenate(curves) if curves else np.empty((0, 3))
    back = distance_to(points, truth.edges.sharp)
    recall = float((back <= 2 * truth.h).mean()) if len(back) else 1.0
    return {"precision": _precision(truth, points, truth.h), "recall": recall, "curves": float(len(curves))}


def score_faces(truth: Truth, label: NDArray[np.integer]) -> dict[str, dict[str, float]]:
    """Score a face number for every point, −1 for none; outliers do not count."""
    true = truth.scan.face
    real = true >= 0
    return {"faces": _match(true[real], label[real]), "patches": _match(truth.patch[true[real]], label[real])}


def _match(true: NDArray[np.integer], found: NDArray[np.integer]) -> dict[str, float]:
    rows, row = np.unique(true, return_inverse=True)
    known = found >= 0
    columns, column = np.unique(found[known], return_inverse=True)
    if len(columns) == 0:
        return {"iou": 0.0, "f1": 0.0, "true": float(len(rows)), "found": 0.0}
    shared = np.zeros((len(rows), len(columns)))
    np.add.at(shared, (row[known], column), 1)
    iou = shared / (np.bincount(row)[:, None] + shared.sum(axis=0) - shared)
    a, b = linear_sum_assignment(-iou)
    good = int((iou[a, b] > 0.5).sum())
    return {
        "iou": float(iou[a, b].sum() / len(rows)),
        "f1": 2 * good / (len(rows) + len(columns)),
        "true": float(len(rows)),
        "found": float(len(columns)),
    }


def score_model(truth: Truth, shape: Any) -> dict[str, float]:
    """Score a CAD shape: valid, closed, and its distance to the true surface both ways, in h."""
    from scan2nurbs.brep.check import check

    found = check(shape)
    model = tessellate(shape)
    real = truth.scan.face >= 0
    places, normals = _spread(model, int(np.clip(2 * model.area / truth.h**2, 50_000, 400_000)))
    to_model = _off(truth.scan.clean[real], places, normals) / truth.h
    to_truth = _off(places, truth.scan.clean[real], truth.scan.normal[real]) / truth.h
    return {
        "valid": float(found.valid),
        "closed": float(found.closed),
        "free_edges": float(found.free_edges),
        "faces": float(found.n_faces),
        "true_faces": float(len(truth.part.faces)),
        "coverage": float((to_model < 1).mean()),
        "precision": float((to_truth < 1).mean()),
        "rms": float(np.sqrt(np.mean(to_model**2))),
        "worst": float(to_model.max()),
    }


def _spread(part: CadPart, n: int) -> tuple[Floats, Floats]:
    """Return random points and normals on a part."""
    rng = np.random.default_rng(0)
    area = part.triangle_area
    triangle = np.searchsorted(np.cumsum(area), rng.random(n) * area.sum()).clip(max=len(area) - 1)
    square = rng.random((n, 2))
    square = np.where(square.sum(axis=1, keepdims=True) > 1, 1 - square, square)
    return part.lift(triangle, np.column_stack([1 - square.sum(axis=1), square]))


def _off(points: Floats, places: Floats, normals: Floats) -> Floats:
    """Return distances to a sampled surface: along its normal where a sample is near, so that its own spacing does not count."""
    distance, nearest = KDTree(places).query(points)
    along = np.abs(np.einsum("nc,nc->n", points - places[nearest], normals[nearest]))
    return np.where(distance < 3 * np.median(distance) + 1e-300, along, distance)
