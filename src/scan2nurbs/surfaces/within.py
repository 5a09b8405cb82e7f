"""Fit the simplest surface that lies within a tolerance of the points of a face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.surfaces.explain import lies_within
from scan2nurbs.surfaces.interior import interior
from scan2nurbs.surfaces.shape import KINDS, Floats, Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit, fit_shape, judge

# From the simplest on. Spheres have a parameter fewer than cylinders and are rarer: the criterion tells them apart.
_GROUPS: tuple[tuple[Kind, ...], ...] = (
    ("plane",),
    ("cylinder", "sphere"),
    ("cone",),
    ("torus",),
    ("extrusion",),
    ("revolution",),
    ("bspline",),
)


def fit_within(points: Floats, *, noise: float, tolerance: float, kind: Kind | None = None, kinds: Sequence[Kind] = KINDS) -> ShapeFit:
    """Fit the simplest surface that lies within a tolerance of points, besides their noise.

    Parameters
    ----------
    points : (N, 3) float64
        Finite points of one face.
    noise : float
        Standard deviation of the points across the surface, in their unit, ≥ 0.
    tolerance : float
        How far the surface may lie from the points besides their noise, in their unit, > 0. A B-spline surface gets control points only
        where it asks for them.
    kind : str, optional
        The kind that the surface has to be of; the simplest unless given.
    kinds : sequence of str
        What to choose the simplest from.

    Returns
    -------
    ShapeFit
        With a note where it lies farther off.

    Raises
    ------
    NoResultError
        If the points determine no surface, or none of that kind.

    Notes
    -----
    As in the segmentation of a whole part, a third of the tolerance stands for the noise where it is larger. Points along the border do
    not decide, since they may belong to the neighbours.
    """
    inside = points[interior(points)]
    if kind is not None:
        fit = _fit(kind, points, noise, tolerance)
        return fit if _good(fit, inside, noise, tolerance) else _told(fit, f"The {kind} lies farther from the points than its tolerance.")
    tried: list[ShapeFit] = []
    for group in _GROUPS:
        fits = [fit for kind in group if kind in kinds and (fit := _try(kind, points, noise, tolerance)) is not None]
        good = [fit for fit in fits if _good(fit, inside, noise, tolerance)]
        if good:
            sigma, weights = max(noise, _bounded(tolerance, points) / 3.0), np.ones(len(points))
            return min(good, key=lambda fit: judge(fit, points, weights, sigma).criterion)
        tried += fits
    if not tried:
        raise NoResultError("The points determine no shape.")
    return _told(min(tried, key=lambda fit: fit.rms), "No surface lies within the tolerance; this is the nearest.")


def _fit(kind: Kind, points: Floats, noise: float, tolerance: float) -> ShapeFit:
    # A B-spline surface has both: where it follows the points, and how rough they are.
    bounded = _bounded(tolerance, points)
    believed = noise if kind == "bspline" else max(noise, bounded / 3.0)
    return replace(fit_shape(kind, points, noise=believed, tolerance=bounded), tolerance=tolerance)


def _try(kind: Kind, points: Floats, noise: float, tolerance: float) -> ShapeFit | None:
    try:
        return _fit(kind, points, noise, tolerance)
    except (NoResultError, InputError):
        return None


def _good(fit: ShapeFit, points: Floats, noise: float, tolerance: float) -> bool:
    return lies_within(fit.shape.foot(points), fit.shape.distance(points), noise, tolerance)


def _told(fit: ShapeFit, note: str) -> ShapeFit:
    return replace(fit, notes=(*fit.notes, note))


def _bounded(tolerance: float, points: Floats) -> float:
    # Beyond the extent of the points a tolerance says no more, and its square may overflow.
    return min(tolerance, max(float(np.ptp(points, axis=0).max()), 1e-300))
