"""Clouds as the segmentation works on them, without its normals."""

from __future__ import annotations

import numpy as np

from scan2nurbs.faces.compete import Sheet, link_weights
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours


def sheet_of(points, noise):
    """The graph of a cloud of spacing 1, and the order of its points in it."""
    cells = build_cells(points, 3.0)
    neighbours, _ = nearest_neighbours(cells, 12, reach=2.0)
    own = np.arange(len(points), dtype=np.int32)[:, None]
    normals = np.full(points.shape, np.nan)
    neighbours = np.where(neighbours < 0, own, neighbours).astype(np.int32)
    return Sheet(cells.points, normals, neighbours, link_weights(normals, neighbours), noise, 0.12), cells.order
