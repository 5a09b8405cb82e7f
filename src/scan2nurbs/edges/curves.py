"""Boundary curves: thinned points ordered into open curves and closed loops, each with a B-spline curve through it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from scan2nurbs.edges.graph import order_points
from scan2nurbs.edges.polyline import arc_length, find_corners, resample
from scan2nurbs.edges.splinefit import fit_spline
from scan2nurbs.ranges import require_float, require_int


@dataclass(frozen=True, kw_only=True)
class CurveParams:
    """How thinned points become curves; lengths in units of the spacing h.

    Attributes
    ----------
    link : float, > 0
        Points up to this far apart may be neighbours on a curve. Thinned points are about 1.5 apart.
    gap : float, > 0
        Ends up to this far apart that face each other are joined.
    prune : float, >= 0
        Side branches shorter than this are cut off.
    min_loop : float, > 0
        No loop shorter than this is closed.
    min_length : float, >= 0
        Curves shorter than this are left out.
    tolerance : float or None
        Root mean square distance of the points from the curve to reach, > 0; None takes it from the noise and the points' scatter.
    degree : int, in [1, 9]
        Degree of the B-spline curves.
    corner_angle : float, in (0, 180)
        Turns of at least so many degrees at a point are corners, which stay sharp.
    """

    link: float = 3.0
    gap: float = 8.0
    prune: float = 5.0
    min_loop: float = 12.0
    min_length: float = 8.0
    tolerance: float | None = None
    degree: int = 3
    corner_angle: float = 35.0

    def __post_init__(self) -> None:
        for name in ("link", "gap", "min_loop"):
            require_float(getattr(self, name), name, "trace_curves", 0.0)
        for name in ("prune", "min_length"):
            require_float(getattr(self, name), name, "trace_curves", 0.0, closed="low")
        if self.tolerance is not None:
            require_float(self.tolerance, "tolerance", "trace_curves", 0.0)
        require_int(self.degree, "degree", "trace_curves", 1, 9)
        require_float(self.corner_angle, "corner_angle", "trace_curves", 0.0, 180.0)


@dataclass(frozen=True)
class BoundaryCurve:
    """A curve of the boundary.

    Attributes
    ----------
    points : (K, 3) float64
        The thinned points in order along the curve; the first is not repeated at the end of a closed one.
    closed : bool
        Whether the curve is a loop.
    spline : scipy.interpolate.BSpline
        The curve, parametrised about by arc length from 0 on; where `closed` without corners it is periodic.
    corners : (C,) float64
        Parameters of sharp corners, where the spline's tangent jumps.
    rms, max_deviation : float
        Distances of the points from the spline.
    length : float
        Of the spline.
    """

    points: NDArray[np.float64]
    closed: bool
    spline: BSpline
    corners: NDArray[np.float64]
    rms: float
    max_deviation: float
    length: float

    @property
    def end(self) -> float:
        """The largest parameter; the curve runs over [0, end]."""
        return float(self.spline.t[len(self.spline.c)])

    def sample(self, step: float) -> NDArray[np.float64]:
        """Return points about `step` apart along the spline, (n, 3); corners and ends are among them."""
        ends = np.unique(np.r_[0.0, self.corners, self.end])
        pieces = []
        for a, b in pairwise(ends):
            n = max(int(np.ceil((b - a) / step)), 2)
            pieces.append(np.linspace(a, b, n + 1)[:-1])
        at = np.concatenate(pieces) if self.closed else np.r_[np.concatenate(pieces), self.end]
        return np.asarray(self.spline(at))


def trace_curves(
    points: NDArray[np.float64], spacing: float, params: CurveParams | None = None, *, noise: float = 0.0
) -> tuple[BoundaryCurve, ...]:
    """Order thinned boundary points into curves and fit a B-spline curve to each.

    Parameters
    ----------
    points : (K, 3) float64
        Thinned boundary points, about 1.5 spacings apart along the boundary.
    spacing : float
        The noise-stable spacing h, in the points' unit.
    params : CurveParams, optional
    noise : float
        Standard deviation of the cloud across its surface, in the points' unit.

    Returns
    -------
    tuple of BoundaryCurve
        By falling length; empty where no curve is long enough. Curves that meet in a junction each end there.

    Raises
    ------
    ParameterError
        If the spacing is out of range.

    Notes
    -----
    Deterministic, the same for every order of the points; a rigid motion of the points moves the curves with them. Where a
    closed curve begins, and which way an open one runs, is free and may change with the motion.
    """
    params = params or CurveParams()
    require_float(float(spacing), "spacing", "trace_curves", 0.0)
    require_float(float(noise), "noise", "trace_curves", 0.0, closed="low")
    points = points[np.lexsort(points.T)]
    if len(points) < 3:
        return ()
    chains = order_points(
        points,
        link=params.link * spacing,
        gap=params.gap * spacing,
        prune=params.prune * spacing,
        loop=params.min_loop * spacing,
    )
    curves = []
    for chain in chains:
        ordered = points[chain.nodes]
        if len(ordered) >= 3 and arc_length(ordered, closed=chain.closed)[-1] >= params.min_length * spacing:
            curves.append(fit_curve(ordered, spacing, closed=chain.closed, params=params, noise=noise))
    return tuple(sorted(curves, key=lambda curve: -curve.length))


def fit_curve(
    ordered: NDArray[np.float64], spacing: float, *, closed: bool, params: CurveParams | None = None, noise: float = 0.0
) -> BoundaryCurve:
    """Fit a B-spline curve to points in order, with sharp corners kept; parameters as in `trace_curves`."""
    params = params or CurveParams()
    even = resample(ordered, 0.5 * spacing, closed=closed)
    rows = find_corners(even, closed=closed, arm=6.0 * spacing, blunt=1.5 * spacing, min_angle=params.corner_angle)
    total = arc_length(even, closed=closed)
    corners = total[rows] * (arc_length(ordered, closed=closed)[-1] / total[-1])
    # Neighbouring points share much of their error, which their scatter about each other does not show: the noise does.
    own = max(1.2 * _scatter(ordered), 0.1 * spacing + 0.6 * noise)
    tolerance = own if params.tolerance is None else params.tolerance * spacing
    fit = fit_spline(ordered, corners, closed=closed, degree=params.degree, tolerance=tolerance)
    fine = np.linspace(0.0, fit.end, 8 * len(ordered) + 1)
    length = float(np.linalg.norm(np.diff(fit.spline(fine), axis=0), axis=1).sum())
    distance = fit.distance
    rms = float(np.sqrt(np.mean(distance**2)))
    return BoundaryCurve(fit.points, closed, fit.spline, fit.corners, rms, float(distance.max()), length)


def _scatter(ordered: NDArray[np.float64]) -> float:
    """Return the standard deviation, across the curve, of points about a smooth curve through their neighbours."""
    if len(ordered) < 5:
        return 0.0
    before, here, after = ordered[:-2], ordered[1:-1], ordered[2:]
    chord = after - before
    square = np.maximum((chord**2).sum(axis=1), np.finfo(np.float64).tiny)
    part = ((here - before) * chord).sum(axis=1) / square
    off = here - before - part[:, None] * chord
    # The distance from the chord of two neighbours scatters with 1 + 1/4 + 1/4 of the variance, in two directions across.
    return float(np.median(np.linalg.norm(off, axis=1)) / np.sqrt(1.5) / 1.177 * np.sqrt(2.0))
