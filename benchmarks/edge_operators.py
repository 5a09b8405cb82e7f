"""What `benchmarks.edges` measures: every operator of ours and its peers, each a number a point that grows towards edges.

Ours that decide by themselves mark points; for the others, peers included, the benchmark finds the single threshold that is best over
all clouds, which is more than a user could.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import scan2nurbs as s2n
from scan2nurbs.cloud import as_cloud
from scan2nurbs.kernels.thinning import ball_covariances
from scan2nurbs.scale import Scale, measure_scale

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Operator:
    """An operator of the table.

    Attributes
    ----------
    name : str
    measure : callable
        Takes the points (N, 3) and returns a number a point; NaN where undefined.
    threshold : float or None
        Points are marked where the number is larger; None asks for the best single threshold.
    """

    name: str
    measure: Callable[[Floats], Floats]
    threshold: float | None = None


def default(points: Floats) -> Floats:
    """Return 1 where the default marks a point, else 0."""
    return s2n.detect_edges(points).mask.astype(np.float64)


def ours(operator: str) -> Callable[[Floats], Floats]:
    return lambda points: s2n.detect_edges(points, s2n.EdgeParams(operator=operator)).strength


def surface_variation(points: Floats, radius: float = 6.0) -> Floats:
    """Measure λ0 / (λ0 + λ1 + λ2) of the covariance of balls of `radius` h (Pauly, Gross and Kobbelt 2002)."""
    _, order, _, covariance, count = _balls(points, radius)
    values = np.linalg.eigvalsh(covariance)
    variation = np.where(count > 3, values[:, 0] / np.maximum(values.sum(axis=1), 1e-300), np.nan)
    return _spread(variation, order, len(points))


def shrink_index(points: Floats, radius: float = 8.0) -> Floats:
    """Measure how far the mean of a ball of `radius` h lies off its point along the normal, in h (the smooth shrink index of Nie 2016)."""
    scale, order, mean, covariance, count = _balls(points, radius)
    normal = np.linalg.eigh(covariance)[1][:, :, 0]
    # The means of points nearby are averaged, which takes the point's own noise out.
    sorted_points = scale.cells.points
    smooth, _, _ = ball_covariances(scale.cells, np.ascontiguousarray(sorted_points), 2.0 * scale.h)
    off = np.abs(np.einsum("nc,nc->n", mean - smooth, normal)) / scale.h
    return _spread(np.where(count > 3, off, np.nan), order, len(points))


def _balls(points: Floats, radius: float) -> tuple[Scale, NDArray[np.int32], Floats, Floats, NDArray[np.int64]]:
    cloud = as_cloud(points)
    scale = measure_scale(cloud.points)
    mean, covariance, count = ball_covariances(scale.cells, np.ascontiguousarray(scale.cells.points), radius * scale.h)
    # Benchmarks give distinct points in order, so that the cloud's rows are the input's.
    return scale, scale.cells.order, mean, covariance, count


def _spread(values: Floats, order: NDArray[np.int32], n: int) -> Floats:
    out = np.full(n, np.nan)
    out[order] = values
    return out


EDN = ours("edn")

OPERATORS = (
    Operator("**default**", default, 0.5),
    Operator("one-sided normals", ours("one-sided")),
    Operator("EDN, the paper's setting (δ = 20°)", EDN, 20.0),
    Operator("EDN, best δ", EDN),
    Operator("DN (PCL's DoN), best δ", ours("dn")),
    Operator("VDN, best δ", ours("vdn")),
    Operator("surface variation, 6 h", surface_variation),
    Operator("smooth shrink index, 8 h", shrink_index),
)
