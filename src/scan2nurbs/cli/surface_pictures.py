"""The pictures of a reconstructed surface, in the order of the stages."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.report.pictures import (
    Picture,
    deviation_histogram,
    deviation_picture,
    groups_picture,
    strength_picture,
    surface_picture,
    trend_picture,
)
from scan2nurbs.report.view import choose_view

if TYPE_CHECKING:
    from scan2nurbs.pipeline import SurfaceModel

LINES, SAMPLES = 21, 240
"""Lines of constant parameter in each direction, and points along each."""


def surface_pictures(model: SurfaceModel) -> list[Picture]:
    """Draw edge strength, boundary, inside, surface, deviations and their distribution; all from one side."""
    points, unit = model.cloud.points, model.cloud.unit
    view = choose_view(points)
    loops = trimming_loops(model)
    curves = [_closed(curve.sample(0.5 * model.scale.h), curve.closed) for curve in model.boundary.curves]
    boundary = groups_picture(
        points,
        {"boundary points": model.band.on_edge},
        title="The boundary",
        caption="Edge points that are left after filtering and corrections, and the curves that were fitted to them.",
        unit=unit,
        curves=curves,
        view=view,
    )
    inside = groups_picture(
        points,
        {"inside": model.inside, "boundary points": model.band.on_edge & ~model.inside},
        title="The inside",
        caption="Points of the surface inside its outline, which is what trims the face.",
        unit=unit,
        curves=loops,
        curve_name="outline of the face",
        view=view,
    )
    fit = model.fit
    feet = fit.surface.evaluate(fit.uv)
    near = view.framed(feet)
    return [
        strength_picture(points, model.edges.strength, unit=unit, threshold=model.edges.threshold, view=view),
        boundary,
        inside,
        surface_picture(points, parameter_lines(model), loops, unit=unit, view=view),
        deviation_picture(feet, fit.residuals, unit=unit, tolerance=fit.tolerance, view=near),
        trend_picture(feet, np.where(fit.inliers, fit.residuals, np.nan), unit=unit, tolerance=fit.tolerance, view=near),
        deviation_histogram(fit.residuals, unit=unit, noise=model.scale.noise, tolerance=fit.tolerance),
    ]


def trimming_loops(model: SurfaceModel) -> list[NDArray[np.float64]]:
    """Return the loops that trim the face, as polylines in space."""
    surface = model.fit.surface
    low, high = np.array(surface.domain).T
    return [_closed(surface.evaluate(_into(loop.uv, low, high, surface.closed)), True) for loop in model.trim.loops]


def parameter_lines(model: SurfaceModel) -> list[NDArray[np.float64]]:
    """Return pieces of lines of constant parameter that run where the face has points."""
    surface = model.fit.surface
    (u0, u1), (v0, v1) = surface.domain
    along = np.linspace(0.0, 1.0, SAMPLES)
    tree = KDTree(model.cloud.points[model.inside]) if model.inside.any() else None
    pieces: list[NDArray[np.float64]] = []
    for at in np.linspace(0.0, 1.0, LINES):
        for uv in (np.stack([np.full(SAMPLES, at), along], axis=1), np.stack([along, np.full(SAMPLES, at)], axis=1)):
            line = surface.evaluate(uv * [u1 - u0, v1 - v0] + [u0, v0])
            near = np.zeros(SAMPLES, bool) if tree is None else np.isfinite(tree.query(line, distance_upper_bound=2.0 * model.scale.h)[0])
            pieces += _runs(line, near)
    return pieces


def _runs(line: NDArray[np.float64], keep: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Cut a line into its stretches of kept points."""
    breaks = np.flatnonzero(np.diff(np.r_[False, keep, False].astype(np.int8)))
    return [line[start:stop] for start, stop in list(pairwise(breaks))[::2] if stop - start > 1]


def _into(uv: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], closed: tuple[bool, bool]) -> NDArray[np.float64]:
    """Bring parameters into the domain: around where the surface is closed, to the border where it is not."""
    around = low + np.mod(uv - low, high - low)
    return np.where(np.array(closed), around, np.clip(uv, low, high))


def _closed(curve: NDArray[np.float64], closed: bool) -> NDArray[np.float64]:
    return np.vstack([curve, curve[:1]]) if closed and len(curve) else curve
