"""Penalised least squares over a grid of spline coefficients, solved as one banded system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.kernels.bspline import foot_points_range, normal_equations_range
from scan2nurbs.kernels.bspline_band import PADDING, factor_band, solve_band
from scan2nurbs.kernels.runner import run_ranges
from scan2nurbs.surfaces.axis import Axis
from scan2nurbs.surfaces.bspline import BSplineSurface, evaluate_spline

_PARTS = 16
_SMALLEST_PART = 4096
_FOOT_RANGE = 8192
_DECADES = 5
_CALM = 10.0


@dataclass(frozen=True)
class Spline:
    """A surface under construction: two axes, the free coefficients (n_u, n_v, 3), and by how many decades fairness was lowered."""

    u: Axis
    v: Axis
    control: NDArray[np.float64]
    decade: int = 0

    @property
    def reach(self) -> float:
        """The longest step a foot point may take at once: half the mean span."""
        return 0.5 * max(self.u.length / self.u.n_spans, self.v.length / self.v.n_spans)

    def derivatives(self, uv: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        """Return S and its derivatives at uv, (N, 1 | 3 | 6, 3)."""
        degrees = (self.u.degree, self.v.degree)
        return evaluate_spline((self.u.knots, self.v.knots), degrees, self.control, uv, order)

    def foot_points(
        self, points: NDArray[np.float64], uv: NDArray[np.float64], steps: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the foot points' parameters (N, 2), the distances along the normal (N,) and the whole distances (N,)."""
        uv = uv.copy()
        residuals = np.empty((len(points), 2))
        a, b = self.u, self.v

        def work(start: int, stop: int) -> None:
            foot_points_range(
                a.knots,
                b.knots,
                a.degree,
                b.degree,
                a.closed,
                b.closed,
                self.control,
                points,
                steps,
                self.reach,
                start,
                stop,
                uv,
                residuals,
            )

        run_ranges(work, len(points), size=_FOOT_RANGE)
        return uv, residuals[:, 0], residuals[:, 1]

    def finish(self, scale: float, origin: NDArray[np.float64]) -> BSplineSurface:
        """Return the surface with clamped knots from 0 to 1, scaled and moved back."""
        control = np.einsum("ai,ijc->ajc", self.u.to_clamped, self.control)
        control = np.einsum("bj,ajc->abc", self.v.to_clamped, control)
        knots = tuple((axis.clamped - axis.breaks[0]) / axis.length for axis in (self.u, self.v))
        for vector, axis in zip(knots, (self.u, self.v), strict=True):
            vector[-axis.degree - 1 :] = 1.0
        control = control * scale + origin
        return BSplineSurface(
            (self.u.degree, self.v.degree),
            (knots[0], knots[1]),
            np.ascontiguousarray(control),
            np.ones(control.shape[:2]),
            (self.u.closed, self.v.closed),
        )


def fit_spline(
    u: Axis,
    v: Axis,
    uv: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    smoothness: float,
    slack: float = 0.0,
    decade: int | None = None,
) -> Spline:
    """Minimise the weighted squared distance at fixed parameters plus a thin-plate fairness.

    Parameters
    ----------
    u, v : Axis
        The spline space.
    uv : (N, 2) float64
        Parameters of the points, inside the domain.
    points : (N, 3) float64
        Points.
    weights : (N,) float64
        Weights of the squared distances, ≥ 0, not all zero.
    smoothness : float
        Largest weight of the fairness, relative to the mean weight of the points in one span; it has no unit.
    slack : float
        By how much fairness may raise the sum of squares; its weight falls by up to five decades until it does not.
    decade : int, optional
        By how many decades it falls, where that is known.

    Raises
    ------
    NoResultError
        If the points do not determine a surface.
    """
    matrix, right = normal_equations(u, v, uv, points, weights)
    mean = weights.sum() / (u.n_spans * v.n_spans)
    fair = mean * fairness(u, v, np.ones((u.n_spans, v.n_spans)))
    calm = mean * fairness(u, v, _emptiness(u, v, uv, weights))

    def solve(decade: int) -> NDArray[np.float64]:
        fade = 10.0**-decade
        return solve_banded(u, v, matrix + smoothness * (fade * fair + _CALM * fade**0.7 * calm), right)

    if decade is not None:
        return Spline(u, v, solve(decade), decade)
    best, loose, firm = solve(_DECADES), 0, _DECADES
    closest = best
    # The weight that is accepted is found by bisection: the rise grows with it.
    while loose < firm:
        middle = (loose + firm) // 2
        control = solve(middle)
        if quadratic_form(u, v, matrix, control - closest) <= slack:
            best, firm = control, middle
        else:
            loose = middle + 1
    return Spline(u, v, best, firm)


def quadratic_form(u: Axis, v: Axis, matrix: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    """Return xᵀ A x of a banded tensor, summed over the coordinates."""
    (n_u, n_v), q, total = x.shape[:2], v.degree, 0.0
    for a in range(u.degree + 1):
        rows = np.arange(n_u if u.closed else max(n_u - a, 0))
        for b in range(-q if a else 0, q + 1):
            columns = np.arange(n_v) if v.closed else np.arange(max(0, -b), min(n_v, n_v - b))
            product = x[np.ix_(rows, columns)] * x[np.ix_((rows + a) % n_u, (columns + b) % n_v)]
            total += (2.0 if a or b else 1.0) * float(np.sum(product.sum(axis=2) * matrix[rows[:, None], columns[None, :], a, q + b]))
    return total


def normal_equations(
    u: Axis, v: Axis, uv: NDArray[np.float64], points: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return BᵀWB as a banded tensor (n_u, n_v, p + 1, 2 q + 1) and BᵀWX (n_u, n_v, 3); the same bits at any number of threads."""
    p, q = u.degree, v.degree
    size = max(_SMALLEST_PART, -(-len(points) // _PARTS))
    parts: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def work(start: int, stop: int) -> None:
        matrix, right = np.zeros((u.n, v.n, p + 1, 2 * q + 1)), np.zeros((u.n, v.n, 3))
        normal_equations_range(u.knots, v.knots, p, q, uv, points, weights, start, stop, matrix, right)
        parts[start] = matrix, right

    run_ranges(work, len(points), size=size)
    matrix, right = parts.pop(0)
    for start in sorted(parts):
        matrix += parts[start][0]
        right += parts[start][1]
    return matrix, right


def fairness(u: Axis, v: Axis, cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the thin-plate energy ∫ c (S_uu² + 2 S_uv² + S_vv²) as a banded tensor; parameters in mean spans, a weight c a cell."""
    p, q = u.degree, v.degree
    out = np.zeros((u.n, v.n, p + 1, 2 * q + 1))
    gu, gv = u.span_integrals, v.span_integrals
    for a in range(p + 1):
        for a2 in range(a, p + 1):
            for b in range(q + 1):
                for b2 in range(q + 1):
                    local = gu[:, (2, 1, 0), a, a2] * (1.0, 2.0, 1.0) @ gv[:, :, b, b2].T
                    np.add.at(out[:, :, a2 - a, q + b2 - b], np.ix_(u.span_functions[:, a], v.span_functions[:, b]), cells * local)
    return out


def _emptiness(u: Axis, v: Axis, uv: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each cell of the net how far it is from holding points, 0 where it holds a quarter of what is usual, 1 where none."""
    cell = u.span_of(uv[:, 0]) * v.n_spans + v.span_of(uv[:, 1])
    count = np.bincount(cell, weights, u.n_spans * v.n_spans).reshape(u.n_spans, v.n_spans)
    density = count / (np.diff(u.breaks)[:, None] * np.diff(v.breaks))
    usual = float(np.median(density[count > 0]))
    return np.maximum(1.0 - 4.0 * density / usual, 0.0)


def solve_banded(u: Axis, v: Axis, matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve a banded tensor's system by Cholesky and return the coefficients (n_u, n_v, 3).

    A closed direction is folded (0, n − 1, 1, n − 2, …), which turns the cyclic band into one of twice the width.
    """
    (n_u, n_v), p, q = right.shape[:2], u.degree, v.degree
    fold_u, fold_v = _fold(u), _fold(v)
    width_u, width_v = p * (2 if u.closed else 1), q * (2 if v.closed else 1)
    if width_u * n_v + width_v <= width_v * n_u + width_u:
        place = fold_u[:, None] * n_v + fold_v[None, :]
    else:
        place = fold_v[None, :] * n_u + fold_u[:, None]
    width = min(width_u * n_v + width_v, width_v * n_u + width_u, n_u * n_v - 1)
    band = np.zeros((n_u * n_v, width + 1 + PADDING))
    for a in range(p + 1):
        rows = np.arange(n_u if u.closed else max(n_u - a, 0))
        for b in range(-q if a else 0, q + 1):
            columns = np.arange(n_v) if v.closed else np.arange(max(0, -b), min(n_v, n_v - b))
            first = place[rows[:, None], columns[None, :]]
            second = place[(rows[:, None] + a) % n_u, (columns[None, :] + b) % n_v]
            np.add.at(band, (np.minimum(first, second), np.abs(first - second)), matrix[rows[:, None], columns[None, :], a, q + b])
    # A trace of the mean diagonal keeps a system without points in some corner solvable, far below what can be seen.
    band[:, 0] += 1e-13 * band[:, 0].mean()
    flat = np.empty((n_u * n_v, 3))
    flat[place.ravel()] = right.reshape(-1, 3)
    if factor_band(band) != 0:
        raise NoResultError("The points do not determine a surface: the least-squares system is singular.")
    solve_band(band, flat)
    if not np.isfinite(flat).all():
        raise NoResultError("The points do not determine a surface: the least-squares solution is not finite.")
    return np.ascontiguousarray(flat[place])


def _fold(axis: Axis) -> NDArray[np.int64]:
    """Return the place of each coefficient in the order of the solver."""
    k = np.arange(axis.n)
    if not axis.closed:
        return k
    return np.where(2 * k < axis.n, 2 * k, 2 * (axis.n - 1 - k) + 1)
