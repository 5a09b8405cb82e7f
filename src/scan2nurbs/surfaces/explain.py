"""Tell whether a surface explains points: whether its residuals are noise, or lie on one side over whole regions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from scan2nurbs.surfaces.shape import Floats

_SAMPLE = 3000
_BLOCK = 25  # points
_DEGREE = 3
_SYSTEMATIC = 0.5  # share of the noise that the systematic part of residuals may have
_SIGNIFICANT = 1e-4
_LARGEST_SHARE_OFF = 0.15


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


def study(points: Floats, residuals: Floats, noise: float) -> Residuals:
    """Take residuals apart in a smooth part and noise.

    Parameters
    ----------
    points : (N, 3) float64
    residuals : (N,) float64
        Signed distances of the points.
    noise : float
        Their standard deviation, > 0.

    Notes
    -----
    The smooth part is the larger of two: the projection onto polynomials of degree three in space, which sees what bends over the whole face,
    and the means of blocks of some 25 points, which see what is local (sums of squares, χ² with as many degrees of freedom for noise).
    """
    stride = -(-len(points) // _SAMPLE)
    p, d = points[::stride], residuals[::stride]
    on = np.abs(d) <= 5.0 * noise
    off = 1.0 - float(np.mean(on))
    p, d = p[on], d[on]
    if len(d) < 8:
        return Residuals(0.0, 1.0, noise, off)
    found = [_polynomials(p, d), _blocks(p, d)]
    rest = float(np.sqrt(max(float(d @ d) - found[0][0], 0.0) / max(len(d) - found[0][1], 1)))
    sigma = max(noise, rest)
    excess = [max(square / sigma**2 - rank, 0.0) / len(d) for square, rank in found]
    chance = min(float(chi2.sf(square / sigma**2, rank)) for square, rank in found)
    return Residuals(float(np.sqrt(max(excess))) * sigma, chance, rest, off)


def _polynomials(points: Floats, d: Floats) -> tuple[float, int]:
    """Return the sum of squares that polynomials explain, and their number."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1]
    x = offset @ axes
    # Thickness is noise, not a coordinate: a patch that is thin stays so when scaled.
    x = x / np.abs(x).max()
    powers = [x[:, 0] ** i * x[:, 1] ** j * x[:, 2] ** k for i in range(4) for j in range(4) for k in range(4) if i + j + k <= _DEGREE]
    if len(d) < 3 * len(powers):
        powers = [p for p, n in zip(powers, _degrees(), strict=True) if n <= (2 if len(d) >= 30 else 1)]
    q, s, _ = np.linalg.svd(np.stack(powers, axis=1), full_matrices=False)
    q = q[:, s > 1e-3 * s[0]]
    part = q.T @ d
    return float(part @ part), q.shape[1]


def _degrees() -> list[int]:
    return [i + j + k for i in range(4) for j in range(4) for k in range(4) if i + j + k <= _DEGREE]


def _blocks(points: Floats, d: Floats) -> tuple[float, int]:
    """Return the sum of squares of the means of blocks, and their number."""
    groups = [np.arange(len(d))]
    while len(groups[0]) > 2 * _BLOCK:
        groups = [half for g in groups for half in _halves(points, g)]
    return float(sum(d[g].sum() ** 2 / len(g) for g in groups)), len(groups)


def _halves(points: Floats, group: Floats) -> tuple[Floats, Floats]:
    here = points[group]
    order = group[np.argsort(here[:, np.argmax(np.ptp(here, axis=0))], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]
