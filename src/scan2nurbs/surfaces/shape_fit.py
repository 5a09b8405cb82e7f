"""Fit a primitive to the points of a face, and choose the simplest that explains them at their noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.surfaces.shape import KINDS, Floats, Kind, Shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, pose, lengths, recentred, scaled, uncertainty
from scan2nurbs.surfaces.shape_solve import TUKEY, Solution, accumulate, distances, improve
from scan2nurbs.surfaces.shape_start import starting_values
from scan2nurbs.surfaces.torus_start import tube_torus

_SAMPLE = 600
# Mean absolute distance, in standard deviations, under which a start is good enough: 0.8 is that of Gaussian noise.
_EXPLAINED = 0.9
# A fit has settled when a step would lower χ² by no more: steps of a few hundredths of a standard deviation are left.
_SETTLED = 1e-3


@dataclass(frozen=True)
class ShapeFit:
    """A fitted shape and how well it is known.

    Attributes
    ----------
    shape : Shape
    n_points : int
        Points that it was fitted to.
    rms : float
        Root mean square of the distances of the points within 4.7 standard deviations; in the points' unit.
    covariance : (freedom, freedom) float64 or None
        Of the parameters in the order that `shape_parameters` documents, at the noise given; None for splines.
    criterion : float
        Σ ρ(d/σ) + freedom · log n, lower is better; what `choose_shape` compares.
    notes : tuple of str
        What the caller should know, one sentence each.
    """

    shape: Shape
    n_points: int
    rms: float
    covariance: Floats | None
    criterion: float
    notes: tuple[str, ...] = ()

    @property
    def uncertainty(self) -> dict[str, float]:
        """Standard deviations by name; see `shape_parameters.uncertainty`."""
        return uncertainty(self.shape, self.covariance)


def fit_shape(
    kind: Kind,
    points: ArrayLike,
    *,
    noise: float,
    normals: Floats | None = None,
    start: Shape | None = None,
    weights: Floats | None = None,
) -> ShapeFit:
    """Fit a primitive by robust orthogonal-distance least squares: maximum likelihood under Gaussian noise, and blind to outliers.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    points : (N, 3) array-like
        Finite points of one face.
    noise : float
        Standard deviation of the points across the surface, in their unit, ≥ 0.
    normals : (N, 3) float64, optional
        Unit normals of either sign, NaN where unknown; they serve to start from only.
    start : Shape, optional
        A shape of this kind to start from instead.
    weights : (N,) float64, optional
        Weights ≥ 0 of the points.

    Raises
    ------
    NoResultError
        If the points do not determine such a shape; the sentence says why.
    """
    points, weights = _checked(points, weights, noise)
    if kind not in COLUMNS:
        raise ParameterError(f"The 'kind' parameter of fit_shape must be one of {', '.join(COLUMNS)}. Got {kind!r} instead.")
    freedom = len(COLUMNS[kind])
    if len(points) < freedom:
        raise NoResultError(f"{len(points)} points do not determine a {kind}: it takes {freedom} at least.")
    middle, extent = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    if not extent > 0.0:
        raise NoResultError(f"The points coincide; they do not determine a {kind}.")
    local = np.ascontiguousarray((points - middle) / extent)
    sigma = max(noise / extent, 1e-9)
    begin = scaled(start, -middle, 1.0 / extent) if start is not None else None  # type: ignore[arg-type]
    solution = _solve(kind, local, sigma, normals, begin, weights)
    _require_determined(solution, local, sigma)
    shape = solution.shape
    size = np.where(lengths(kind), extent, 1.0)
    covariance = sigma**2 * np.linalg.inv(solution.information) * np.outer(size, size)
    d = distances(shape, local)
    inside = np.maximum(1.0 - (d / (TUKEY * sigma)) ** 2, 0.0)
    rho = TUKEY**2 / 3.0 * (1.0 - inside**3)
    on = weights * (np.abs(d) <= TUKEY * max(sigma, 1.4826 * float(np.median(np.abs(d)))))
    return ShapeFit(
        shape=scaled(shape, np.zeros(3), extent, middle),
        n_points=len(points),
        rms=float(np.sqrt((on @ d**2) / max(on.sum(), 1e-300))) * extent,
        covariance=covariance,
        criterion=float(weights @ rho) + freedom * float(np.log(len(points))),
    )


def choose_shape(points: ArrayLike, *, noise: float, kinds: Sequence[Kind] = KINDS, normals: Floats | None = None) -> ShapeFit:
    """Fit every kind of shape and return the one that explains the points best at their noise, counting parameters.

    Parameters
    ----------
    points, noise, normals
        See `fit_shape`.
    kinds : sequence of str
        What to choose from.

    Raises
    ------
    NoResultError
        If no kind can be fitted.
    """
    best: ShapeFit | None = None
    for kind in (k for k in KINDS if k in kinds and k in COLUMNS):
        try:
            fit = fit_shape(kind, points, noise=noise, normals=normals)
        except NoResultError:
            continue
        if best is None or fit.criterion < best.criterion:
            best = fit
    if best is None:
        raise NoResultError("The points determine no shape.")
    return best


def _checked(points: ArrayLike, weights: Floats | None, noise: float) -> tuple[Floats, Floats]:
    p = np.ascontiguousarray(points, np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or not np.isfinite(p).all():
        raise ParameterError("The 'points' of a shape must be a finite (N, 3) array.")
    if not 0.0 <= noise < np.inf:
        raise ParameterError(f"The 'noise' parameter of fit_shape must be a float in [0, inf). Got {noise!r} instead.")
    w = np.ones(len(p)) if weights is None else np.ascontiguousarray(weights, np.float64)
    if w.shape != (len(p),):
        raise ParameterError(f"The 'weights' parameter of fit_shape must be an array of {len(p)} floats. Got the shape {w.shape} instead.")
    return p, w


def _solve(kind: Kind, points: Floats, sigma: float, normals: Floats | None, start: Primitive | None, weights: Floats) -> Solution:
    """Start from a sample, then anneal Tukey's cut over all points."""
    sample = np.arange(0, len(points), -(-len(points) // _SAMPLE))
    few, light = np.ascontiguousarray(points[sample]), np.ascontiguousarray(weights[sample])
    middle = np.zeros(3)
    shape, best = start, np.inf
    for k, group in enumerate([] if start is not None else _starts(kind, points, sample, normals, sigma)):
        for begin in group:
            near = recentred(begin, middle)
            tried = improve(near, few, light, _cut(near, few, sigma, 9.0), 15, 0.1 * sigma**2)
            cost = float(light @ np.minimum(np.abs(distances(tried, few)) / sigma, TUKEY)) / max(light.sum(), 1e-300)
            if cost < best:
                best, shape = cost, tried
        # Narrow pieces of a torus look like many a shape.
        if best < _EXPLAINED and (kind != "torus" or k > 0):
            break
    if shape is None:
        raise NoResultError(f"The points suggest no {kind} to start from.")
    shape = recentred(improve(shape, few, light, _cut(shape, few, sigma, 9.0), 20, 0.1 * sigma**2), middle)
    cut = np.inf
    for _ in range(4):
        # The sample took the fit to where a few steps over all points end it.
        before, cut = cut, _cut(shape, points, sigma, TUKEY)
        if cut > 0.999 * before:
            break
        shape = recentred(improve(shape, points, weights, cut, 30, _SETTLED * sigma**2), middle)
    return accumulate(shape, points, weights, min(cut, before))


def _starts(kind: Kind, points: Floats, sample: NDArray[np.int64], normals: Floats | None, sigma: float) -> Iterator[Sequence[Primitive]]:
    yield from starting_values(kind, points, sample, normals)
    if kind == "torus":
        yield [t for t in (tube_torus(points, sigma, share) for share in (0.1, 0.03)) if t is not None]


def _cut(shape: Primitive, points: Floats, sigma: float, factor: float) -> float:
    return factor * max(sigma, 1.4826 * float(np.median(np.abs(distances(shape, points)))))


def _require_determined(solution: Solution, points: Floats, sigma: float) -> None:
    """Raise where the parameters are not determined by the points at their noise."""
    shape, kind = solution.shape, solution.shape.kind
    scale = np.sqrt(np.maximum(np.diag(solution.information), 1e-300))
    values = np.linalg.eigvalsh(solution.information / np.outer(scale, scale))
    if not (np.isfinite(values).all() and values[0] > 1e-13 * values[-1]):
        raise NoResultError(f"The points do not determine a {kind}: its parameters depend on each other.")
    known = uncertainty(shape, sigma**2 * np.linalg.inv(solution.information))
    _, _, a, b = pose(shape)
    # A radius that may as well be infinite, by three standard deviations of the curvature.
    curved = {"cylinder": "a plane", "sphere": "a plane", "cone": "a plane"}
    if kind in curved and known["radius"] * 3.0 > a:
        raise NoResultError(f"The points do not determine a {kind}: {curved[kind]} explains them within their noise.")
    if kind == "cone" and np.degrees(b) < 3.0 * known["half_angle"]:
        raise NoResultError("The points do not determine a cone: a cylinder explains them within their noise.")
    if kind == "cone" and 90.0 - np.degrees(b) < 3.0 * known["half_angle"]:
        raise NoResultError("The points do not determine a cone: a plane explains them within their noise.")
    if kind == "torus" and known["minor"] * 3.0 > b:
        raise NoResultError("The points do not determine a torus: its tube's radius may be infinite within their noise.")
    if kind == "torus" and known["major"] * 3.0 > a:
        simpler = "a sphere" if a < b else "a cylinder"
        raise NoResultError(f"The points do not determine a torus: {simpler} explains them within their noise.")
