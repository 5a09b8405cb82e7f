"""Small faces that no seed found: points beside the surface that they were given to, which a plane of their own explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scan2nurbs.faces.compete import MODEL_COST, Sheet, grouped
from scan2nurbs.faces.model_shapes import signed_distances
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import FREEDOM, PLANE, SIZE

BESIDE = 3.0
"""Points farther from their surface, in standard deviations, lie beside it."""


def find_lost(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], least: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give groups of points that lie beside their surface a plane of their own, where that pays.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
        −1 where a point has none.
    models : (M, SIZE) float64
    least : int
        Fewest points of a face.

    Returns
    -------
    label, models : arrays
        With the planes appended. The bottom of a narrow blind hole is such a face: hardly one of its points is so far from the wall that
        a plane could grow from there, but none lies on the wall.
    """
    d = np.full(len(label), np.inf)
    order, starts = grouped(label, len(models))
    for i, model in enumerate(models):
        mine = order[starts[i] : starts[i + 1]]
        d[mine] = np.abs(signed_distances(model, sheet.points[mine]))
    beside = d > BESIDE * sheet.sigma
    i, j = np.repeat(np.arange(len(label)), sheet.neighbours.shape[1]), sheet.neighbours.ravel()
    both = (j >= 0) & beside[i] & beside[j]
    graph = coo_array((np.ones(int(both.sum()), np.int8), (i[both], j[both])), shape=(len(label), len(label)))
    _, group = connected_components(graph, directed=False)
    rows = np.flatnonzero(beside)
    rows = rows[np.argsort(group[rows], kind="stable")]
    label, new = label.copy(), []
    for mine in np.split(rows, np.flatnonzero(np.diff(group[rows])) + 1):
        if len(mine) < least:
            continue
        plane = least_squares_plane(sheet.points[mine])
        t = signed_distances(plane, sheet.points[mine]) / sheet.sigma
        left = float(np.minimum(0.5 * t**2, DISTANCE_CAP).sum())
        cost = MODEL_COST + 0.5 * FREEDOM[PLANE] * np.log(len(mine))
        if DISTANCE_CAP * len(mine) - left > cost and left < 0.5 * DISTANCE_CAP * len(mine):
            label[mine] = len(models) + len(new)
            new.append(plane)
    return label, np.vstack([models, *new])


def least_squares_plane(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the plane of least squares through points (N, 3), as a model."""
    centre = points.mean(axis=0)
    model = np.zeros(SIZE)
    model[0], model[1:4], model[4:7] = PLANE, centre, np.linalg.svd(points - centre, full_matrices=False)[2][2]
    return model
