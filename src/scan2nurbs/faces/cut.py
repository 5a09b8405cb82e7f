"""Decide at once on the sides of all tetrahedra that their own corners leave in doubt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from scan2nurbs.surfaces.shape import Floats

TRUST = 0.2
"""Area, in h², that what a tetrahedron's corners say of it is worth."""
LARGEST = 100.0
"""Area, in h², beyond which a triangle costs no more."""
_UNIT = 200.0


def decide_sides(
    points: Floats, tetrahedra: NDArray[np.int32], neighbours: NDArray[np.int32], depth: Floats, doubt: NDArray[np.bool_], h: float
) -> NDArray[np.bool_]:
    """Find the sides that leave the least surface between inside and outside.

    Parameters
    ----------
    points : (N, 3) float64
    tetrahedra, neighbours : (T, 4) int32
        Corners, −1 for infinity, and the tetrahedron across the triangle that leaves out each of them.
    depth : (T,) float64
        Positive inside; the size is the confidence.
    doubt : (T,) bool
        Which tetrahedra may change sides.
    h : float
        Spacing of the points.

    Returns
    -------
    (D,) bool
        Whether each tetrahedron in doubt lies inside.

    Notes
    -----
    A minimum cut: the area of the triangles between the two sides plus what contradicts the depths. Only a few percent of the tetrahedra
    are in doubt, those along creases.
    """
    rows = np.flatnonzero(doubt)
    n = len(rows)
    if n == 0:
        return np.zeros(0, bool)
    number = np.full(len(tetrahedra), -1)
    number[rows] = np.arange(n)
    source, sink = n, n + 1
    inside = depth > 0
    node = np.arange(n)
    start = [np.where(inside[rows], source, node)]
    end = [np.where(inside[rows], node, sink)]
    weight = [TRUST * np.abs(depth[rows])]
    for k in range(4):
        area = np.minimum(_areas(points, np.delete(tetrahedra[rows], k, axis=1)) / h**2, LARGEST)
        across = neighbours[rows, k]
        fixed = ~doubt[across]
        start.append(np.where(fixed & inside[across], source, node))
        end.append(np.where(fixed, np.where(inside[across], node, sink), number[across]))
        weight.append(area)
    capacity = csr_matrix(
        ((np.concatenate(weight) * _UNIT).astype(np.int32), (np.concatenate(start), np.concatenate(end))), shape=(n + 2, n + 2)
    )
    left = capacity - maximum_flow(capacity, source, sink).flow
    left.data = (left.data > 0).astype(np.int32)
    left.eliminate_zeros()
    reached = np.zeros(n + 2, bool)
    reached[breadth_first_order(left, source, directed=True, return_predecessors=False)] = True
    return reached[:n]


def _areas(points: Floats, triangles: NDArray[np.int32]) -> Floats:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.where((triangles < 0).any(axis=1), np.inf, area)
