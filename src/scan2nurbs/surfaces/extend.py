"""Extend a B-spline surface beyond its borders by its own polynomials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.surfaces.bspline import BSplineSurface


def extend(surface: BSplineSurface, low: NDArray[np.float64], high: NDArray[np.float64]) -> BSplineSurface:
    """Extend a surface to a larger domain; on its old domain it stays the same.

    Parameters
    ----------
    surface : BSplineSurface
        Polynomial (all weights one); a direction in which it is closed is left as it is.
    low, high : (2,) float64
        Corners of the wanted domain in (u, v). A side that lies within the old domain stays where it is.

    Returns
    -------
    BSplineSurface
        With as many control points as before: only the outermost ones move.

    Notes
    -----
    The control points of a spline are blossoms of its polynomial pieces at consecutive knots (Ramshaw 1989); moving the end
    knots outward re-evaluates those of the end pieces.
    """
    knots, control = list(surface.knots), surface.control_points
    for axis in (0, 1):
        if surface.closed[axis]:
            continue
        moved = np.moveaxis(control, axis, 0)
        knots[axis], moved = _extend_axis(knots[axis], surface.degrees[axis], moved, float(low[axis]), float(high[axis]))
        control = np.moveaxis(moved, 0, axis)
    return replace(surface, knots=(knots[0], knots[1]), control_points=np.ascontiguousarray(control))


def _extend_axis(
    knots: NDArray[np.float64], degree: int, control: NDArray[np.float64], low: float, high: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = len(control)
    wider = knots.copy()
    wider[: degree + 1] = min(low, knots[degree])
    wider[n:] = max(high, knots[n])
    result = control.copy()
    first = int(np.searchsorted(knots, knots[degree], side="right")) - 1
    last = int(np.searchsorted(knots, knots[n], side="left")) - 1
    for i in range(degree):
        if wider[0] < knots[0]:
            result[i] = _blossom(knots, degree, control, first, wider[i + 1 : i + degree + 1])
        j = n - 1 - i
        if wider[-1] > knots[-1]:
            result[j] = _blossom(knots, degree, control, last, wider[j + 1 : j + degree + 1])
    return wider, result


def _blossom(
    knots: NDArray[np.float64], degree: int, control: NDArray[np.float64], span: int, at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Evaluate the blossom of the polynomial piece on a span (de Boor's algorithm with one argument a level)."""
    d = control[span - degree : span + 1].copy()
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            i = span - degree + j
            share = (at[r - 1] - knots[i]) / (knots[i + degree - r + 1] - knots[i])
            d[j] = (1.0 - share) * d[j - 1] + share * d[j]
    return d[degree]
