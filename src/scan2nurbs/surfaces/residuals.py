"""What residuals tell: the noise, which points are outliers, and where the surface misses the points systematically."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from scan2nurbs.surfaces.axis import Axis

_BLOCK = 30
_TUKEY = 5.0
_SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class Weighing:
    """Robust weights (N,) in [0, 1], 0 for outliers, and the noise (one standard deviation) they were judged by."""

    weights: NDArray[np.float64]
    noise: float


def weigh(
    uv: NDArray[np.float64],
    size: tuple[float, float],
    normal: NDArray[np.float64],
    whole: NDArray[np.float64],
    floor: float,
    lenience: float | None = np.inf,
) -> Weighing:
    """Weigh points by how far their residuals lie from their neighbours' median (Tukey's biweight, scale from the MAD).

    Comparing with the neighbours keeps a region that the surface does not follow *yet*: its points agree with each other.

    Parameters
    ----------
    uv : (N, 2) float64
        Foot points in [0, size[0]] × [0, size[1]].
    normal, whole : (N,) float64
        Distances along the normal (signed) and in space.
    floor : float
        The scale is taken no smaller than this.
    lenience : float
        By how much a block whose own deviations are large may raise the scale. None: no point is an outlier.
    """
    block = _blocks(uv, size, len(uv) / _BLOCK)
    # A few points are no neighbourhood: outliers alone in an empty corner must not vouch for each other.
    many = np.bincount(block) >= _BLOCK // 4
    deviation = normal - np.where(many, _block_medians(block, normal), 0.0)[block]
    if lenience is None:
        return Weighing(np.ones(len(uv)), float(np.sqrt(np.mean(deviation**2))))
    # The median of 30 takes away a part of the noise; π / 2 is the variance of a median relative to a mean's.
    noise = 1.4826 * float(np.median(np.abs(deviation))) / np.sqrt(1.0 - np.pi / 2.0 / _BLOCK)
    # Where the surface does not follow yet, the deviations of a whole block are large; a minority in it are outliers all the same.
    local = np.where(many, 1.4826 * _block_medians(block, np.abs(deviation)), 0.0)
    usual = max(noise, floor)
    most = max(usual, lenience * noise) if noise > 0.0 else usual  # points of a mesh may lie on its surface to the last bit
    scale = np.clip(local, usual, most)[block]
    beside = np.maximum(whole**2 - normal**2, 0.0)
    x = np.sqrt(deviation**2 + beside) / (_TUKEY * scale)
    return Weighing(np.where(x < 1.0, (1.0 - np.minimum(x, 1.0) ** 2) ** 2, 0.0), noise)


def _blocks(uv: NDArray[np.float64], size: tuple[float, float], count: float) -> NDArray[np.int64]:
    """Return for each point the block of a regular grid of about `count` blocks, as square as the rectangle allows."""
    side = np.sqrt(size[0] * size[1] / max(count, 1.0))
    n_u, n_v = (max(1, round(s / side)) for s in size)
    i = np.clip((uv[:, 0] / size[0] * n_u).astype(np.int64), 0, n_u - 1)
    j = np.clip((uv[:, 1] / size[1] * n_v).astype(np.int64), 0, n_v - 1)
    return i * n_v + j


def _block_medians(block: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    order = np.lexsort((values, block))
    count = np.bincount(block)
    start = np.cumsum(count) - count
    last = np.maximum(len(values) - 1, 0)
    low = values[order[np.minimum(start + np.maximum(count - 1, 0) // 2, last)]]
    high = values[order[np.minimum(start + count // 2, last)]]
    return 0.5 * (low + high)


def systematic(
    u: Axis,
    v: Axis,
    uv: NDArray[np.float64],
    residuals: NDArray[np.float64],
    weights: NDArray[np.float64],
    noise: float,
    tolerance: float,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Mark the spans of u and of v whose residuals are not noise.

    Each span is cut along one direction in 2 (degree + 1) pieces, twice as many as a polynomial piece has waves left. Were the residuals
    noise, the spread of the pieces' means, Σ n · (mean − mean of all)² / σ², would follow a chi-squared law; it is tested for every cell
    of the net, every strip, and the whole, and what is significant and larger than its
    share of the tolerance (1, 1/2, 1/4 of it, as the root of the mean square) asks for a knot in that direction.
    """
    return (
        _marks(u, v, uv[:, 0], uv[:, 1], residuals, weights, noise, tolerance),
        _marks(v, u, uv[:, 1], uv[:, 0], residuals, weights, noise, tolerance),
    )


def _marks(
    along: Axis,
    across: Axis,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    residuals: NDArray[np.float64],
    weights: NDArray[np.float64],
    noise: float,
    tolerance: float,
) -> NDArray[np.bool_]:
    m, n = along.n_spans, across.n_spans
    pieces, lanes = 2 * (along.degree + 1), 4 if n <= 3 else 2
    index = _cut(along, x, pieces) * (n * lanes) + _cut(across, y, lanes)
    count = np.bincount(index, weights, m * pieces * n * lanes).reshape(m, pieces, n, lanes)
    total = np.bincount(index, weights * residuals, count.size).reshape(count.shape)
    used = count > 1.0
    count, total = np.where(used, count, 0.0), np.where(used, total, 0.0)
    square = (total**2 / np.maximum(count, 1.0)).sum(axis=1)
    # What does not change along this direction is the other direction's concern.
    square -= total.sum(axis=1) ** 2 / np.maximum(count.sum(axis=1), 1.0)
    freedom = np.maximum(used.sum(axis=1) - 1.0, 0.0)
    square, freedom, count = square.sum(axis=2), freedom.sum(axis=2), count.sum(axis=(1, 3))
    cells = _asks(square, freedom, count, noise, tolerance).any(axis=1)
    sums = square.sum(axis=1), freedom.sum(axis=1), count.sum(axis=1)
    strips = _asks(*sums, noise, 0.5 * tolerance)
    marks = cells | strips
    square, freedom, count = (a.sum(keepdims=True) for a in sums)
    if not marks.any() and _asks(square, freedom, count, noise, 0.25 * tolerance)[0]:
        excess = sums[0] - sums[1] * noise**2
        marks = excess >= 0.5 * excess.max()
    return marks


def _cut(axis: Axis, x: NDArray[np.float64], parts: int) -> NDArray[np.int64]:
    """Return for each parameter the number of its part, every span cut in `parts`."""
    k = axis.span_of(x)
    part = ((x - axis.breaks[k]) / np.diff(axis.breaks)[k] * parts).astype(np.int64)
    return k * parts + np.clip(part, 0, parts - 1)


def _asks(
    square: NDArray[np.float64], freedom: NDArray[np.float64], count: NDArray[np.float64], noise: float, tolerance: float
) -> NDArray[np.bool_]:
    """Tell where Σ n · mean² is both significant (Bonferroni over the array) and large."""
    relative = square / noise**2 if noise**2 > 0.0 else np.where(square > 0.0, np.inf, 0.0)
    probability = chdtrc(np.maximum(freedom, 1.0), relative) * square.size
    bias = np.maximum(square - freedom * noise**2, 0.0) / np.maximum(count, 1.0)
    return (freedom > 0) & (probability < _SIGNIFICANCE) & (bias > tolerance**2)
