"""Algorithm 3 of the paper: which points a boundary encloses, judged from its centroid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.errors import ParameterError

_BLOCK = 1 << 18


def enclosed_by_centroid(points: NDArray[np.float64], boundary: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which points the boundary encloses, as the paper's Algorithm 3 prints it.

    A point x is inside where its nearest boundary point y and the boundary's centroid c lie on opposite sides of it,
    (y − x)·(c − x) < 0, and y is farther from c than x is, |y − c| > |x − c|.

    Parameters
    ----------
    points : (N, 3) or (N, 2) float64
        The points to judge, V = P − B̂. Boundary points may be among them: they are never inside, being their own nearest.
    boundary : (M, 3) or (M, 2) float64
        The approximated boundary points B̂.

    Returns
    -------
    (N,) bool
        True for the points of T, the inside.

    Raises
    ------
    ParameterError
        If there is no boundary point, or the arrays do not hold points of the same dimension.

    Notes
    -----
    Right for outlines that are star-shaped about their centroid and evenly covered (circle, square); an L, a U, a crescent or
    a ring is not. Of boundary points equally near, which one decides is left to the tree. O(N log M); the same answer for any
    order of the points.
    """
    points, boundary = np.asarray(points, np.float64), np.asarray(boundary, np.float64)
    if boundary.ndim != 2 or len(boundary) == 0:
        raise ParameterError(f"The 'boundary' of enclosed_by_centroid must hold points. Got the shape {boundary.shape} instead.")
    if points.ndim != 2 or points.shape[1] != boundary.shape[1]:
        expected = f"(N, {boundary.shape[1]})"
        raise ParameterError(f"The 'points' of enclosed_by_centroid must be {expected}. Got the shape {points.shape} instead.")
    centroid = boundary.mean(axis=0)
    tree = KDTree(boundary)
    inside = np.empty(len(points), np.bool_)
    for start in range(0, len(points), _BLOCK):
        x = points[start : start + _BLOCK]
        y = boundary[tree.query(x)[1]]
        opposite = np.einsum("ij,ij->i", y - x, centroid - x) < 0.0
        farther = ((y - centroid) ** 2).sum(axis=1) > ((x - centroid) ** 2).sum(axis=1)
        inside[start : start + _BLOCK] = opposite & farther
    return inside
