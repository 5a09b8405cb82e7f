"""The tensor-product B-spline surface: what a fit makes and what a CAD file stores."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline

from scan2nurbs.errors import ParameterError
from scan2nurbs.kernels.bspline import MAX_DEGREE, evaluate_range
from scan2nurbs.kernels.runner import run_ranges
from scan2nurbs.surfaces.shape import cross

_RANGE = 16384


@dataclass(frozen=True)
class BSplineSurface:
    """A (rational) B-spline surface S(u, v) (The NURBS Book, eq. 4.15).

    Attributes
    ----------
    degrees : (int, int)
        p and q, the degrees in u and v; 1 to 15.
    knots : (array, array)
        Full clamped knot vectors in u and v, end knots repeated degree + 1 times; float64.
    control_points : (n_u, n_v, 3) float64
        In the frame and unit of the points that were fitted.
    weights : (n_u, n_v) float64
        All ones for a polynomial surface.
    closed : (bool, bool)
        Whether the surface closes on itself in u or v (a tube), smoothly.

    Raises
    ------
    ParameterError
        If shapes, degrees, knots and weights do not belong together.
    """

    degrees: tuple[int, int]
    knots: tuple[NDArray[np.float64], NDArray[np.float64]]
    control_points: NDArray[np.float64]
    weights: NDArray[np.float64]
    closed: tuple[bool, bool] = (False, False)

    def __post_init__(self) -> None:
        if self.control_points.ndim != 3 or self.control_points.shape[2] != 3:
            raise ParameterError(f"The control points must be an (n_u, n_v, 3) array. Got the shape {self.control_points.shape} instead.")
        if self.weights.shape != self.control_points.shape[:2]:
            raise ParameterError(f"The weights must have the shape {self.control_points.shape[:2]}. Got {self.weights.shape} instead.")
        if not (np.isfinite(self.control_points).all() and np.isfinite(self.weights).all() and (self.weights > 0).all()):
            raise ParameterError("Control points must be finite, weights finite and positive.")
        for name, degree, knots, n in zip("uv", self.degrees, self.knots, self.weights.shape, strict=True):
            _check_knots(name, degree, knots, n)

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """First and last parameter in u and in v."""
        (u, v) = self.knots
        return (float(u[0]), float(u[-1])), (float(v[0]), float(v[-1]))

    @cached_property
    def spans(self) -> tuple[int, int]:
        """How many polynomial pieces there are in u and in v."""
        u, v = (len(np.unique(k)) - 1 for k in self.knots)
        return u, v

    def evaluate(self, uv: ArrayLike) -> NDArray[np.float64]:
        """Return the points S(u, v), (N, 3), at parameters (N, 2) inside the domain."""
        return self._derivatives(uv, 0)[:, 0]

    def derivatives(self, uv: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Return S, Su, Sv and, for order 2, Suu, Suv, Svv at parameters (N, 2), as an (N, 3 or 6, 3) array."""
        if order not in (1, 2):
            raise ParameterError(f"The 'order' of derivatives must be 1 or 2. Got {order!r} instead.")
        return self._derivatives(uv, order)

    def normals(self, uv: ArrayLike) -> NDArray[np.float64]:
        """Return the unit normals Su × Sv, (N, 3), at parameters (N, 2); NaN where the surface is degenerate."""
        d = self._derivatives(uv, 1)
        normals = cross(d[:, 1], d[:, 2])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.full_like(normals, np.nan), where=length > 0)

    def turned_over(self) -> BSplineSurface:
        """Return the surface with u running backward, so that its normals point to the other side."""
        (u, v), (low, high) = self.knots, self.domain[0]
        return replace(
            self,
            knots=(np.ascontiguousarray(low + high - u[::-1]), v),
            control_points=np.ascontiguousarray(self.control_points[::-1]),
            weights=np.ascontiguousarray(self.weights[::-1]),
        )

    def _derivatives(self, uv: ArrayLike, order: int) -> NDArray[np.float64]:
        uv = np.ascontiguousarray(uv, dtype=np.float64)
        if uv.ndim != 2 or uv.shape[1] != 2:
            raise ParameterError(f"The parameters must be an (N, 2) array. Got the shape {uv.shape} instead.")
        for name, column, (low, high) in zip("uv", uv.T, self.domain, strict=True):
            if not (np.isfinite(column).all() and (column >= low).all() and (column <= high).all()):
                raise ParameterError(f"The parameters {name} must lie in [{low}, {high}].")
        out = evaluate_spline(self.knots, self.degrees, self._homogeneous, uv, order)
        return _project(out) if out.shape[2] == 4 else out

    @cached_property
    def _homogeneous(self) -> NDArray[np.float64]:
        """The control points, with their weights (n_u, n_v, 4) where these differ."""
        if not (self.weights != self.weights[0, 0]).any():
            return np.ascontiguousarray(self.control_points, dtype=np.float64)
        w = self.weights[..., None]
        return np.ascontiguousarray(np.concatenate([self.control_points * w, w], axis=2))


def bicubic(
    axes: tuple[NDArray[np.float64], NDArray[np.float64]], grid: NDArray[np.float64], closed: tuple[bool, bool] = (False, False)
) -> BSplineSurface:
    """Return the bicubic surface through a grid of points.

    Parameters
    ----------
    axes : ((n_u,) float64, (n_v,) float64)
        Rising parameters of the grid's rows and columns, at least four each.
    grid : (n_u, n_v, 3) float64
    closed : (bool, bool)
        What the surface says of itself; the grid's first and last rows or columns must agree then.
    """
    first = make_interp_spline(axes[0], grid, k=3)
    second = make_interp_spline(axes[1], np.moveaxis(np.asarray(first.c), 1, 0), k=3)
    control = np.ascontiguousarray(np.moveaxis(np.asarray(second.c), 0, 1))
    return BSplineSurface((3, 3), (first.t, second.t), control, np.ones(control.shape[:2]), closed)


def evaluate_spline(
    knots: tuple[NDArray[np.float64], NDArray[np.float64]],
    degrees: tuple[int, int],
    control: NDArray[np.float64],
    uv: NDArray[np.float64],
    order: int,
) -> NDArray[np.float64]:
    """Return S and its derivatives up to `order`, (N, 1 | 3 | 6, dimension), without checking anything."""
    out = np.empty((len(uv), (1, 3, 6)[order], control.shape[2]))

    def work(start: int, stop: int) -> None:
        evaluate_range(knots[0], knots[1], degrees[0], degrees[1], control, uv, order, start, stop, out)

    run_ranges(work, len(uv), size=_RANGE)
    return out


def _project(d: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide homogeneous derivatives by the weight (The NURBS Book, eq. 4.20)."""
    a, w = d[..., :3], d[..., 3:]
    out = np.empty_like(a)
    out[:, 0] = a[:, 0] / w[:, 0]
    for k in range(1, min(a.shape[1], 3)):
        out[:, k] = (a[:, k] - w[:, k] * out[:, 0]) / w[:, 0]
    if a.shape[1] == 6:
        for k, i, j in ((3, 1, 1), (4, 1, 2), (5, 2, 2)):
            out[:, k] = (a[:, k] - w[:, i] * out[:, j] - w[:, j] * out[:, i] - w[:, k] * out[:, 0]) / w[:, 0]
    return out


def _check_knots(name: str, degree: int, knots: NDArray[np.float64], n: int) -> None:
    if not 1 <= degree <= MAX_DEGREE:
        raise ParameterError(f"The degree in {name} must be an int in [1, {MAX_DEGREE}]. Got {degree!r} instead.")
    if n < degree + 1:
        raise ParameterError(f"A degree of {degree} needs at least {degree + 1} control points in {name}. Got {n} instead.")
    if knots.shape != (n + degree + 1,):
        raise ParameterError(f"{n} control points of degree {degree} need {n + degree + 1} knots in {name}. Got {knots.shape} instead.")
    clamped = (knots[: degree + 1] == knots[0]).all() and (knots[-degree - 1 :] == knots[-1]).all()
    if not (np.isfinite(knots).all() and (np.diff(knots) >= 0).all() and clamped and knots[-1] > knots[0]):
        raise ParameterError(f"The knots in {name} must be finite, ascending and clamped at both ends.")
