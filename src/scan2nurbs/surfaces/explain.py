"""Tell whether a surface explains points: whether its residuals are noise, or lie on one side over whole regions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from scan2nurbs.surfaces.shape import Floats

_SAMPLE = 3000
_BLOCK = 25  # points
_DEGREE = 3
_SYSTEMATIC = 0.5  # share of the noise that the systematic part of residuals may have
_SIGNIFICANT = 1e-4
_LARGEST_SHARE_OFF = 0.15
_STRAYS = 0.05


class Residuals(NamedTuple):
    """What residuals are made of.

    Attributes
    ----------
    systematic : float
        Root mean square of their smooth part, beyond what noise would give; in the noise's unit.
    chance : float
        Probability that noise has a smooth part as large.
    noise : float
        Standard deviation of the rest.
    off : float
        Share of points that lie farther off than five times the noise given.
    """

    systematic: float
    chance: float
    noise: float
    off: float

    def explained(self, noise: float) -> bool:
        """Tell whether the surface explains the points well enough."""
        smooth = self.systematic <= _SYSTEMATIC * noise or self.chance > _SIGNIFICANT
        return smooth and self.off <= _LARGEST_SHARE_OFF

    def nothing_left(self) -> bool:
        """Tell whether nothing but noise is left, so that no other surface can be better."""
        return self.chance > 0.01 and self.off <= 0.05


def study(feet: Floats, residuals: Floats, noise: float) -> Residuals:
    """Take residuals apart in a smooth part and noise.

    Parameters
    ----------
    feet : (N, 3) float64
        Feet of the points on the surface: the points themselves would tell their own distances.
    residuals : (N,) float64
        Signed distances of the points.
    noise : float
        Their standard deviation, > 0.

    Notes
    -----
    The smooth part is the larger of two: the projection onto polynomials of degree three in space, which sees what bends over the whole
    face, and the means of blocks of some 25 points, which see what is local. For noise, their sums of squares over its variance are χ².
    """
    stride = -(-len(feet) // _SAMPLE)
    p, d = feet[::stride], residuals[::stride]
    on = np.abs(d) <= 5.0 * noise
    off = 1.0 - float(np.mean(on))
    p, d = p[on], d[on]
    if len(d) < 8:
        return Residuals(0.0, 1.0, noise, off)
    found = [_polynomials(p, d), _blocks(p, d)]
    rest = float(np.sqrt(min(max(float(d @ d) - square, 0.0) / max(len(d) - rank, 1) for square, rank in found)))
    sigma = max(noise, rest)
    excess = [max(square / sigma**2 - rank, 0.0) / len(d) for square, rank in found]
    chance = min(float(chdtrc(rank, square / sigma**2)) for square, rank in found)
    return Residuals(float(np.sqrt(max(excess))) * sigma, chance, rest, off)


def lies_within(feet: Floats, residuals: Floats, noise: float, tolerance: float) -> bool:
    """Tell whether a surface lies within a tolerance of points besides their noise, but for a few strays.

    Parameters
    ----------
    feet, residuals, noise
        See `study`.
    tolerance : float
        Largest mean of the residuals of a block of some 25 points, beyond what noise would give, > 0.
    """
    stride = -(-len(feet) // _SAMPLE)
    p, d = feet[::stride], residuals[::stride]
    on = np.abs(d) <= tolerance + 5.0 * noise
    if np.mean(on) < 1.0 - _STRAYS:
        return False
    p, d = p[on], d[on]
    groups = _groups(p)
    sizes, means = np.array([len(g) for g in groups]), np.array([d[g].mean() for g in groups])
    rest = float(np.sqrt(max(float(d @ d - sizes @ means**2), 0.0) / max(len(d) - len(groups), 1)))
    return bool((np.abs(means) <= tolerance + 3.0 * max(noise, rest) / np.sqrt(sizes)).all())


def _polynomials(points: Floats, d: Floats) -> tuple[float, int]:
    """Return the sum of squares that polynomials explain, and their number."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1]
    x = offset @ axes
    reach = np.abs(x).max(axis=0)
    x = x / np.maximum(reach, 1e-6 * reach.max())  # each by its own: bends across a narrow strip count as much
    powers = [x[:, 0] ** i * x[:, 1] ** j * x[:, 2] ** k for i in range(4) for j in range(4) for k in range(4) if i + j + k <= _DEGREE]
    if len(d) < 3 * len(powers):
        powers = [p for p, n in zip(powers, _degrees(), strict=True) if n <= (2 if len(d) >= 30 else 1)]
    a = np.stack(powers, axis=1)
    value, vector = np.linalg.eigh(a.T @ a)  # squares of the singular values of `a`, a hundred times as fast
    kept = value > 1e-6 * value[-1]
    part = vector[:, kept].T @ (a.T @ d)
    return float(np.sum(part**2 / value[kept])), int(kept.sum())


def _degrees() -> list[int]:
    return [i + j + k for i in range(4) for j in range(4) for k in range(4) if i + j + k <= _DEGREE]


def _blocks(points: Floats, d: Floats) -> tuple[float, int]:
    """Return the sum of squares of the means of blocks, and their number."""
    groups = _groups(points)
    return float(sum(d[g].sum() ** 2 / len(g) for g in groups)), len(groups)


def _groups(points: Floats) -> list[NDArray[np.int64]]:
    groups: list[NDArray[np.int64]] = [np.arange(len(points), dtype=np.int64)]
    while len(groups[0]) > 2 * _BLOCK:
        groups = [half for g in groups for half in _halves(points, g)]
    return groups


def _halves(points: Floats, group: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    here = points[group]
    order = group[np.argsort(here[:, np.argmax(np.ptp(here, axis=0))], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]
