"""First parameters for scattered points: the plane where the points are a height field over it, else an unrolling, else a tube."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.nodes import Nodes, make_nodes
from scan2nurbs.surfaces.tube import Around, around, around_bends, poles
from scan2nurbs.surfaces.unroll import carry, jacobians, unroll

logger = logging.getLogger(__name__)

# Normals of a height field stay within 60 degrees of its direction; beyond, its parameters are stretched more than twice.
_FLATTEST_COSINE = 0.5
_OUTLIERS = 0.01


@dataclass(frozen=True)
class Parameters:
    """Where points lie in a nearly isometric rectangle.

    Attributes
    ----------
    name : str
        "plane", "geodesic" or "tube".
    uv : (N, 2) float64
        Parameters in the points' unit.
    size : (float, float)
        The rectangle is [0, size[0]] × [0, size[1]].
    closed : bool
        Whether u runs around a tube.
    nodes : Nodes
        The thinned points that were looked at.
    node_uv : (M, 2) float64
        Their parameters; the normals of the nodes point to the side of S_u × S_v.
    notes : tuple of str
        What was noticed, one sentence each.
    """

    name: str
    uv: NDArray[np.float64]
    size: tuple[float, float]
    closed: bool
    nodes: Nodes
    node_uv: NDArray[np.float64]
    notes: tuple[str, ...] = ()

    def fill(self, n_points: int) -> float:
        """Return how much of the rectangle the surface covers, in (0, 1]."""
        return min(1.0, n_points * self.nodes.spacing**2 / (self.size[0] * self.size[1]))


def parametrize(points: NDArray[np.float64]) -> Parameters:
    """Find parameters for points (N, 3) that map the surface one to one.

    Raises
    ------
    NoResultError
        If the points are (nearly) collinear, or no tried map is free of folds: the points are not one sheet or tube.
    """
    centre = points.mean(axis=0)
    spread, axes = np.linalg.eigh((points - centre).T @ (points - centre))
    if not spread[1] > 1e-8 * spread[2]:
        raise NoResultError("The points lie on a line; they do not determine a surface.")
    nodes = make_nodes(points)
    direction = _height_direction(nodes, axes)
    if direction is not None:
        return _finish("plane", nodes, nodes.points @ direction[:2].T, points @ direction[:2].T)
    found = [*_unrolled(nodes, points), *_tubes(nodes, points, around(nodes))]
    found = found or [*_tubes(nodes, points, around_bends(nodes))]
    if not found:
        raise NoResultError("The points are not one sheet that can be unrolled, or one tube: every map tried folds over.")
    # A map that leaves its rectangle half empty costs control points as one that stretches does.
    return min(found, key=lambda one: one[0].stretch / one[1].fill(len(points)))[1]


def _unrolled(nodes: Nodes, points: NDArray[np.float64]) -> Iterator[tuple[Quality, Parameters]]:
    uv = unroll(nodes)
    jacobian = jacobians(nodes, uv)
    quality = judge(nodes, uv, jacobian)
    logger.info("unrolled: %s", quality)
    if quality.valid:
        yield quality, _finish("geodesic", nodes, uv, carry(nodes, uv, jacobian, points))


def _tubes(nodes: Nodes, points: NDArray[np.float64], maps: Iterable[Around]) -> Iterator[tuple[Quality, Parameters]]:
    best: tuple[Quality, Around, NDArray[np.float64]] | None = None
    least = (True, np.inf)
    for map_ in maps:
        jacobian = jacobians(nodes, map_.uv, map_.jump)
        quality = judge(nodes, map_.uv, jacobian, map_.period)
        logger.info("tube: %s", quality)
        # A narrow end holds too few of the nodes to be missed by their quantiles where the map does not run around it.
        rank = poles(nodes, map_.uv[:, 0] / map_.period) > 0, quality.stretch
        if quality.valid and rank < least:
            best, least = (quality, map_, jacobian), rank
    if best is None:
        return
    quality, map_, jacobian = best
    uv = carry(nodes, map_.uv, jacobian, points, map_.period)
    low, high = _range(nodes, map_.uv[:, 1], uv[:, 1])
    shift = np.array([0.0, low])
    around_ = np.stack([np.mod(uv[:, 0], map_.period), np.clip(uv[:, 1], low, high)], axis=1) - shift
    size = (map_.period, high - low)
    yield quality, Parameters("tube", around_, size, True, nodes, map_.uv - shift)


@dataclass(frozen=True)
class Quality:
    """How a map of the nodes is to be judged.

    Attributes
    ----------
    flipped : float
        Fraction of nodes whose neighbourhood is mirrored or squashed to less than a quarter in some direction.
    overlapping : float
        Fraction of nodes that share their place with nodes far away on the surface.
    stretch : float
        95 % quantile of the larger of stretch and squash, ≥ 1.
    """

    flipped: float
    overlapping: float
    stretch: float

    @property
    def valid(self) -> bool:
        """Whether the map is one to one but for a few outliers."""
        return self.flipped <= 2 * _OUTLIERS and self.overlapping <= 2 * _OUTLIERS


def judge(nodes: Nodes, uv: NDArray[np.float64], jacobian: NDArray[np.float64], period: float = 0.0) -> Quality:
    """Judge a map by its jacobians and by who shares a place."""
    singular = np.linalg.svd(jacobian, compute_uv=False)
    squashed = (np.linalg.det(jacobian) <= 0) | (singular[:, 1] < 0.25)
    worst = np.maximum(singular[:, 0], 1.0 / np.maximum(singular[:, 1], 1e-12))
    return Quality(float(np.mean(squashed)), overlap(nodes, uv, period), float(np.quantile(worst, 0.95)))


def _height_direction(nodes: Nodes, axes: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the rows of a frame over whose first two the nodes are a height field with margin; None where there is no such frame."""
    mean = nodes.normals.mean(axis=0)
    candidates = [axes[:, 0]]
    if np.linalg.norm(mean) > 0.1:
        candidates.append(mean / np.linalg.norm(mean))
    for normal in candidates:
        slope = nodes.normals @ normal
        slope = slope if slope.sum() > 0 else -slope
        if np.quantile(slope, 3 * _OUTLIERS) < _FLATTEST_COSINE:
            continue
        first = np.cross(np.cross(normal, axes[:, 2]), normal)
        if np.linalg.norm(first) < 1e-3:
            first = np.cross(np.cross(normal, axes[:, 1]), normal)
        first /= np.linalg.norm(first)
        frame = np.stack([first, np.cross(normal, first), normal])
        if overlap(nodes, nodes.points @ frame[:2].T) <= _OUTLIERS:
            return frame
    return None


def overlap(nodes: Nodes, uv: NDArray[np.float64], period: float = 0.0) -> float:
    """Return the fraction of nodes that have a neighbour in the parameters which is far away in space."""
    k = min(5, len(uv))
    distance, near = KDTree(uv, boxsize=[period * (1 + 1e-9), 0.0]).query(uv, k=k)
    space = np.linalg.norm(nodes.points[near] - nodes.points[:, None], axis=2)
    return float(np.mean((space > 3.0 * distance + 2.0 * nodes.spacing).any(axis=1)))


def _finish(name: str, nodes: Nodes, node_uv: NDArray[np.float64], uv: NDArray[np.float64]) -> Parameters:
    """Turn the parameters into the smallest rectangle around them, with a margin of half a spacing, the long side along u."""
    turn = smallest_rectangle(node_uv)
    uv, node_uv = uv @ turn.T, node_uv @ turn.T
    low, high = np.array([_range(nodes, node_uv[:, k], uv[:, k]) for k in (0, 1)]).T
    size = high - low
    return Parameters(name, np.clip(uv, low, high) - low, (float(size[0]), float(size[1])), False, nodes, node_uv - low)


def _range(nodes: Nodes, node_x: NDArray[np.float64], x: NDArray[np.float64]) -> tuple[float, float]:
    """Return the range of a parameter that is not stretched by outliers: points neither isolated nor far from all nodes count."""
    reach = 2.0 * float(np.median(nodes.lengths))
    counts = x[nodes.dense & (x >= node_x.min() - reach) & (x <= node_x.max() + reach)]
    margin = 0.5 * nodes.spacing
    return float(min(node_x.min(), counts.min())) - margin, float(max(node_x.max(), counts.max())) + margin


def smallest_rectangle(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation (2, 2) into the rectangle of smallest area around points; its long side becomes u.

    A side of that rectangle lies on a side of the convex hull (Freeman and Shapira 1975).
    """
    try:
        hull = uv[ConvexHull(uv).vertices]
    except QhullError as error:
        raise NoResultError("The points lie on a line; they do not determine a surface.") from error
    side = np.roll(hull, -1, axis=0) - hull
    angle = np.arctan2(side[:, 1], side[:, 0])
    turns = np.stack([np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)], 1)
    extent = np.ptp(hull @ turns.transpose(0, 2, 1), axis=1)
    turn = turns[np.argmin(extent[:, 0] * extent[:, 1])]
    width, height = np.ptp(hull @ turn.T, axis=0)
    return turn if width >= height else np.array([[0.0, 1.0], [-1.0, 0.0]]) @ turn
