"""Fit a B-spline surface to scattered points by minimising point distances."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from scan2nurbs.errors import InputError, NoResultError, ParameterError
from scan2nurbs.kernels.bspline import MAX_DEGREE
from scan2nurbs.kernels.runner import Progress, thread_count
from scan2nurbs.ranges import require_float, require_int
from scan2nurbs.surfaces.adapt import State, Task, adapt, folds, settle
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.parametrize import parametrize

logger = logging.getLogger(__name__)

# So many points decide about parameters and knots; the final surface is fitted to all.
_SAMPLE = 120_000


@dataclass(frozen=True, kw_only=True)
class FitParams:
    """How a surface is fitted.

    Attributes
    ----------
    degree : int or (int, int)
        Degree in both directions, or in u and v; 1 to 15, default 3. Few points may lower it.
    tolerance : float, optional
        Largest systematic deviation (local mean of the residuals) that may stay, in the points' unit, > 0. Knots are inserted only
        where it asks. None: half the noise, at least 3 % of the spacing.
    noise : float, optional
        Standard deviation of the points along the normal, in their unit, ≥ 0. None: estimated from the residuals.
    smoothness : float
        Largest weight of the thin-plate fairness relative to the points in one span, > 0; no unit. The fit lowers it as far as fairness
        would be seen in the residuals, so that it is felt only where there are (nearly) no points.
    max_control_points : int
        Bound of the size of the net, ≥ 4.
    max_iterations : int
        Rounds of fitting and inserting knots, ≥ 1.
    robust : bool
        Whether outliers lose their weight.
    """

    degree: int | tuple[int, int] = 3
    tolerance: float | None = None
    noise: float | None = None
    smoothness: float = 1e-2
    max_control_points: int = 10_000
    max_iterations: int = 20
    robust: bool = True

    def __post_init__(self) -> None:
        for degree in self.degrees:
            _check("degree", degree, isinstance(degree, int | np.integer) and 1 <= degree <= MAX_DEGREE, f"an int in [1, {MAX_DEGREE}]")
        if self.tolerance is not None:
            require_float(self.tolerance, "tolerance", "fit_surface", 0)
        if self.noise is not None:
            require_float(self.noise, "noise", "fit_surface", 0, closed="low")
        require_float(self.smoothness, "smoothness", "fit_surface", 0)
        require_int(self.max_control_points, "max_control_points", "fit_surface", 4)
        require_int(self.max_iterations, "max_iterations", "fit_surface", 1)

    @property
    def degrees(self) -> tuple[int, int]:
        """Degrees in u and v."""
        if isinstance(self.degree, tuple):
            _check("degree", self.degree, len(self.degree) == 2, "an int or a pair of ints")
            return self.degree
        return (self.degree, self.degree)


def _check(name: str, value: object, valid: bool, what: str) -> None:
    if not valid:
        raise ParameterError(f"The '{name}' parameter of fit_surface must be {what}. Got {value!r} instead.")


@dataclass(frozen=True)
class SurfaceFit:
    """A fitted surface and how far it lies from the points.

    Attributes
    ----------
    surface : BSplineSurface
        The surface, parameters in [0, 1]².
    uv : (N, 2) float64
        Foot points of the points on the surface.
    residuals : (N,) float64
        Signed distances along the normal S_u × S_v, in the points' unit.
    weights : (N,) float64
        Robust weights in [0, 1]; 0 for outliers.
    tolerance, noise : float
        What the fit aimed at, and the noise given or found; in the points' unit.
    iterations : int
        Rounds of fitting.
    parametrization : str
        "plane", "geodesic" or "tube": how the first parameters were found.
    notes : tuple of str
        What the caller should know, one sentence each.
    """

    surface: BSplineSurface
    uv: NDArray[np.float64]
    residuals: NDArray[np.float64]
    weights: NDArray[np.float64]
    tolerance: float
    noise: float
    iterations: int
    parametrization: str
    notes: tuple[str, ...] = field(default=())

    @property
    def degrees(self) -> tuple[int, int]:
        """Degrees in u and v."""
        return self.surface.degrees

    @property
    def knots(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Clamped knot vectors in u and v."""
        return self.surface.knots

    @property
    def control_points(self) -> NDArray[np.float64]:
        """Control points (n_u, n_v, 3)."""
        return self.surface.control_points

    @property
    def inliers(self) -> NDArray[np.bool_]:
        """Points that count, (N,)."""
        return self.weights > 0

    @property
    def n_outliers(self) -> int:
        """Points that do not count."""
        return int(np.count_nonzero(~self.inliers))

    @property
    def n_control_points(self) -> int:
        """Size of the net."""
        return self.surface.weights.size

    @property
    def rms(self) -> float:
        """Root of the mean square of the residuals of the points that count."""
        return float(np.sqrt(np.mean(self.residuals[self.inliers] ** 2)))

    @property
    def p95(self) -> float:
        """The absolute residual that 95 % of the points that count do not exceed."""
        return float(np.quantile(np.abs(self.residuals[self.inliers]), 0.95))

    @property
    def max(self) -> float:
        """Largest absolute residual of the points that count."""
        return float(np.abs(self.residuals[self.inliers]).max())


def fit_surface(points: ArrayLike, params: FitParams | None = None, *, progress: Progress | None = None) -> SurfaceFit:
    """Fit a B-spline surface to the points of one face (section 2.3 of the paper: point-distance minimisation).

    Parameters
    ----------
    points : (N, 3) array-like
        Finite points of one sheet or one tube, in any unit, with noise and outliers; at least 6.
    params : FitParams, optional
        How to fit.
    progress : callable, optional
        Called with (round, most rounds) as the fit goes on.

    Returns
    -------
    SurfaceFit
        The surface with the fewest control points that the tolerance allows, and the residuals.

    Raises
    ------
    InputError
        If the points are no finite (N, 3) array.
    NoResultError
        If the points do not determine a surface, or are not one sheet or tube that a rectangle can be bent to without folds.

    Notes
    -----
    First parameters come from a plane where the points are a height field, else from an unrolling along geodesics, else from running
    around a tube. Then penalised least squares, robust weights and foot points alternate, and knots are inserted where the residuals
    are not noise. Time grows like N + (control points) · (the smaller side of the net)². Results do not depend on the number of threads.
    """
    params = params or FitParams()
    points = _as_points(points)
    low, high = points.min(axis=0), points.max(axis=0)
    origin, scale = 0.5 * (low + high), float((high - low).max())
    if not (np.isfinite(scale) and scale > 0):
        raise NoResultError("The points coincide; they do not determine a surface.")
    local = (points - origin) / scale
    sample = _sample(len(local))
    parameters = parametrize(local[sample])
    logger.info("parameters from the %s, %.3g x %.3g spacings", parameters.name, *(s / parameters.nodes.spacing for s in parameters.size))
    task = Task.make(local[sample], parameters, params, scale, len(local))
    state = adapt(task, progress)
    full = settle(task, state, local, _extend(local, sample, state))
    notes = (*parameters.notes, *full.notes, *folds(parameters, full.spline))
    return SurfaceFit(
        surface=full.spline.finish(scale, origin),
        uv=np.clip(full.uv / np.array(parameters.size), 0.0, 1.0),
        residuals=full.normal * scale,
        weights=full.weights,
        tolerance=full.tolerance * scale,
        noise=full.noise * scale,
        iterations=full.rounds,
        parametrization=parameters.name,
        notes=notes,
    )


def _as_points(points: ArrayLike) -> NDArray[np.float64]:
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"The points must be an (N, 3) array. Got the shape {points.shape} instead.")
    if not np.isfinite(points).all():
        raise InputError("The points must be finite.")
    if len(points) < 6:
        raise NoResultError(f"{len(points)} points do not determine a B-spline surface; at least 6 are needed.")
    return points


def _sample(n: int) -> NDArray[np.int64]:
    if n <= _SAMPLE:
        return np.arange(n)
    return np.sort(np.random.default_rng(0).choice(n, _SAMPLE, replace=False))


def _extend(points: NDArray[np.float64], sample: NDArray[np.int64], state: State) -> NDArray[np.float64]:
    """Return first parameters of all points: those of the nearest sampled point that counts."""
    if len(sample) == len(points):
        return state.uv
    counts = state.weights > 0
    nearest = KDTree(points[sample[counts]], balanced_tree=False, compact_nodes=False).query(points, workers=thread_count())[1]
    return state.uv[counts][nearest]
