"""Whether normals point outwards: what they say where a group of points reaches farthest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel


def outward_signs(
    points: NDArray[np.float64], normals: NDArray[np.float64], group: NDArray[np.int32], directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Tell which groups' normals point inwards where they reach farthest, over many directions.

    Parameters
    ----------
    points, normals : (N, 3) float64
        Normals are alike within each group.
    group : (N,) int32
        Group of each point; −1 for points that take no part.
    directions : (D, 3) float64

    Returns
    -------
    (G,) float64
        −1 where the normals of a group's outermost points, of all directions together, point inwards; else 1.

    Notes
    -----
    O(N D), in one thread. A point that is outermost in a direction has its outward normal within 90 degrees of it.
    """
    n = int(group.max(initial=0)) + 1
    far, total = np.full((n, len(directions)), -np.inf), np.zeros((n, len(directions)))
    _outermost(points, normals, group, directions, far, total)
    return np.where(total.sum(axis=1) < 0.0, -1.0, 1.0)


@kernel
def _outermost(points, normals, group, directions, far, total):
    for i in range(len(points)):
        g = group[i]
        if g < 0:
            continue
        for d in range(len(directions)):
            u, v, w = directions[d, 0], directions[d, 1], directions[d, 2]
            along = points[i, 0] * u + points[i, 1] * v + points[i, 2] * w
            if along >= far[g, d]:
                arrow = normals[i, 0] * u + normals[i, 1] * v + normals[i, 2] * w
                # Points of a flat side are outermost together.
                total[g, d] = total[g, d] + arrow if along == far[g, d] else arrow
                far[g, d] = along
