"""How far chains of points reach: what lies along a curve is long, what noise made is short."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours

NEIGHBOURS = 8


def chain_extent(points: NDArray[np.float64], follows: float) -> NDArray[np.float64]:
    """Return for each point the extent of the chain that it belongs to.

    Parameters
    ----------
    points : (M, 3) float64
        Points along curves.
    follows : float
        Points of a chain follow each other closer than that, in the points' unit.

    Returns
    -------
    (M,) float64
        Twice the largest distance of the chain's points from their mean; 0 for single points.
    """
    # Costs the paper's operators, which need no chains, a quarter of their start.
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    if len(points) < 2:
        return np.zeros(len(points))
    k = min(NEIGHBOURS, len(points) - 1)
    cells = build_cells(points, math.sqrt(NEIGHBOURS) * follows)
    index, distance = nearest_neighbours(cells, k)
    near = (distance < follows) & (index >= 0)
    rows = np.repeat(np.arange(len(points)), near.sum(axis=1))
    links = coo_matrix((np.ones(len(rows), bool), (rows, index[near])), shape=(len(points), len(points)))
    n, chain = connected_components(links, directed=False)
    middle = np.stack([np.bincount(chain, column) for column in cells.points.T], axis=1) / np.bincount(chain)[:, None]
    reach = np.zeros(n)
    np.maximum.at(reach, chain, np.linalg.norm(cells.points - middle[chain], axis=1))
    extent = np.empty(len(points))
    extent[cells.order] = 2.0 * reach[chain]
    return extent
