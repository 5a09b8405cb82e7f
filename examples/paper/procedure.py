"""The paper's procedure from the marked points to the surface (Fig. 10), step by step, and the default procedure beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

import scan2nurbs as s2n
from scan2nurbs.edges.clean import CleanParams, density_filter
from scan2nurbs.edges.thin import approximate_boundary
from scan2nurbs.errors import Scan2NurbsError
from scan2nurbs.faces.inside import enclosed_by_centroid
from scan2nurbs.faces.region import RegionParams
from scan2nurbs.pipeline import SurfaceModel, SurfaceParams
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.fit import FitParams, fit_surface
from scan2nurbs.surfaces.project import foot_points

from .truth import Array, InsideScore, LineScore, Mask, StandIn, score_inside, score_line

THIN_RADIUS = 3.0
"""r_u in h; the paper does not say which it used."""

FILTER = CleanParams(neighbours=30, robust=False, deviations=1.0, noise_factor=0.0)
"""The statistical filter in its original form: mean distance to 30 neighbours at most the mean of all and one standard deviation."""

BY_HAND = 4.0
"""The stand-in for the paper's removal of undesired points by hand: what lies farther than so many h from the true border."""


@dataclass(frozen=True)
class SurfaceScore:
    """How far a fitted surface lies from the true one, at the noise-free places of the functional surface.

    Attributes
    ----------
    rms : float
        In h.
    in_sigma : float
        The same in units of the noise's standard deviation; NaN without noise.
    covered : float
        Share of the functional surface's points (without doubtful ones) that were fitted.
    """

    rms: float
    in_sigma: float
    covered: float


@dataclass(frozen=True)
class PaperRun:
    """Fig. 10, (a) to (f).

    Attributes
    ----------
    marked, dense : (N,) bool
        Points that the operator marked, and those of them that the density filter left.
    thinned : tuple of (K, 3) float64
        After one, two and three times Algorithm 2.
    chosen : (K, 3) float64
        What is left of the last after removal by hand.
    found : (N,) bool
        T of Algorithm 3 from the chosen points.
    found_uncorrected : InsideScore
        How well Algorithm 3 does without removal by hand.
    surface : BSplineSurface or None
        Fitted to T; None where the points determine none.
    """

    marked: Mask
    dense: Mask
    thinned: tuple[Array, ...]
    lines: tuple[LineScore, ...]
    chosen: Array
    chosen_line: LineScore
    found: Mask
    inside: InsideScore
    found_uncorrected: InsideScore
    surface: BSplineSurface | None
    score: SurfaceScore | None


def as_in_the_paper(cloud: StandIn, marked: Mask) -> PaperRun:
    """Run the filter, Algorithm 2 three times, removal by hand, Algorithm 3 and the fit."""
    scale = s2n.measure(cloud.points).scale
    dense = marked.copy()
    dense[marked] = density_filter(cloud.points[marked], spacing=scale.h, params=FILTER)
    thinned = tuple(approximate_boundary(cloud.points[dense], THIN_RADIUS * scale.h, times=k) for k in (1, 2, 3))
    chosen = thinned[-1][KDTree(cloud.border).query(thinned[-1])[0] <= BY_HAND * cloud.h]
    found = enclosed_by_centroid(cloud.points, chosen) if len(chosen) else np.zeros(len(cloud), bool)
    uncorrected = enclosed_by_centroid(cloud.points, thinned[-1]) if len(thinned[-1]) else found
    surface, score = _fitted(cloud, found, scale.noise)
    return PaperRun(
        marked,
        dense,
        thinned,
        tuple(score_line(cloud, points) for points in thinned),
        chosen,
        score_line(cloud, chosen),
        found,
        score_inside(cloud, found),
        score_inside(cloud, uncorrected),
        surface,
        score,
    )


def _fitted(cloud: StandIn, found: Mask, noise: float) -> tuple[BSplineSurface | None, SurfaceScore | None]:
    try:
        fit = fit_surface(cloud.points[found], FitParams(noise=noise))
    except Scan2NurbsError:
        return None, None
    uv = np.full((len(cloud), 2), np.nan)
    uv[found] = fit.uv
    return fit.surface, score_surface(cloud, fit.surface, uv, found)


def score_surface(cloud: StandIn, surface: BSplineSurface, uv: Array, fitted: Mask) -> SurfaceScore:
    """Measure the surface at the noise-free places of the functional points that were fitted.

    Parameters
    ----------
    surface : BSplineSurface
        In the cloud's coordinates.
    uv : (N, 2) float64
        Where the fitted points stand on it.
    """
    wanted = cloud.inside & cloud.judged
    used = np.flatnonzero(wanted & fitted)
    if len(used) == 0:
        return SurfaceScore(np.nan, np.nan, 0.0)
    distance = foot_points(surface, cloud.clean[used], uv[used]).distance
    rms = float(np.sqrt((distance**2).mean()))
    return SurfaceScore(rms / cloud.h, rms / cloud.sigma if cloud.sigma > 0 else np.nan, len(used) / np.count_nonzero(wanted))


@dataclass(frozen=True)
class DefaultRun:
    """The default procedure of this project on the same cloud."""

    model: SurfaceModel
    found: Mask
    line: LineScore
    inside: InsideScore
    surface: BSplineSurface
    score: SurfaceScore


def by_default(cloud: StandIn, seed: tuple[float, float, float], threshold: float | None = None) -> DefaultRun | None:
    """Run `reconstruct_surface`, told only which surface is meant, and perhaps δ; None where it says that it finds no result."""
    params = SurfaceParams(edges=s2n.EdgeParams(threshold=threshold), region=RegionParams(seed=seed))
    try:
        model = s2n.reconstruct_surface(cloud.points, params, unit="mm")
    except Scan2NurbsError as error:
        print(f"  the default procedure found no result: {error}")
        return None
    origin = model.cloud.origin
    surface = replace(model.fit.surface, control_points=model.fit.surface.control_points + origin)
    used, uv = np.zeros(len(model.cloud.points), bool), np.full((len(model.cloud.points), 2), np.nan)
    used[model.fitted], uv[model.fitted] = True, model.fit.uv
    to_rows = model.cloud.to_rows
    found = to_rows(model.inside, False)
    return DefaultRun(
        model,
        found,
        score_line(cloud, model.boundary.points + origin),
        score_inside(cloud, found),
        surface,
        score_surface(cloud, surface, to_rows(uv, np.nan), to_rows(used, False)),
    )
