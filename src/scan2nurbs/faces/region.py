"""The default grouping: functional surfaces as basins between the edges, and which of them is wanted.

A flood from inside a surface leaks through any gap in its boundary. The basins of the distance to the nearest edge do not: a
surface and what lies behind the gap are basins of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.breaks import breaks
from scan2nurbs.edges.detect import Edges
from scan2nurbs.edges.operators import Lengths
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.basins import find_surfaces
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.runner import thread_count
from scan2nurbs.ranges import require_int
from scan2nurbs.scale import Scale

NEIGHBOURS = 8
# Beyond this distance from every edge, in h, a point is in the open: no saddle there parts a surface.
FAR = 24.0
# The mean of half a disc lies 4/(3π) = 0.42 of its radius off its centre: beyond 0.28 a third of the ball or more is empty.
BORDER_RADIUS = 3.0
BORDER_OFFSET = 0.28
# Surfaces less enclosed than this are all alike when one is chosen: in a scan without edges the largest is wanted.
LEAST_ENCLOSED = 0.1
# A plane needs no B-spline surface: it is wanted only where nothing else of some size is there.
PLANE_MERIT = 0.25
# An edge point is some wall, however faint the bend.
LEAST_WALL = 0.05
# The band of edge points is about two spacings wide on either side of an edge; normals of one surface differ little in it.
RIM_RINGS = 4
RIM_COSINE = math.cos(math.radians(12.0))


@dataclass(frozen=True, kw_only=True)
class RegionParams:
    """How to group the points into functional surfaces, and which one to take.

    Attributes
    ----------
    seed : (float, float, float), optional
        A place on the wanted surface, in the input's coordinates. Without it the surface is taken whose area times the squared
        share of its rim that is an edge is largest, planes counting a quarter: a large curved one that edges enclose, rather than
        the ground around it.
    min_points : int
        Smaller surfaces are left ungrouped, [3, inf).
    bends_part : bool
        Whether every edge point parts surfaces; by default creases and sharp bends do.
    """

    seed: tuple[float, float, float] | None = None
    min_points: int = 30
    bends_part: bool = False

    def __post_init__(self) -> None:
        """Check every range."""
        if self.seed is not None and not _is_place(self.seed):
            raise ParameterError(f"The 'seed' parameter of group_points must be three finite numbers. Got {self.seed!r} instead.")
        require_int(self.min_points, "min_points", "group_points", 3)


def _is_place(value: object) -> bool:
    try:
        place = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return place.shape == (3,) and bool(np.isfinite(place).all())


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
    planar : bool
        Whether a plane explains its points at their noise.
    place : (3,) float64
        The point of it that lies farthest from every edge, in the cloud's local frame: a seed for it.
    """

    label: int
    n_points: int
    area: float
    enclosed: float
    planar: bool
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
        Seed and least size; the seed in the cloud's local frame.

    Raises
    ------
    NoResultError
        If no surface of the least size is left between the edges.

    Notes
    -----
    See `find_surfaces`. Edges closer together than their own bands (about 4 h) leave no surface between them.
    """
    if len(points) < params.min_points:
        raise NoResultError(f"The scan has only {len(points)} points; a functional surface needs at least {params.min_points}.")
    order = scale.cells.order
    sorted_points, edge = scale.cells.points, on_edge[order]
    neighbours, distance = nearest_neighbours(scale.cells, min(NEIGHBOURS, len(points) - 1))
    smooth = _smooth_links(sorted_points, edges.normal[order], neighbours, distance, scale)
    to_edge = _distance_to_edges(sorted_points, edge, FAR * scale.h)
    level = smooth & _same_normal(edges.normal[order], neighbours, edges.threshold)
    wall = edge.astype(np.float64) if params.bends_part else _walls(edges, edge, order, scale)
    labels = find_surfaces(neighbours, smooth, level, to_edge, wall, scale.h)
    size = np.bincount(labels[labels >= 0], minlength=1)
    labels[(labels >= 0) & (size < params.min_points)[labels]] = -1
    if labels.max(initial=-1) < 0:
        raise NoResultError(
            f"No functional surface of at least {params.min_points} points lies between the edges: "
            f"{int(np.count_nonzero(edge))} of {len(edge)} points are on an edge. A larger threshold or radius marks fewer."
        )
    border = _at_border(scale)
    area = scale.local_h[order] ** 2
    labels, candidates = _ranked(labels, sorted_points, area, to_edge, edge, border, neighbours, scale)
    chosen = _choose(candidates, labels, sorted_points, params.seed)
    rim = _continue(labels == chosen, edge & (labels < 0), neighbours, smooth, edges.normal[order])
    label_of, rim_of, border_of = np.empty(len(order), np.int32), np.empty(len(order), bool), np.empty(len(order), bool)
    label_of[order], rim_of[order], border_of[order] = labels, rim, border
    return Region(inside=label_of == chosen, rim=rim_of, label=label_of, border=border_of, chosen=chosen, candidates=candidates)


def _walls(edges: Edges, edge: NDArray[np.bool_], order: NDArray[np.int32], scale: Scale) -> NDArray[np.float64]:
    """Tell how much each point parts surfaces: fully where the surface breaks, else the more, the more sharply it bends.

    One-sided normals mark a crease of 25 degrees and a bend like a ridge's alike. A crease is a wall; a bend is one where it turns by
    twice the threshold, and a weak one near the threshold, where also noise reaches. Other operators were chosen by the user.
    """
    wall = edge.astype(np.float64)
    if any(name != "one-sided" for name, _ in edges.runs):
        return wall
    band = np.flatnonzero(edge)
    bend = np.clip(edges.strength[order[band]] / edges.threshold - 1.0, LEAST_WALL, 1.0)
    lengths = Lengths(spacing=scale.spacing, h=scale.h, noise=scale.noise)
    wall[band] = np.where(breaks(scale.cells, scale.cells.points[band], lengths), 1.0, bend)
    return wall


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


def _same_normal(normal: NDArray[np.float64], neighbours: NDArray[np.int32], threshold: float) -> NDArray[np.bool_]:
    """Tell which links do not cross a crease: the normals at their ends differ by no more than the edges' threshold, in degrees.

    Points beside a crease are edge points if enough of its other side is near them. Where the lines of a scan run along the crease,
    farther apart than their points, it is not, and only the links tell. An undefined normal forbids nothing.
    """
    cosine = math.cos(math.radians(threshold))
    same = np.empty(neighbours.shape, bool)
    for k in range(neighbours.shape[1]):
        same[:, k] = ~(np.abs(np.einsum("ij,ij->i", normal[neighbours[:, k]], normal)) < cosine)
    return same


def _distance_to_edges(points: NDArray[np.float64], edge: NDArray[np.bool_], far: float) -> NDArray[np.float64]:
    if not edge.any():
        return np.full(len(points), far)
    distance, _ = KDTree(points[edge]).query(points, distance_upper_bound=far, workers=thread_count())
    return np.minimum(distance, far)


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
    scale: Scale,
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
                planar=_is_planar(points[mine], scale),
                place=points[mine[np.argmax(to_edge[mine])]].copy(),
            )
        )
    return numbered, tuple(candidates)


def _is_planar(points: NDArray[np.float64], scale: Scale) -> bool:
    """Tell whether nine points in ten lie as near to one plane as noise allows."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return bool(np.quantile(np.abs(centred @ axes[:, 0]), 0.9) <= 2.5 * max(scale.noise, 0.05 * scale.h))


def _choose(
    candidates: tuple[Candidate, ...], labels: NDArray[np.int32], points: NDArray[np.float64], seed: tuple[float, float, float] | None
) -> int:
    if seed is not None:
        grouped = np.flatnonzero(labels >= 0)
        _, nearest = KDTree(points[grouped]).query(np.asarray(seed, dtype=float))
        return int(labels[grouped[nearest]])

    def merit(found: Candidate) -> float:
        return found.area * max(found.enclosed, LEAST_ENCLOSED) ** 2 * (PLANE_MERIT if found.planar else 1.0)

    return max(candidates, key=merit).label
