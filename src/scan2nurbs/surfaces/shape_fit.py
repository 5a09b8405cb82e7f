"""Fit a shape to the points of a face, and choose the simplest that explains them at their noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from scan2nurbs.errors import InputError, NoResultError, ParameterError
from scan2nurbs.surfaces.explain import Residuals, study
from scan2nurbs.surfaces.fit import FitParams, fit_surface
from scan2nurbs.surfaces.interior import interior
from scan2nurbs.surfaces.primitive_fit import criterion, fit_primitive, weighted_rms
from scan2nurbs.surfaces.shape import KINDS, Floats, Kind, Shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS
from scan2nurbs.surfaces.shape_result import ShapeFit
from scan2nurbs.surfaces.shape_solve import TUKEY
from scan2nurbs.surfaces.spline_shape import SplineShape
from scan2nurbs.surfaces.swept_fit import fit_extrusion, fit_revolution

__all__ = ["PRIMITIVES", "ShapeFit", "choose_shape", "fit_shape", "judge"]

# Parameters that a sphere pays more than it has. It is rarer than cylinders and cones, which have more: a chamfer or a fillet that is too
# narrow to tell is no zone of a sphere; a compact patch may be.
_SPHERE = {True: 1, False: 2}
_HOLLOW, _NARROW = 0.03, 0.5
_MANY = 500
PRIMITIVES: tuple[Kind, ...] = ("plane", "cylinder", "cone", "sphere", "torus")
"""The plainest first."""
_OTHERS: tuple[Kind, ...] = ("extrusion", "revolution", "bspline")
_ROUGHEST = 1.5


def fit_shape(
    kind: Kind,
    points: ArrayLike,
    *,
    noise: float,
    normals: Floats | None = None,
    start: Shape | None = None,
    weights: Floats | None = None,
    tolerance: float | None = None,
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
    tolerance : float, optional
        How far a B-spline surface may lie from the points besides their noise; from the noise unless given.

    Raises
    ------
    NoResultError
        If the points do not determine such a shape; the sentence says why.
    """
    p, w = _checked(points, weights, noise)
    if kind in COLUMNS:
        return fit_primitive(kind, p, noise=noise, normals=normals, start=start, weights=w)  # type: ignore[arg-type] - by kind
    if kind in ("extrusion", "revolution"):
        shape = (fit_extrusion if kind == "extrusion" else fit_revolution)(p, noise, normals)
        return _of_swept(shape, p, noise, w)
    if kind == "bspline":
        return _fit_spline(p, noise, w, tolerance)
    raise ParameterError(f"The 'kind' parameter of fit_shape must be one of {', '.join(KINDS)}. Got {kind!r} instead.")


def choose_shape(points: ArrayLike, *, noise: float, kinds: Sequence[Kind] = KINDS, normals: Floats | None = None) -> ShapeFit:
    """Fit shapes of rising freedom; return the simplest that explains the points at their noise.

    Parameters
    ----------
    points, noise, normals
        See `fit_shape`.
    kinds : sequence of str
        What to choose from.

    Returns
    -------
    ShapeFit
        Of the primitives that with the lowest criterion, if it leaves residuals that are noise (see `explain.study`); else the first of
        the other kinds that does; else the fit with the lowest criterion, with a note.

    Raises
    ------
    NoResultError
        If no kind can be fitted.

    Notes
    -----
    Where the face is wide enough, points along its border do not decide: they may belong to the neighbours. A primitive is fitted to them
    too if it leaves nothing but noise there.
    """
    everything, _ = _checked(points, None, noise)
    inside = interior(everything)
    p, w = np.ascontiguousarray(everything[inside]), np.ones(int(inside.sum()))
    normals = None if normals is None else normals[inside]
    fits: list[tuple[ShapeFit, Residuals]] = []
    for kind in PRIMITIVES:
        if kind not in kinds:
            continue
        found = _try(kind, p, noise, normals)
        if found is not None:
            fits.append(found)
            # Few points cannot show that nothing is left.
            if kind == "plane" and len(p) >= _MANY and found[1].nothing_left():
                return _with_border(found[0], everything, noise)
    # Points rougher than told must not buy parameters with their roughness.
    sigma = float(np.clip(min((r.noise for _, r in fits), default=noise), noise, _ROUGHEST * noise))
    judged = [(judge(fit, p, w, sigma), r) for fit, r in fits]
    judged.sort(key=lambda pair: pair[0].criterion)
    if judged and judged[0][1].explained(sigma):
        return _with_border(judged[0][0], everything, noise)
    for kind in _OTHERS:
        if kind not in kinds:
            continue
        found = _try(kind, p, noise, normals)
        if found is not None:
            judged.append((judge(found[0], p, w, sigma), found[1]))
            if found[1].explained(sigma):
                return judged[-1][0]
    if not judged:
        raise NoResultError("The points determine no shape.")
    best = min((fit for fit, _ in judged), key=lambda fit: fit.criterion)
    return replace(best, notes=(*best.notes, "No shape explains the points at their noise; this is the nearest."))


def _try(kind: Kind, points: Floats, noise: float, normals: Floats | None) -> tuple[ShapeFit, Residuals] | None:
    try:
        fit = fit_shape(kind, points, noise=noise, normals=normals)
    except (NoResultError, InputError):
        return None
    extent = float(np.ptp(points, axis=0).max())
    return fit, study(fit.shape.foot(points), fit.shape.distance(points), max(noise, 1e-9 * extent))


def _with_border(fit: ShapeFit, everything: Floats, noise: float) -> ShapeFit:
    """Fit a primitive again to all points of a face, if those along its border are on it."""
    if fit.n_points == len(everything):
        return fit
    extent = float(np.ptp(everything, axis=0).max())
    left = study(fit.shape.foot(everything), fit.shape.distance(everything), max(noise, 1e-9 * extent))
    if not left.nothing_left():
        return fit
    try:
        return replace(fit_shape(fit.shape.kind, everything, noise=noise, start=fit.shape), criterion=fit.criterion)
    except NoResultError:
        return fit


def judge(fit: ShapeFit, points: Floats, weights: Floats, sigma: float) -> ShapeFit:
    """Return the fit with its criterion at the noise `sigma`, so that shapes of several kinds can be compared."""
    sigma = max(sigma, 1e-9 * float(np.ptp(points, axis=0).max()))
    freedom = fit.shape.freedom + (_SPHERE[_compact(points)] if fit.shape.kind == "sphere" else 0)
    return replace(fit, criterion=criterion(fit.shape.distance(points) / sigma, weights, freedom))


def _compact(points: Floats) -> bool:
    """Tell whether points make a patch that is neither a ring nor a strip."""
    offset = points - points.mean(axis=0)
    values = np.linalg.eigvalsh(offset.T @ offset)
    distance = np.linalg.norm(offset, axis=1)
    filled = float(np.mean(distance < 0.5 * np.median(distance))) > _HOLLOW
    return filled and values[1] > _NARROW**2 * values[2]


def _of_swept(shape: Shape, points: Floats, noise: float, weights: Floats) -> ShapeFit:
    d = shape.distance(points)
    sigma = max(noise, 1e-9 * float(np.ptp(points, axis=0).max()))
    on = weights * (np.abs(d) <= TUKEY * max(sigma, 1.4826 * float(np.median(np.abs(d)))))
    return ShapeFit(shape, len(points), weighted_rms(d, on), None, criterion(d / sigma, weights, shape.freedom))


def _fit_spline(points: Floats, noise: float, weights: Floats, tolerance: float | None) -> ShapeFit:
    """Fit a B-spline surface."""
    found = fit_surface(points[weights > 0.0], FitParams(noise=noise, tolerance=tolerance))
    shape = SplineShape(found.surface)
    d = np.zeros(len(points))
    d[weights > 0.0] = found.residuals
    sigma = max(noise, 1e-9 * float(np.ptp(points, axis=0).max()))
    return ShapeFit(shape, len(points), found.rms, None, criterion(d / sigma, weights, shape.freedom), found.notes)


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
