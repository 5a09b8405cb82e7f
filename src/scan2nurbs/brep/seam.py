"""Surfaces that close on themselves: whether they really do, and where their seam lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scan2nurbs.brep.occ import from_surface, kernel_errors, to_surface
from scan2nurbs.surfaces.bspline import BSplineSurface

_GAP = 1e-6
_SAME = 1e-9


def with_true_seams(surface: BSplineSurface, notes: list[str]) -> BSplineSurface:
    """Return the surface with flags that hold and seams without a gap.

    A surface that is said to be closed and closes but for a millionth of its extent gets equal ends; one that does not is taken
    for open, with a note. One whose ends are equal is closed, whatever it says: a CAD file needs the seam.
    """
    points = surface.control_points.copy()
    extent = float(np.ptp(points.reshape(-1, 3), axis=0).max())
    closed = []
    for axis, name in enumerate("uv"):
        ends = np.moveaxis(points, axis, 0)
        weights = np.moveaxis(surface.weights, axis, 0)
        gap = float(np.abs(ends[0] - ends[-1]).max())
        same_weights = bool(np.allclose(weights[0], weights[-1], rtol=_SAME))
        closes = same_weights and gap <= (_GAP if surface.closed[axis] else _SAME) * extent
        if closes:
            ends[-1] = ends[0]
        elif surface.closed[axis]:
            notes.append(f"The surface is said to be closed in {name}, but its ends lie {gap:.3g} apart; it is taken for open.")
        closed.append(closes)
    return replace(surface, control_points=points, closed=(closed[0], closed[1]))


def roll(surface: BSplineSurface, axis: int, at: float) -> BSplineSurface:
    """Return the same closed surface with its seam at the parameter `at` (modulo the period) of u (0) or v (1).

    The new domain begins at `at` and has the period's length. Where the surface passes its old seam smoothly the knot there becomes
    a simple one; elsewhere it keeps its multiplicity.

    Raises
    ------
    KernelError
        If the surface does not close in that direction.
    """
    kernel_surface = to_surface(surface)
    low, high = surface.domain[axis]
    at = low + (at - low) % (high - low)
    extent = float(np.ptp(surface.control_points.reshape(-1, 3), axis=0).max())
    u, v = surface.domain
    with kernel_errors("move the seam of a closed surface"):
        if axis == 0:
            kernel_surface.SetUPeriodic()
            kernel_surface.RemoveUKnot(1, 1, _SAME * extent)
            kernel_surface.Segment(at, at + high - low, *v)
        else:
            kernel_surface.SetVPeriodic()
            kernel_surface.RemoveVKnot(1, 1, _SAME * extent)
            kernel_surface.Segment(*u, at, at + high - low)
    return with_true_seams(from_surface(kernel_surface), [])
