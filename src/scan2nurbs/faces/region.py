"""The default grouping: functional surfaces as basins between the edges, and which of them is wanted.

A flood from inside a surface leaks through any gap in its boundary. The basins of the distance to the nearest edge do not: a
gap narrower than twice the clearance of the seeds separates them as a wall would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.detect import Edges
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.kernels.graph import components
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.runner import thread_count
from scan2nurbs.scale import Scale

NEIGHBOURS = 8
# The mean of half a disc lies 4/(3π) = 0.42 of its radius off its centre: beyond 0.28 a third of the ball or more is empty.
BORDER_RADIUS = 3.0
BORDER_OFFSET = 0.28
# The band of edge points is about two spacings wide on either side of an edge; normals of one surface differ little in it.
RIM_RINGS = 4
RIM_COSINE = math.cos(math.radians(12.0))


@dataclass(frozen=True, kw_only=True)
class RegionParams:
    """How to group the points into functional surfaces, and which one to take.

    Attributes
    ----------
    seed : (float, float, float), optional
        A place on the wanted surface, in the input's coordinates. Without it the largest surface that edges enclose is taken, if
        it has a quarter of the largest one's area, else the largest one.
    clearance : float
        Seeds of a surface keep this distance from edges, in h, (0, inf); gaps of twice as much in a boundary do not leak.
    min_points : int
        Smaller surfaces are left ungrouped, [3, inf).
    """

    seed: tuple[float, float, float] | None = None
    clearance: float = 3.0
    min_points: int = 30

    def __post_init__(self) -> None:
        """Check every range."""
        if self.seed is not None and not np.isfinite(np.asarray(self.seed, dtype=float)).all():
            raise ParameterError(f"The 'seed' of group_points must be three finite numbers. Got {self.seed!r} instead.")
        if not 0.0 < self.clearance < np.inf:
            raise ParameterError(f"The 'clearance' of group_points must be a float in (0, inf). Got {self.clearance!r} instead.")
        if self.min_points < 3:
            raise ParameterError(f"The 'min_points' of group_points must be an int in [3, inf). Got {self.min_points!r} instead.")


@dataclass(frozen=True)
class Candidate:
    """A functional surface that was found.

    Attributes
    ----------
    label : int
        Its number.
    n_points : int
        How many points it has.
    area : float
        Their area, from the local spacing, in the cloud's squared unit.
    enclosed : float
        Share of its rim that is an edge, not the border of the scan.
    place : (3,) float64
        The point of it that lies farthest from every edge, in the cloud's local frame: a seed for it.
    """

    label: int
    n_points: int
    area: float
    enclosed: float
    place: NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """One functional surface, and the others beside it.

    Attributes
    ----------
    inside : (N,) bool
        Points of the chosen surface, without those on its edges.
    rim : (N,) bool
        Points marked as on an edge that continue the chosen surface up to it: their one-sided normals agree.
    label : (N,) int32
        Surface of every point, largest area first; −1 where none.
    border : (N,) bool
        Points at the border of the scan.
    chosen : int
        The label of the chosen surface.
    candidates : tuple of Candidate
        All surfaces, largest area first.
    """

    inside: NDArray[np.bool_]
    rim: NDArray[np.bool_]
    label: NDArray[np.int32]
    border: NDArray[np.bool_]
    chosen: int
    candidates: tuple[Candidate, ...]


def group_points(points: NDArray[np.float64], scale: Scale, edges: Edges, on_edge: NDArray[np.bool_], params: RegionParams) -> Region:
    """Group the points into functional surfaces and choose one.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    scale : Scale
        What `measure_scale` said of them.
    edges : Edges
        The detected edges, for their normals.
    on_edge : (N,) bool
        The edge points that are left after filters and corrections.
    params : RegionParams
        Clearance, seed and least size; the seed in the cloud's local frame.

    Raises
    ------
    NoResultError
        If no surface of the least size is left between the edges.

    Notes
    -----
    Seeds are the connected parts of the points farther than the clearance from any edge. They grow over smooth links towards the
    edges, and two of them are one surface after all where the points in which they meet are mostly clear of edges: a neck,
    not a wall with a gap.
    """
    order = scale.cells.order
    sorted_points, edge = scale.cells.points, on_edge[order]
    neighbours, distance = nearest_neighbours(scale.cells, min(NEIGHBOURS, len(points) - 1))
    smooth = _smooth_links(sorted_points, edges.normal[order], neighbours, distance, scale)
    to_edge = _distance_to_edges(sorted_points, edge, 8.0 * max(params.clearance, 1.0) * scale.h)
    grown = np.full(len(edge), -1, np.int32)
    for clearance in (params.clearance, 0.5 * params.clearance):  # then the surfaces too narrow for the first
        seeds = components(neighbours, (grown < 0) & (to_edge >= clearance * scale.h), smooth)
        seeds = _drop_small(seeds, params.min_points)
        labels = np.where(seeds >= 0, seeds + 1 + grown.max(initial=-1), grown).astype(np.int32)
        grown = _grow(labels, neighbours, smooth, ~edge)
    if grown.max(initial=-1) < 0:
        raise NoResultError(
            f"No functional surface of at least {params.min_points} points lies between the edges: "
            f"{int(np.count_nonzero(edge))} of {len(edge)} points are on an edge. A larger threshold or radius marks fewer."
        )
    labels = _merge_necks(_grow(grown, neighbours, smooth, np.ones(len(edge), bool)), grown, neighbours, smooth, edge)
    border = _at_border(scale)
    area = scale.local_h[order] ** 2
    labels, candidates = _ranked(labels, sorted_points, area, to_edge, edge, border, neighbours)
    chosen = _choose(candidates, labels, sorted_points, params.seed)
    rim = _continue(labels == chosen, edge, neighbours, smooth, edges.normal[order])
    label_of, rim_of, border_of = np.empty(len(order), np.int32), np.empty(len(order), bool), np.empty(len(order), bool)
    label_of[order], rim_of[order], border_of[order] = labels, rim, border
    return Region(inside=label_of == chosen, rim=rim_of, label=label_of, border=border_of, chosen=chosen, candidates=candidates)


def _smooth_links(
    points: NDArray[np.float64], normal: NDArray[np.float64], neighbours: NDArray[np.int32], distance: NDArray[np.float64], scale: Scale
) -> NDArray[np.bool_]:
    """Tell which links run along the surface: neither across a thin wall nor over a gap that is wide for the spacing."""
    smooth = (neighbours >= 0) & (distance < 4.0 * scale.h)
    for k in range(neighbours.shape[1]):
        step = points[neighbours[:, k]] - points
        height = np.abs(np.einsum("ij,ij->i", step, normal))
        # A slope of 45 degrees beyond what noise alone lifts; an undefined normal forbids nothing.
        smooth[:, k] &= ~(height > 4.0 * scale.noise + 0.7 * distance[:, k])
    return smooth


def _distance_to_edges(points: NDArray[np.float64], edge: NDArray[np.bool_], far: float) -> NDArray[np.float64]:
    if not edge.any():
        return np.full(len(points), far)
    distance, _ = KDTree(points[edge]).query(points, distance_upper_bound=far, workers=thread_count())
    return np.minimum(distance, far)


def _drop_small(labels: NDArray[np.int32], least: int) -> NDArray[np.int32]:
    size = np.bincount(labels[labels >= 0], minlength=1)
    number = np.where(size >= least, np.cumsum(size >= least) - 1, -1).astype(np.int32)
    return np.where(labels >= 0, number[labels], -1).astype(np.int32)


def _grow(
    labels: NDArray[np.int32], neighbours: NDArray[np.int32], smooth: NDArray[np.bool_], allowed: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Let each unlabelled allowed point take the label of its nearest labelled neighbour, ring by ring."""
    labels = labels.copy()
    waiting = np.flatnonzero((labels < 0) & allowed)
    while len(waiting):
        offered = np.where(smooth[waiting], labels[neighbours[waiting]], -1)
        first = np.argmax(offered >= 0, axis=1)
        taken = offered[np.arange(len(waiting)), first]
        if not (taken >= 0).any():
            break
        labels[waiting] = taken
        waiting = waiting[taken < 0]
    return labels


def _merge_necks(
    everywhere: NDArray[np.int32],
    grown: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    smooth: NDArray[np.bool_],
    edge: NDArray[np.bool_],
) -> NDArray[np.int32]:
    """Join surfaces whose common border is mostly clear of edges; `everywhere` has labels on the edge points too."""
    n = int(grown.max()) + 1
    clear, walled = np.zeros(n * n), np.zeros(n * n)
    for k in range(neighbours.shape[1]):
        a, b = everywhere, everywhere[neighbours[:, k]]
        meet = (neighbours[:, k] >= 0) & (a >= 0) & (b >= 0) & (a != b)
        pair = np.minimum(a, b)[meet].astype(np.int64) * n + np.maximum(a, b)[meet]
        wall = (edge | edge[neighbours[:, k]] | ~smooth[:, k])[meet]
        clear += np.bincount(pair[~wall], minlength=n * n)
        walled += np.bincount(pair[wall], minlength=n * n)
    parent = np.arange(n)
    for pair in np.flatnonzero(clear > walled):
        a, b = (_root_of(parent, int(i)) for i in divmod(int(pair), n))
        parent[max(a, b)] = min(a, b)
    roots = np.array([_root_of(parent, i) for i in range(n)])
    return np.where(grown >= 0, roots[grown], -1).astype(np.int32)


def _root_of(parent: NDArray[np.int64], i: int) -> int:
    while parent[i] != i:
        i = int(parent[i])
    return i


def _continue(
    inside: NDArray[np.bool_],
    edge: NDArray[np.bool_],
    neighbours: NDArray[np.int32],
    smooth: NDArray[np.bool_],
    normal: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Follow a surface ring by ring into the band of edge points, as far as their normals agree with it."""
    taken, waiting = inside.copy(), np.flatnonzero(edge)
    for _ in range(RIM_RINGS):
        near = neighbours[waiting]
        parallel = np.abs(np.einsum("nkj,nj->nk", normal[near], normal[waiting])) > RIM_COSINE
        joins = (parallel & smooth[waiting] & taken[near]).sum(axis=1) >= 2
        if not joins.any():
            break
        taken[waiting[joins]] = True
        waiting = waiting[~joins]
    return taken & ~inside


def _at_border(scale: Scale) -> NDArray[np.bool_]:
    """Find the points at the border of the scan: the mean of the points about them lies far to one side, along the surface."""
    radius = BORDER_RADIUS * scale.h
    balls = ball_planes(scale.cells, radius)
    along = balls.mean - np.einsum("ij,ij->i", balls.mean, balls.normal)[:, None] * balls.normal
    return np.linalg.norm(along, axis=1) > BORDER_OFFSET * radius


def _ranked(
    labels: NDArray[np.int32],
    points: NDArray[np.float64],
    area: NDArray[np.float64],
    to_edge: NDArray[np.float64],
    edge: NDArray[np.bool_],
    border: NDArray[np.bool_],
    neighbours: NDArray[np.int32],
) -> tuple[NDArray[np.int32], tuple[Candidate, ...]]:
    """Sort the surfaces by decreasing area and describe each."""
    kept, compact = np.unique(labels[labels >= 0], return_inverse=True)
    total = np.bincount(compact, weights=area[labels >= 0])
    rank = np.empty(len(kept), np.int32)
    rank[np.argsort(-total, kind="stable")] = np.arange(len(kept))
    numbered = np.full(len(labels), -1, np.int32)
    numbered[labels >= 0] = rank[compact]
    rim = (numbered >= 0) & edge[neighbours].any(axis=1)
    open_rim = (numbered >= 0) & border & ~rim
    candidates = []
    for label in range(len(kept)):
        mine = np.flatnonzero(numbered == label)
        walls, opens = int(rim[mine].sum()), int(open_rim[mine].sum())
        candidates.append(
            Candidate(
                label=label,
                n_points=len(mine),
                area=float(area[mine].sum()),
                enclosed=walls / (walls + opens) if walls + opens else 0.0,
                place=points[mine[np.argmax(to_edge[mine])]].copy(),
            )
        )
    return numbered, tuple(candidates)


def _choose(
    candidates: tuple[Candidate, ...], labels: NDArray[np.int32], points: NDArray[np.float64], seed: tuple[float, float, float] | None
) -> int:
    if seed is not None:
        grouped = np.flatnonzero(labels >= 0)
        _, nearest = KDTree(points[grouped]).query(np.asarray(seed, dtype=float))
        return int(labels[grouped[nearest]])
    for candidate in candidates:
        if candidate.enclosed > 0.5 and candidate.area >= 0.25 * candidates[0].area:
            return candidate.label
    return 0
