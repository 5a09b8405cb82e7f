"""One parameter direction of a spline under construction: its knots, open or closed, and the integrals of its functions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.bspline import basis_range


@dataclass(frozen=True)
class Axis:
    """A space of univariate splines with simple inner knots.

    Attributes
    ----------
    degree : int
        Degree of the pieces; they join with degree − 1 continuous derivatives.
    breaks : (m + 1,) float64
        Ascending borders of the m spans.
    closed : bool
        Whether the last border is the first again (periodic splines).
    """

    degree: int
    breaks: NDArray[np.float64]
    closed: bool = False

    @property
    def n_spans(self) -> int:
        """Number of spans between the breaks."""
        return len(self.breaks) - 1

    @property
    def n(self) -> int:
        """Number of free coefficients."""
        return self.n_spans if self.closed else self.n_spans + self.degree

    @property
    def length(self) -> float:
        """Length of the domain."""
        return float(self.breaks[-1] - self.breaks[0])

    @cached_property
    def knots(self) -> NDArray[np.float64]:
        """Knots for the kernels: clamped where open, continued periodically where closed."""
        p, b = self.degree, self.breaks
        if not self.closed:
            return np.concatenate([np.full(p, b[0]), b, np.full(p, b[-1])])
        return np.concatenate([b[-1 - p : -1] - self.length, b, b[1 : p + 1] + self.length])

    @cached_property
    def clamped(self) -> NDArray[np.float64]:
        """The clamped knot vector that a CAD file stores."""
        return np.concatenate([np.full(self.degree, self.breaks[0]), self.breaks, np.full(self.degree, self.breaks[-1])])

    @cached_property
    def to_clamped(self) -> NDArray[np.float64]:
        """Matrix from the free coefficients to those over `clamped`, which span the same functions."""
        if not self.closed:
            return np.eye(self.n)
        greville = np.lib.stride_tricks.sliding_window_view(self.clamped[1:-1], self.degree).mean(axis=1)
        matrix = np.linalg.solve(_dense(self.clamped, self.degree, greville, len(greville)), self.at(greville))
        matrix[-1] = matrix[0]  # equal up to rounding; a seam must close exactly
        return matrix

    def at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the n functions at u, as a dense (len(u), n) matrix."""
        return _dense(self.knots, self.degree, u, self.n)

    def split(self, spans: NDArray[np.bool_]) -> Axis:
        """Return the axis with the marked spans halved."""
        middles = 0.5 * (self.breaks[:-1] + self.breaks[1:])[spans]
        return Axis(self.degree, np.sort(np.concatenate([self.breaks, middles])), self.closed)

    def without(self, k: int) -> Axis:
        """Return the axis without the inner break k."""
        return Axis(self.degree, np.delete(self.breaks, k), self.closed)

    @cached_property
    def fairness(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Integrals of products of derivatives of order 0, 1 and 2, as bands (n, 2 degree + 1).

        They are taken over the domain in units of the mean span, so that a penalty made of them has no unit. Degree 1 has no second
        derivative; second differences of its coefficients stand in.
        """
        p = self.degree
        x, weight = np.polynomial.legendre.leggauss(p + 1)
        h = np.diff(self.breaks)
        u = (self.breaks[:-1, None] + 0.5 * h[:, None] * (1 + x)).ravel()
        w = (0.5 * h[:, None] * weight).ravel()
        spans, table = basis_table(self.knots, p, u, 2)
        mean = self.length / self.n_spans
        bands = []
        for order in range(3):
            values = table[:, order] * mean**order
            band = np.zeros((self.n, 2 * p + 1))
            for a in range(p + 1):
                for b in range(p + 1):
                    np.add.at(band, ((spans - p + a) % self.n, p + b - a), w / mean * values[:, a] * values[:, b])
            bands.append(band)
        if p == 1:
            bands[2] = self._difference_band()
        return bands[0], bands[1], bands[2]

    def _difference_band(self) -> NDArray[np.float64]:
        n = self.n
        band = np.zeros((n, 3))
        # Only neighbours fit in the band of degree 1: a first difference, small, keeps empty places calm.
        rows = np.arange(n if self.closed else n - 1)
        for i, j, value in ((0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)):
            np.add.at(band, ((rows + i) % n, 1 + j - i), value)
        return band


def basis_table(knots: NDArray[np.float64], degree: int, u: NDArray[np.float64], order: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the span (N,) and the local functions with derivatives (N, order + 1, degree + 1) at parameters u."""
    spans = np.empty(len(u), np.int64)
    table = np.empty((len(u), order + 1, degree + 1))
    basis_range(knots, degree, np.ascontiguousarray(u, dtype=np.float64), order, 0, len(u), spans, table)
    return spans, table


def _dense(knots: NDArray[np.float64], degree: int, u: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    spans, table = basis_table(knots, degree, u, 0)
    out = np.zeros((len(u), n))
    for a in range(degree + 1):
        np.add.at(out, (np.arange(len(u)), (spans - degree + a) % n), table[:, 0, a])
    return out
