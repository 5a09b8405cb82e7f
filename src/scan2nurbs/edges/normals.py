"""Normals at a radius, with the degenerate neighbourhoods decided and counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.moments import UNDEFINED, BallPlanes, ball_planes
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.kernels.symmetric3 import line_angles

__all__ = ["UNDEFINED", "Normals", "angles_between", "normals_at"]

MAX_WIDENINGS = 4


@dataclass(frozen=True)
class Normals:
    """Normals of every point at one radius, in the order of the sorted points unless that of the input was asked for.

    Attributes
    ----------
    radius : float
        In the points' unit.
    normal : (N, 3) float64
        Unit normals as lines; NaN where undefined.
    status : (N,) uint8
        0: from the ball of `radius`; k: from a ball √2^k times as wide, since the smaller ones carry no plane; 255: undefined.
    sector_angle : (N,) float64
        VDN at the radius (eq. 2.3) in degrees, NaN where undefined; empty unless asked for.
    balls : BallPlanes
        The planes the normals come from; their mean and variance only where they were asked for.
    """

    radius: float
    normal: NDArray[np.float64]
    status: NDArray[np.uint8]
    sector_angle: NDArray[np.float64]
    balls: BallPlanes


def normals_at(
    cells: Cells,
    radius: float,
    *,
    sectors: int = 0,
    only_normals: bool = False,
    exact: bool = False,
    input_order: bool = False,
    progress: Progress | None = None,
) -> Normals:
    """Estimate normals from all points closer than a radius (paper, section 2.1).

    Parameters
    ----------
    cells : Cells
        The sorted points.
    radius : float
        In the points' unit.
    sectors : int
        g of VDN, or 0 to leave it out.
    only_normals : bool
        Whether to leave out the balls' mean and variance.
    exact : bool
        Whether each point is summed even where a ball holds thousands (see `ball_planes`).
    input_order : bool
        Whether results stand in the order of the points that the cells were built from.
    progress : callable, optional
        Called with (cells done, cells).

    Notes
    -----
    A ball of fewer than three points, or of nearly collinear ones, carries no plane. Its radius is widened by √2 up to four
    times; a point that has no plane then has no normal. VDN is never taken from a widened ball: sectors of a ball without a plane
    have no sense.
    """
    balls = ball_planes(
        cells,
        radius,
        sectors=sectors,
        widenings=MAX_WIDENINGS,
        only_normals=only_normals,
        exact=exact,
        input_order=input_order,
        progress=progress,
    )
    return Normals(radius=radius, normal=balls.normal, status=balls.widened, sector_angle=balls.sector_angle, balls=balls)


def angles_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles between lines.

    Parameters
    ----------
    a, b : (N, 3) float64
        Unit directions.

    Returns
    -------
    (N,) float64
        Degrees in [0, 90]; NaN where either is NaN.
    """
    return line_angles(a, b)
