"""The tensor-product B-spline surface: what a fit makes and what a CAD file stores."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BSplineSurface:
    """A (rational) B-spline surface S(u, v) (The NURBS Book, eq. 4.15).

    Attributes
    ----------
    degrees : (int, int)
        p and q, the degrees in u and v.
    knots : (array, array)
        Full clamped knot vectors in u and v, end knots repeated degree + 1 times; float64.
    control_points : (n_u, n_v, 3) float64
        In the frame and unit of the points that were fitted.
    weights : (n_u, n_v) float64
        All ones for a polynomial surface.
    closed : (bool, bool)
        Whether the surface closes on itself in u or v (a tube), smoothly.
    """

    degrees: tuple[int, int]
    knots: tuple[NDArray[np.float64], NDArray[np.float64]]
    control_points: NDArray[np.float64]
    weights: NDArray[np.float64]
    closed: tuple[bool, bool] = (False, False)
