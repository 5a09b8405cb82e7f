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
        values = _dense(self.clamped, self.degree, greville, len(greville))
        matrix = np.asarray(np.linalg.solve(values, self.at(greville)), dtype=np.float64)
        matrix[-1] = matrix[0]  # equal up to rounding; a seam must close exactly
        return matrix

    def at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the n functions at u, as a dense (len(u), n) matrix."""
        return _dense(self.knots, self.degree, u, self.n)

    def split(self, spans: NDArray[np.bool_]) -> Axis:
        """Return the axis with the marked spans halved."""
        middles = 0.5 * (self.breaks[:-1] + self.breaks[1:])[spans]
        return Axis(self.degree, np.sort(np.concatenate([self.breaks, middles])), self.closed)

    @cached_property
    def span_integrals(self) -> NDArray[np.float64]:
        """Integrals over each span of products of its functions' derivatives of order 0, 1, 2: (m, 3, degree + 1, degree + 1).

        Lengths are measured in mean spans, so that a penalty made of them has no unit. Degree 1 has no second derivative; first
        differences of its coefficients, small, stand in.
        """
        p = self.degree
        x, weight = np.polynomial.legendre.leggauss(p + 1)
        h = np.diff(self.breaks)
        u = self.breaks[:-1, None] + 0.5 * h[:, None] * (1 + x)
        mean = self.length / self.n_spans
        table = basis_table(self.knots, p, u.ravel(), 2)[1].reshape(self.n_spans, p + 1, 3, p + 1) * mean ** np.arange(3.0)[:, None]
        integrals = np.einsum("mg,mgoa,mgob->moab", 0.5 * h[:, None] * weight / mean, table, table)
        if p == 1:
            integrals[:, 2] = 0.1 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return integrals

    @cached_property
    def span_functions(self) -> NDArray[np.int64]:
        """Numbers of the coefficients that act on each span, (m, degree + 1)."""
        return (np.arange(self.n_spans)[:, None] + np.arange(self.degree + 1)) % self.n

    def span_of(self, u: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the number of the span that holds each parameter."""
        return np.clip(np.searchsorted(self.breaks, u, side="right") - 1, 0, self.n_spans - 1)


def basis_table(
    knots: NDArray[np.float64], degree: int, u: NDArray[np.float64], order: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
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
