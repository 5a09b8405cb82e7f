"""Foot points: the parameters on a surface that lie nearest to given points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.bspline import foot_points_range
from scan2nurbs.kernels.runner import run_ranges
from scan2nurbs.surfaces.bspline import BSplineSurface

_RANGE = 8192


@dataclass(frozen=True)
class FootPoints:
    """Where points stand on a surface.

    Attributes
    ----------
    uv : (N, 2) float64
        Parameters of the foot points, within the surface's domain.
    height : (N,) float64
        Signed distances along the normal S_u × S_v.
    distance : (N,) float64
        Distances to the foot points; larger than the height beyond the surface's border.
    """

    uv: NDArray[np.float64]
    height: NDArray[np.float64]
    distance: NDArray[np.float64]


def foot_points(surface: BSplineSurface, points: NDArray[np.float64], start: NDArray[np.float64], *, steps: int = 12) -> FootPoints:
    """Find the foot points of points on a polynomial surface.

    Parameters
    ----------
    surface : BSplineSurface
        All weights one.
    points : (N, 3) float64
        In the surface's frame and unit.
    start : (N, 2) float64
        First parameters, near the right ones.
    steps : int
        Most steps of the damped Newton iteration.
    """
    uv = np.ascontiguousarray(start, dtype=np.float64).copy()
    points = np.ascontiguousarray(points, dtype=np.float64)
    residuals = np.zeros((len(points), 2))
    (knots_u, knots_v), (p, q), (closed_u, closed_v) = surface.knots, surface.degrees, surface.closed
    reach = 0.5 * max((high - low) / n for (low, high), n in zip(surface.domain, surface.spans, strict=True))

    def work(begin: int, end: int) -> None:
        foot_points_range(
            knots_u, knots_v, p, q, closed_u, closed_v, surface.control_points, points, steps, reach, begin, end, uv, residuals
        )

    run_ranges(work, len(points), size=_RANGE)
    return FootPoints(uv=uv, height=residuals[:, 0], distance=residuals[:, 1])
