"""Corner points: where the ends of curves come together, each drawn to the place that their tangents meet in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from scan2nurbs.edges.graph import Chain

# Ends up to NEAR apart may meet, in a place up to AHEAD beyond them that their tangents miss by at most MISS; all in h.
NEAR, AHEAD, MISS = 5.0, 5.0, 1.0
# The tangent is taken over so many spacings, but for the last ones, where the corner disturbs the points.
ARM, BLUNT = 8.0, 1.5


@dataclass(frozen=True)
class Meeting:
    """Corners, and the curves' ends in them.

    Attributes
    ----------
    corners : (C, 3) float64
    ends : list of (int, int)
        For each chain the corners at its first and last node; −1 where there is none.
    """

    corners: NDArray[np.float64]
    ends: list[tuple[int, int]]

    def drawn(self, points: NDArray[np.float64], chain: Chain, ends: tuple[int, int], h: float) -> NDArray[np.float64]:
        """Return a chain's points in order, drawn to its corners: what lies within a spacing of one makes room for it."""
        ordered = points[chain.nodes]
        if chain.closed:
            return ordered
        for end, first in zip(ends, (True, False), strict=True):
            if end < 0:
                continue
            corner = self.corners[end]
            rows = np.arange(len(ordered)) if first else np.arange(len(ordered))[::-1]
            far = np.linalg.norm(ordered[rows] - corner, axis=1) > h
            begin = int(far.argmax()) if far.any() else len(rows) - 1
            kept = ordered[np.sort(rows[begin:])]
            ordered = np.concatenate([corner[None], kept]) if first else np.concatenate([kept, corner[None]])
        return ordered


def meet_ends(points: NDArray[np.float64], chains: list[Chain], h: float, noise: float) -> Meeting:
    """Find the corners in which chains meet.

    Parameters
    ----------
    points : (K, 3) float64
    chains : list of Chain
        In order, split at junctions.
    h, noise : float
        Spacing and noise of the cloud.

    Notes
    -----
    Ends near each other are one group. The place nearest to all their tangents (least squares) is their corner, where it lies near all
    of them; else their mean, if they all but touch. An end that meets no other end, but runs into the middle of a curve, ends there.
    """
    place, inward, owner = _ends(points, chains, h)
    ends = [[-1, -1] for _ in chains]
    corners: list[NDArray[np.float64]] = []
    if len(place):
        pairs = KDTree(place).query_pairs(NEAR * h, output_type="ndarray").reshape(-1, 2)
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(place), len(place)))
        _, group = connected_components(graph, directed=False)
        for g in range(group.max() + 1):
            rows = np.flatnonzero(group == g)
            corner = _corner(place[rows], inward[rows], h, noise) if len(rows) > 1 else None
            if corner is None:
                continue
            for row in rows:
                chain, side = owner[row]
                ends[chain][side] = len(corners)
            corners.append(corner)
        for row, (chain, side) in enumerate(owner):
            touched = _touched(points, chains, chain, place[row], inward[row], h, noise) if ends[chain][side] < 0 else None
            if touched is not None:
                ends[chain][side] = len(corners)
                corners.append(touched)
    return Meeting(np.array(corners).reshape(-1, 3), [(a, b) for a, b in ends])


def _ends(
    points: NDArray[np.float64], chains: list[Chain], h: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, int]]]:
    """Return the ends of open chains, their unit directions into the chain, and whose they are."""
    place, inward, owner = [], [], []
    for number, chain in enumerate(chains):
        if chain.closed:
            continue
        ordered = points[chain.nodes]
        for side, row in enumerate((ordered, ordered[::-1])):
            far = np.linalg.norm(row - row[0], axis=1)
            arm = row[(far >= BLUNT * h) & (far <= ARM * h)]
            arm = arm if len(arm) >= 2 else row
            # A line through the arm; it passes near the end, not through it.
            centre = arm.mean(axis=0)
            axis = np.linalg.svd(arm - centre, full_matrices=False)[2][0]
            axis = axis * np.sign(axis @ (centre - row[0]) or 1.0)
            place.append(row[0] - ((row[0] - centre) - (row[0] - centre) @ axis * axis))
            inward.append(axis)
            owner.append((number, side))
    return np.array(place).reshape(-1, 3), np.array(inward).reshape(-1, 3), owner


def _touched(
    points: NDArray[np.float64],
    chains: list[Chain],
    own: int,
    place: NDArray[np.float64],
    inward: NDArray[np.float64],
    h: float,
    noise: float,
) -> NDArray[np.float64] | None:
    """Return the point of another chain that an end runs into; None where there is none."""
    best, found = np.inf, None
    for number, chain in enumerate(chains):
        if number == own:
            continue
        off = points[chain.nodes] - place
        ahead = -off @ inward
        miss = np.linalg.norm(off + ahead[:, None] * inward, axis=1)
        # Points of a curve are some 1.5 spacings apart: half of that is no miss.
        near = np.flatnonzero((miss <= (MISS + 0.5) * h + noise) & (np.abs(ahead) <= AHEAD * h))
        cost = np.abs(ahead[near]) + 2.0 * miss[near]
        if len(near) and cost.min() < best:
            best, found = cost.min(), points[chain.nodes[near[cost.argmin()]]]
    return found


def _corner(place: NDArray[np.float64], inward: NDArray[np.float64], h: float, noise: float) -> NDArray[np.float64] | None:
    """Return where tangents meet; None where they do not."""
    across = np.eye(3)[None] - inward[:, :, None] * inward[:, None, :]
    # A trace of the distance to the ends' mean holds the place where tangents are parallel.
    mean = place.mean(axis=0)
    matrix = across.sum(axis=0) + 0.05 * np.eye(3)
    corner = np.linalg.solve(matrix, np.einsum("nij,nj->i", across, place) + 0.05 * mean)
    off = corner - place
    ahead = -np.einsum("nc,nc->n", off, inward)
    miss = np.linalg.norm(off + ahead[:, None] * inward, axis=1)
    if (miss <= MISS * h + noise).all() and (np.abs(ahead) <= AHEAD * h).all():
        return corner
    near = np.linalg.norm(place - mean, axis=1)
    return mean if (near <= 1.5 * h + noise).all() else None
