"""B-spline curves in the plane and in space: what an edge is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Measure = Callable[[Floats, Floats], Floats]

_ROUNDS = 14
_FAIRNESS = 1e-9


@dataclass(frozen=True)
class Curve:
    """A polynomial B-spline curve (The NURBS Book, eq. 3.1).

    Attributes
    ----------
    degree : int
        Its degree p.
    knots : (n + p + 1,) float64
        Full clamped knot vector.
    control_points : (n, 2) or (n, 3) float64
        In the parameter space of a surface, or in space.
    """

    degree: int
    knots: Floats
    control_points: Floats

    @property
    def domain(self) -> tuple[float, float]:
        """The parameters at which the curve starts and ends."""
        return float(self.knots[0]), float(self.knots[-1])

    def __call__(self, parameters: Floats) -> Floats:
        """Return the (K, d) points at the (K,) parameters."""
        return BSpline(self.knots, self.control_points, self.degree, extrapolate=False)(np.clip(parameters, *self.domain))

    def samples(self, per_span: int) -> Floats:
        """Return parameters that divide every knot span evenly, the ends included."""
        distinct = np.unique(self.knots)
        steps = np.linspace(0.0, 1.0, per_span, endpoint=False)
        return np.append((distinct[:-1, None] + np.diff(distinct)[:, None] * steps).ravel(), distinct[-1])


def line(start: Floats, end: Floats, domain: tuple[float, float]) -> Curve:
    """Return the straight line between two points over the given parameters."""
    return Curve(1, np.repeat(np.asarray(domain, np.float64), 2), np.array([start, end], np.float64))


def fit_curve(points: Floats, parameters: Floats, *, tolerance: float, measure: Measure | None = None, closed: bool = False) -> Curve:
    """Fit a cubic B-spline curve with few knots through ordered points, ends met exactly.

    Parameters
    ----------
    points : (K, d) float64
        At least two; for a closed curve the last repeats the first.
    parameters : (K,) float64
        Strictly increasing.
    tolerance : float
        Largest distance, by `measure`, of a point from the curve at its parameter. Knots are added where it is exceeded; where that does
        not help, the curve passes through all points.
    measure : callable, optional
        Distance of (K, d) fitted points from the given ones; Euclidean by default.
    closed : bool
        Join the ends with a common tangent instead of meeting the first point.

    Notes
    -----
    Least squares with the end points held (The NURBS Book, section 9.4.1), spans beyond the tolerance halved until none is left.
    A trace of second differences keeps the system regular where a span holds few points.
    """
    measure = measure or (lambda fitted, given: np.linalg.norm(fitted - given, axis=1))
    low, high = parameters[0], parameters[-1]
    inner = np.linspace(low, high, 5)[1:-1] if closed else np.empty(0)
    curve = _least_squares(points, parameters, np.r_[[low] * 4, inner, [high] * 4], closed)
    for _ in range(_ROUNDS):
        distance = measure(curve(parameters), points)
        borders = np.concatenate([[low], inner, [high]])
        span = np.clip(np.searchsorted(borders, parameters, side="right") - 1, 0, len(borders) - 2)
        worst = np.zeros(len(borders) - 1)
        np.maximum.at(worst, span, distance)
        held = np.bincount(span, minlength=len(worst))
        split = np.flatnonzero((worst > tolerance) & (held >= 2))
        if not len(split):
            return curve if worst.max() <= tolerance else _interpolated(points, parameters)
        inner = np.sort(np.concatenate([inner, [np.median(parameters[span == k]) for k in split]]))
        curve = _least_squares(points, parameters, np.r_[[low] * 4, inner, [high] * 4], closed)
    return curve


def _interpolated(points: Floats, parameters: Floats) -> Curve:
    degree = min(3, len(points) - 1)
    spline = make_interp_spline(parameters, points, k=degree)
    return Curve(degree, spline.t, spline.c)


def _least_squares(points: Floats, parameters: Floats, knots: Floats, closed: bool) -> Curve:
    n = len(knots) - 4
    design = csc_array(BSpline.design_matrix(parameters, knots, 3))
    # All control points are a linear map of the free ones, plus the ends that are held.
    rows, columns, values = np.arange(1, n - 1), np.arange(n - 2), np.ones(n - 2)
    held = np.zeros((n, points.shape[1]))
    if closed:
        first, last = knots[4] - knots[3], knots[-4] - knots[-5]
        before, after = last / (first + last), first / (first + last)
        rows, columns = np.r_[rows, 0, 0, n - 1, n - 1], np.r_[columns, 0, n - 3, 0, n - 3]
        values = np.r_[values, before, after, before, after]
    else:
        held[0], held[-1] = points[0], points[-1]
    free = csc_array((values, (rows, columns)), shape=(n, n - 2))
    k = np.repeat(np.arange(n - 2), 3)
    bend = csc_array((np.tile([1.0, -2.0, 1.0], n - 2), (k, k + np.tile([0, 1, 2], n - 2))), shape=(n - 2, n))
    reduced, bent = design @ free, bend @ free
    normal = reduced.T @ reduced + _FAIRNESS * len(points) / n * (bent.T @ bent)
    right = reduced.T @ (points - design @ held) - _FAIRNESS * len(points) / n * (bent.T @ (bend @ held))
    solution = splu(csc_array(normal), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right)
    return Curve(3, knots, free @ solution + held)
