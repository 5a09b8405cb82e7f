"""Chains of points and how far they reach: what lies along a curve is long, what noise made is short."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours

NEIGHBOURS = 8


class Chains(NamedTuple):
    """Chains of points that follow each other.

    Attributes
    ----------
    chain : (M,) int32
        The chain that each point belongs to.
    extent : (M,) float64
        Twice the largest distance of that chain's points from their mean; 0 for single points.
    """

    chain: NDArray[np.int32]
    extent: NDArray[np.float64]

    def mean(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each point the mean of the values (M,) over its chain."""
        return (np.bincount(self.chain, values) / np.maximum(np.bincount(self.chain), 1))[self.chain]


def chains_of(points: NDArray[np.float64], follows: float) -> Chains:
    """Join points into chains.

    Parameters
    ----------
    points : (M, 3) float64
        Points along curves.
    follows : float
        Points of a chain follow each other closer than that, in the points' unit.
    """
    # Costs the paper's operators, which need no chains, a quarter of their start.
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    if len(points) < 2:
        return Chains(np.zeros(len(points), np.int32), np.zeros(len(points)))
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
    found = Chains(np.empty(len(points), np.int32), np.empty(len(points)))
    found.chain[cells.order] = chain
    found.extent[cells.order] = 2.0 * reach[chain]
    return found
