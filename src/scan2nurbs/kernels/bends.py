"""How the surface bends at every point, and how evenly: where seeds are safe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.growth import neighbourhood
from scan2nurbs.kernels.primitives import SIZE
from scan2nurbs.kernels.runner import kernel, run_ranges
from scan2nurbs.kernels.starts import curvatures

POINTS = 40
FEWER = 24
TURN = 0.8
RANGE = 8192


def bends(
    points: NDArray[np.float64], normals: NDArray[np.float64], neighbours: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measure both principal curvatures at every point from its nearest points along the surface.

    Parameters
    ----------
    points, normals : (N, 3) float64
        In units of h; normals are lines, NaN where undefined.
    neighbours : (N, k) int32
        Nearest neighbours.

    Returns
    -------
    curvature : (N, 2) float64
        Principal curvatures in 1/h with the larger magnitude first and >= 0; NaN where too few points are connected.
    smooth : (N, 3) float64
        Normals of the quadrics, of fewer points: where the surface curves they do not lean to the flatter side, as one-sided ones do.
    """
    curvature, smooth = np.full((len(points), 2), np.nan), normals.copy()

    def work(start: int, stop: int) -> None:
        _bends(points, normals, neighbours, start, stop, curvature, smooth)

    run_ranges(work, len(points), size=RANGE)
    return curvature, smooth


@kernel
def _bends(points, normals, neighbours, start, stop, out, smooth):
    stamp = np.zeros(len(points), np.int32)
    queue = np.empty(POINTS, np.int32)
    frame, bend = np.zeros(SIZE), np.empty(14)
    for i in range(start, stop):
        n = neighbourhood(neighbours, normals, i, POINTS, TURN, stamp, i + 1, queue)
        if n < POINTS // 2:
            continue
        curvatures(points, queue, n, frame, bend)
        sign = 1.0 if bend[0] >= 0.0 else -1.0
        out[i, 0], out[i, 1] = sign * bend[0], sign * bend[1]
        curvatures(points, queue, min(n, FEWER), frame, bend)
        for k in range(3):
            smooth[i, k] = bend[8 + k]


def unevenness(curvature: NDArray[np.float64], neighbours: NDArray[np.int32]) -> NDArray[np.float64]:
    """Measure over how wide a range curvatures vary about every point, within two rings of neighbours.

    Returns
    -------
    (N,) float64
        In 1/h; infinite where a curvature is undefined.
    """
    total = np.zeros(len(curvature))
    for column in range(2):
        k = np.where(np.isnan(curvature[:, column]), 1e3, curvature[:, column])
        low, high = k, k
        for _ in range(2):
            low = np.minimum(low, low[neighbours].min(axis=1))
            high = np.maximum(high, high[neighbours].max(axis=1))
        total += high - low
    return total
