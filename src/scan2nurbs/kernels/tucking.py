"""Points that noise carried past a crease, moved back to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges

STEEP = 0.03
"""Least squared sine of the angle between two planes that are said to cross (10 degrees)."""
_RANGE = 1 << 12


def tuck_in(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    label: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    reach: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Move the points that stick out beyond another face's surface to where the two cross.

    Parameters
    ----------
    points, normals : (N, 3) float64
        Points on their faces' surfaces and the outward unit normals there.
    label : (N,) int32
        Face of each point.
    neighbours : (N, k) int32
        Near points of each point, the nearest first; −1 for none.
    reach : (N,) float64
        Farthest that a point may be moved.

    Returns
    -------
    (N, 3) float64

    Notes
    -----
    Whether two faces meet at a convex or at a concave crease is told by how their points near it lie to each other's tangent planes.
    Deterministic: every point looks at where the others were.
    """
    out = points.copy()
    run_ranges(lambda start, stop: _tuck(points, normals, label, neighbours, reach, start, stop, out), len(points), size=_RANGE)
    return out


@kernel
def _tuck(points, normals, label, neighbours, reach, start, stop, out):
    k = neighbours.shape[1]
    for i in range(start, stop):
        moves = 0
        for a in range(k):
            j = neighbours[i, a]
            if j < 0 or label[j] == label[i]:
                continue
            first = True
            for b in range(a):
                if neighbours[i, b] >= 0 and label[neighbours[i, b]] == label[j]:
                    first = False
            # The nearest point of each other face stands for it.
            if not first or moves == 2:
                continue
            cosine = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            steep = 1.0 - cosine * cosine
            if steep < STEEP:
                continue
            height = 0.0
            for x in range(3):
                height += normals[j, x] * (out[i, x] - points[j, x])
            bend = _bend(points, normals, label, neighbours, i, label[j])
            if height * bend >= 0.0 or abs(height) > reach[i] * np.sqrt(steep):
                continue
            # Along the own tangent plane until the other's is met.
            for x in range(3):
                out[i, x] -= height / steep * (normals[j, x] - cosine * normals[i, x])
            moves += 1


@kernel
def _bend(points, normals, label, neighbours, i, other):
    """Sum the heights of the near points of two faces over each other's tangent planes: negative at a convex crease."""
    total = 0.0
    for a in range(-1, neighbours.shape[1]):
        p = i if a < 0 else neighbours[i, a]
        if p < 0 or label[p] != label[i]:
            continue
        for b in range(neighbours.shape[1]):
            q = neighbours[i, b]
            if q >= 0 and label[q] == other:
                for x in range(3):
                    total += (normals[p, x] - normals[q, x]) * (points[q, x] - points[p, x])
    return total
