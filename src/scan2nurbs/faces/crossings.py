"""Polylines that must not cross: where they do, and how small loops are cut out of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]


def crossing_pairs(a: Array, b: Array) -> tuple[Rows, Rows]:
    """Return the pairs (i < j) of segments from a (K, 2) to b (K, 2) that properly cross; segments should be alike in length."""
    none = np.empty(0, np.int64)
    if len(a) < 2:
        return none, none
    reach = float(np.linalg.norm(b - a, axis=1).max())
    pairs = KDTree(0.5 * (a + b)).query_pairs(reach, output_type="ndarray").astype(np.int64)
    i, j = pairs[:, 0], pairs[:, 1]

    def side(p: Array, q: Array, r: Array) -> Array:
        return (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])

    cross = (side(a[i], b[i], a[j]) * side(a[i], b[i], b[j]) < 0.0) & (side(a[j], b[j], a[i]) * side(a[j], b[j], b[i]) < 0.0)
    return i[cross], j[cross]


def crossing_loops(lines: list[Array], period: float | None = None) -> Mask:
    """Tell which polylines cross themselves or another one.

    Parameters
    ----------
    lines : list of (K, 2) float64
        Closed ones repeat their first point.
    period : float, optional
        Polylines also cross where they do so one period on in x.
    """
    of_line = np.concatenate([np.full(len(line) - 1, i) for i, line in enumerate(lines)])
    a, b = np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines])
    if period is not None:
        of_line = np.tile(of_line, 2)
        turn = np.array([period, 0.0])
        a, b = np.concatenate([a, a + turn]), np.concatenate([b, b + turn])
    i, j = crossing_pairs(a, b)
    crossed = np.zeros(len(lines), np.bool_)
    crossed[of_line[i]] = True
    crossed[of_line[j]] = True
    return crossed


def cut_small_loops(points: Array, corners: Rows, flags: Mask, shift: Array, longest: int) -> tuple[Array, Rows, Mask]:
    """Cut small loops out of a closed polyline, each replaced by the point where it crosses itself.

    Parameters
    ----------
    points : (K, 2) float64
    corners : (C,) int64
        Rows of corners; a corner in a loop that is cut out becomes the crossing.
    flags : (K,) bool
        Something about each row, carried along.
    shift : (2,) float64
        From the first point to the end of the polyline.
    longest : int
        Loops of more rows are left alone.
    """
    is_corner = np.zeros(len(points), np.bool_)
    is_corner[corners] = True
    while True:
        k = len(points)
        ends = np.concatenate([points[1:], points[:1] + shift])
        first, second = crossing_pairs(points, ends)
        # The part from i + 1 to j inward, or the one around through the end, whichever is shorter.
        inner = second - first
        length = np.minimum(inner, k - inner)
        small = np.flatnonzero((length <= longest) & (inner <= k - inner))
        if len(small) == 0:
            around = np.flatnonzero((length <= longest) & (inner > k - inner))
            if len(around) == 0 or k < 3 * longest:
                return points, np.flatnonzero(is_corner), flags
            # The loop lies across the seam: move the seam away from it.
            points = np.concatenate([points[2 * longest :], points[: 2 * longest] + shift])
            is_corner, flags = np.roll(is_corner, -2 * longest), np.roll(flags, -2 * longest)
            continue
        best = small[np.lexsort((first[small], length[small]))[0]]
        i, j = int(first[best]), int(second[best])
        u, v, d = ends[i] - points[i], ends[j] - points[j], points[j] - points[i]
        meet = points[i] + u * ((d[0] * v[1] - d[1] * v[0]) / (u[0] * v[1] - u[1] * v[0]))
        keep = np.r_[0 : i + 1, j + 1 : k]
        sharp = bool(is_corner[i + 1 : j + 1].any())
        points = np.insert(points[keep], i + 1, meet, axis=0)
        is_corner = np.insert(is_corner[keep], i + 1, sharp)
        flags = np.insert(flags[keep], i + 1, flags[i])
