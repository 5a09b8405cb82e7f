"""Least-squares B-spline curves through ordered points, with corners, closed or open, and no more knots than needed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from scan2nurbs.edges.polyline import arc_length

_CORRECTIONS = 4
_POINTS_PER_SPAN = 4
_FAIRNESS = 1e-4


class SplineFit(NamedTuple):
    """A fitted curve over [0, end]; `points` in the order of the curve, from its seam on, and their distances from it."""

    spline: BSpline
    end: float
    points: NDArray[np.float64]
    corners: NDArray[np.float64]
    distance: NDArray[np.float64]


def fit_spline(points: NDArray[np.float64], corners: NDArray[np.float64], *, closed: bool, degree: int, tolerance: float) -> SplineFit:
    """Fit a B-spline curve by least squares with parameter correction.

    Parameters
    ----------
    points : (K, d) float64
        In order; the first is not repeated where closed.
    corners : (C,) float64
        Arc lengths along the polyline of the points at which the tangent may jump.
    closed : bool
        Whether the curve closes: smoothly without corners (a periodic spline), else in one of its corners.
    degree : int
    tolerance : float
        Spans whose points' root mean square distance exceeds it are halved while they hold enough points.

    Notes
    -----
    Knots of multiplicity `degree` make corners (The NURBS Book, section 2.5). The corrected parameter of a point is one
    Gauss-Newton step towards its foot point, eq. 6.8 there without the second derivative.
    """
    length = arc_length(points, closed=closed)
    end, parameter = float(length[-1]), length[: len(points)].copy()
    if closed and len(corners):
        # The seam goes into a corner, where the curve may break anyway.
        start = float(corners[0])
        parameter = np.mod(parameter - start, end)
        order = np.argsort(parameter, kind="stable")
        parameter, points = parameter[order], points[order]
        corners = np.r_[0.0, corners[1:] - start]
    periodic = closed and len(corners) == 0
    degree = min(degree, max(len(points) - 1, 1))
    breaks = np.linspace(0.0, end, 5 if periodic else 2)
    breaks = np.unique(np.r_[breaks, corners])
    while True:
        fit = _Fit(points, parameter.copy(), breaks, corners, degree, closed, periodic)
        distance = fit.solve()
        finer = _halve(breaks, fit.parameter, distance, tolerance)
        if len(finer) == len(breaks):
            return SplineFit(fit.spline, end, points, corners, distance)
        breaks = finer


def _halve(
    breaks: NDArray[np.float64], parameter: NDArray[np.float64], distance: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    span = np.clip(np.searchsorted(breaks, parameter, side="right") - 1, 0, len(breaks) - 2)
    count = np.bincount(span, minlength=len(breaks) - 1)
    square = np.bincount(span, distance**2, len(breaks) - 1) / np.maximum(count, 1)
    bad = (square > tolerance**2) & (count >= 2 * _POINTS_PER_SPAN)
    return np.sort(np.r_[breaks, 0.5 * (breaks[:-1] + breaks[1:])[bad]])


class _Fit:
    """One least-squares problem on fixed knots, solved again as the parameters move."""

    def __init__(
        self,
        points: NDArray[np.float64],
        parameter: NDArray[np.float64],
        breaks: NDArray[np.float64],
        corners: NDArray[np.float64],
        degree: int,
        closed: bool,
        periodic: bool,
    ) -> None:
        self.points, self.parameter, self.degree, self.closed, self.periodic = points, parameter, degree, closed, periodic
        self.end = float(breaks[-1])
        if periodic:
            before, after = breaks[-1 - degree : -1] - self.end, breaks[1 : degree + 1] + self.end
            # Few breaks go around more than once.
            while len(before) < degree:
                before = np.r_[before[: len(breaks) - 1] - self.end, before]
            while len(after) < degree:
                after = np.r_[after, after[1 - len(breaks) :] + self.end]
            self.knots = np.r_[before[-degree:], breaks, after[:degree]]
        else:
            inner = breaks[1:-1]
            self.knots = np.r_[
                np.full(degree + 1, breaks[0]),
                np.repeat(inner, np.where(np.isin(inner, corners), degree, 1)),
                np.full(degree + 1, breaks[-1]),
            ]
        n = len(self.knots) - degree - 1
        # Which free control point stands at each place: the last ones of a periodic curve are its first, and a curve that
        # closes in a corner ends where it began.
        self.free = np.arange(n) % (n - degree) if periodic else np.arange(n) % (n - 1) if closed else np.arange(n)
        self.merge = csc_array((np.ones(n), (np.arange(n), self.free)), shape=(n, int(self.free.max()) + 1))
        self.fairness = self._fairness() * (_FAIRNESS * len(points) / n)
        self.spline = BSpline(self.knots, np.zeros((n, points.shape[1])), degree)

    def solve(self) -> NDArray[np.float64]:
        """Alternate between control points and parameters; return the points' distances from the curve."""
        for _ in range(_CORRECTIONS):
            self._control_points()
            self._correct()
        self._control_points()
        return np.linalg.norm(self.points - self.spline(self.parameter), axis=1)

    def _control_points(self) -> None:
        basis = csc_array(BSpline.design_matrix(self.parameter, self.knots, self.degree) @ self.merge)
        coefficients = splu(csc_array(basis.T @ basis + self.fairness)).solve(basis.T @ self.points)
        self.spline = BSpline(self.knots, coefficients[self.free], self.degree)
        if self.periodic:
            self.spline.extrapolate = "periodic"  # type: ignore[assignment] - scipy's stubs know only the flag

    def _fairness(self) -> csc_array:
        """Penalise second differences of control points, except across corners; a trace of the first keeps empty spans solvable."""
        n = len(self.free)
        greville = np.array([self.knots[i + 1 : i + self.degree + 1].mean() for i in range(n)])
        rows, columns, values = [], [], []
        for i in range(1, n - 1):
            left, right = greville[i] - greville[i - 1], greville[i + 1] - greville[i]
            # A control point in a corner sits on `degree` equal knots.
            if self.degree > 1 and self.knots[i + 1] == self.knots[i + self.degree]:
                continue
            if not (left > 0.0 and right > 0.0):
                continue
            half = 0.5 * (left + right)
            rows += [i, i, i]
            columns += [i - 1, i, i + 1]
            values += [half / left, -half / left - half / right, half / right]
        second = csc_array((values, (rows, columns)), shape=(n, n)) @ self.merge
        first = csc_array((np.r_[np.ones(n - 1), -np.ones(n - 1)], (np.r_[0 : n - 1, 0 : n - 1], np.r_[0 : n - 1, 1:n])), shape=(n, n))
        first = first @ self.merge
        return csc_array(second.T @ second + 1e-6 * (first.T @ first))

    def _correct(self) -> None:
        """Move every parameter towards its foot point, staying within the curve and in the points' order."""
        tangent = self.spline.derivative()(self.parameter)
        square = np.maximum((tangent**2).sum(axis=1), np.finfo(np.float64).tiny)
        step = ((self.points - self.spline(self.parameter)) * tangent).sum(axis=1) / square
        gaps = np.diff(self.parameter)
        room = np.r_[gaps, gaps[-1]] if len(gaps) else np.zeros(1)
        moved = self.parameter + np.clip(step, -0.45 * np.r_[room[0], gaps] if len(gaps) else 0.0, 0.45 * room)
        if not self.closed:
            moved[0], moved[-1] = 0.0, self.end  # or else the ends would run on beyond their points
        self.parameter = np.clip(moved, 0.0, self.end if not self.periodic else np.nextafter(self.end, 0.0))
