"""How far the nearest points lie off a point's plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges

_RANGE = 1 << 15


def thickness(points: NDArray[np.float64], normals: NDArray[np.float64], neighbours: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the root mean square distance of each point's neighbours from its plane.

    Parameters
    ----------
    points : (N, 3) float64
    normals : (N, 3) float64
        Of the planes through the points; NaN where unknown.
    neighbours : (N, k) int32
        None missing.

    Returns
    -------
    (N,) float64
        In the points' unit; NaN where the normal is unknown.
    """
    out = np.empty(len(points))
    run_ranges(lambda start, stop: _thickness(points, normals, neighbours, start, stop, out), len(points), size=_RANGE)
    return out


@kernel
def _thickness(points, normals, neighbours, start, stop, out):
    for i in range(start, stop):
        total = 0.0
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            off = 0.0
            for c in range(3):
                off += (points[j, c] - points[i, c]) * normals[i, c]
            total += off * off
        out[i] = np.sqrt(total / neighbours.shape[1])
