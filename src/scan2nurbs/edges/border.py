"""Where the scanned surface ends: points with nothing on one side of them, along borders that are too long to be holes in the data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.chains import chain_extent
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.kernels.runner import Progress

# In h: the radius within which a side must be empty, and within which points of one border follow each other.
RADIUS, FOLLOWS = 4.0, 2.5
# The mean of what is left of a disc cut at a third of its radius from the point lies so far off it, in radii: see `border_points`.
OFFSET = 0.24
# With fewer points than this in the ball their mean says little.
LEAST_POINTS = 12
# A closed border of less than this extent, in h, is a hole in the data, as shadows and reflections leave them.
HOLE = 24.0


def border_points(cells: Cells, h: float, progress: Progress | None = None) -> NDArray[np.bool_]:
    """Find the points at the borders of the scan.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    h : float
        The noise-stable spacing.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    (N,) bool
        In sorted order. Borders that span less than 24 h are left out.

    Notes
    -----
    At the end of a surface the mean of a ball's points lies off its centre, along the surface: 4/(3π) = 0.42 of the radius at
    the very border, 0.24 at a third of the radius from it. A disc of 4 h
    within the surface holds 50 points, whose mean is sure to 0.07 of it.
    """
    balls = ball_planes(cells, RADIUS * h, progress=progress)
    along = balls.mean - np.einsum("ij,ij->i", balls.mean, balls.normal)[:, None] * balls.normal
    found = np.flatnonzero((np.linalg.norm(along, axis=1) > OFFSET * RADIUS * h) & (balls.n_points >= LEAST_POINTS))
    border = np.zeros(len(cells.points), bool)
    border[found[chain_extent(cells.points[found], FOLLOWS * h) >= HOLE * h]] = True
    return border
