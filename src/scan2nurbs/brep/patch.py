"""A smooth surface within loops: a disc's image that ends in them, and follows the points between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import coo_array, csr_matrix, diags_array, eye, kron
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_NEIGHBOURS = 10
_STEP = 1.0
"""Distance of knots, in h, on a disc of the loop's length."""
_SPANS = (6, 64)
_RIM = 10.0
"""Weight of the loops' points."""
_LEAST = 0.05
"""Points nearer to each other than so many h are no closer neighbours than these."""
_WITHIN = 1.02
"""Half the width of the square about the unit disc that is spanned."""


def patch_within(loops: Sequence[Floats], inner: Floats, h: float, smooth: float) -> tuple[BSplineSurface, list[Floats]]:
    """Span loops by the image of the unit disc, with holes in it.

    Parameters
    ----------
    loops : sequence of (K, 3) float64
        Points along each, in order, not repeated; the first one is the outer one.
    inner : (M, 3) float64
        Points of the surface.
    h : float
        Spacing of the points.
    smooth : float
        Weight of the surface's second differences; the inner points have 1.

    Returns
    -------
    surface : BSplineSurface
        Bicubic.
    uv : list of (K, 2) float64
        Where the loops lie in its parameters.

    Notes
    -----
    Tutte (1963), for points: the outer loop goes around the disc by its length, every other point lies amid its neighbours, of which one
    is the middle of the hole for points along an inner loop. Neighbours along a loop stay so, whatever it does in space: no two parts of
    a border cross in the parameters, as they may do on a surface that was fitted without them.
    """
    step = np.linalg.norm(np.roll(loops[0], -1, axis=0) - loops[0], axis=1)
    length = float(step.sum())
    angle = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(step)[:-1]]) / length
    points = np.vstack([*loops, inner])
    uv = _amid(points, [len(loop) for loop in loops], np.column_stack([np.cos(angle), np.sin(angle)]), h)
    # Within holes and along tubes the disc has more points than its border tells.
    spans = int(np.clip(max(length / (np.pi * _STEP * h), np.sqrt(len(points))), *_SPANS))
    knots = np.r_[[-_WITHIN] * 3, np.linspace(-_WITHIN, _WITHIN, spans + 1), [_WITHIN] * 3]
    weights = np.r_[np.full(len(points) - len(inner), _RIM), np.ones(len(inner))]
    control = _control(knots, uv, points, weights, smooth)
    ends = np.cumsum([len(loop) for loop in loops])
    return BSplineSurface((3, 3), (knots, knots), control, np.ones(control.shape[:2])), np.split(uv[: ends[-1]], ends[:-1])


def _amid(points: Floats, sizes: Sequence[int], rim: Floats, h: float) -> Floats:
    """Return parameters (N, 2) of points, of which the first ones are those of loops of so many each, and those of the first are given."""
    n, k = len(points), len(rim)
    distance, near = (np.asarray(found) for found in KDTree(points).query(points, k=min(_NEIGHBOURS + 1, n)))
    weight = 1.0 / np.maximum(distance[:, 1:], _LEAST * h)
    i, j, w = np.repeat(np.arange(n), near.shape[1] - 1), near[:, 1:].ravel(), weight.ravel()
    # The middle of each hole, which is no point of the surface, keeps the loop around it apart.
    starts = np.cumsum([0, *sizes])
    for hole in range(1, len(sizes)):
        around = np.arange(starts[hole], starts[hole + 1])
        i, j, w = np.r_[i, around], np.r_[j, np.full(len(around), n + hole - 1)], np.r_[w, np.full(len(around), 1.0 / h)]
    m = n + len(sizes) - 1
    one_way = coo_array((w, (i, j)), shape=(m, m)).tocsr()
    links: Any = one_way + one_way.T
    laplacian: Any = csr_matrix(diags_array(np.asarray(links.sum(axis=1)).ravel()) - links)
    return np.vstack([rim, splu(laplacian[k:, k:].tocsc()).solve(-(laplacian[k:, :k] @ rim))])[:n]


def _control(knots: Floats, uv: Floats, points: Floats, weights: Floats, smooth: float) -> Floats:
    """Fit the control points (n, n, 3) of a bicubic spline by least squares."""
    n = len(knots) - 4
    data = [BSpline.design_matrix(np.clip(uv[:, a], knots[0], knots[-1]), knots, 3).tocsr() for a in (0, 1)]
    rank = [d.data.reshape(-1, 4) for d in data]
    columns = (data[0].indices.reshape(-1, 4)[:, :, None] * n + data[1].indices.reshape(-1, 4)[:, None, :]).ravel()
    values = (weights[:, None, None] * rank[0][:, :, None] * rank[1][:, None, :]).ravel()
    rows = csr_matrix((values, (np.repeat(np.arange(len(uv)), 16), columns)), shape=(len(uv), n * n))
    bend = csr_matrix(np.diff(np.eye(n), 2, axis=0))
    fair = kron(bend.T @ bend, eye(n)) + kron(eye(n), bend.T @ bend)
    solver = splu((rows.T @ rows + smooth**2 * fair).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return np.ascontiguousarray(solver.solve(rows.T @ (weights[:, None] * points)).reshape(n, n, 3))
