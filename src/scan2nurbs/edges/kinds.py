"""What kind of edge a point lies on (convex, concave, corner, border of the scan), how much the surface turns, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.breaks import fit_radius
from scan2nurbs.edges.detect import Edges
from scan2nurbs.edges.orient import Creases, Orientation, orient_normals
from scan2nurbs.kernels.cells import Cells, sorted_rows, unsorted
from scan2nurbs.kernels.creases import fit_wedges
from scan2nurbs.kernels.nearest import nearest_indices
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.kernels.thickness import thickness
from scan2nurbs.kernels.within import within_reach
from scan2nurbs.scale import Scale

NONE, CONVEX, CONCAVE, BORDER, CORNER = range(5)
KIND_NAMES = ("none", "convex", "concave", "border", "corner")

WIDE = ("dn", "vdn", "edn", "one-sided")
NEIGHBOURS = 8
# Feet of wedges farther from their point than this, in h, belong to another edge.
FOOT_REACH = 3.0
# Radius in h within which both faces are looked at: this times the root of the noise in h, within the bounds.
LOOK, LOOK_RANGE = 10.0, (4.0, 9.0)
# How many times thicker than noise a neighbourhood of one face may be, and how far from a border, in h, normals may be of two.
THICK, FEW, BESIDE = 1.4, 3, 4.0
# Directions of the creases within CORNER_RADIUS (h) spread over more than CORNER_SPREAD of their trace: a corner.
CORNER_RADIUS, CORNER_SPREAD, CORNER_NOISE, CORNER_COUNT = 2.0, 0.2, 1.0, 3
# One edge point of so many is asked for its crease; the others take the nearest.
EVERY = 2


@dataclass(frozen=True)
class EdgeKinds:
    """The kind of every point.

    Attributes
    ----------
    kind : (N,) uint8
        0 on no edge, 1 convex, 2 concave, 3 border of the scan, 4 corner.
    angle : (N,) float64
        Degrees by which the surface turns at the edge, in [0, 180]: 180 minus the dihedral angle inside a convex edge. 180 at a border,
        where one face ends; NaN on no edge, and where it cannot be measured.
    angle_error : (N,) float64
        Standard deviation of the angle, in degrees; NaN as the angle.
    confidence : (N,) float64
        In [0, 1]: how sure edge and kind are; 0 on no edge.
    outline : (N,) bool
        Border points where a sheet ends, rather than a gap in the data.
    """

    kind: NDArray[np.uint8]
    angle: NDArray[np.float64]
    angle_error: NDArray[np.float64]
    confidence: NDArray[np.float64]
    outline: NDArray[np.bool_]


def edge_kinds(scale: Scale, edges: Edges, progress: Progress | None = None) -> EdgeKinds:
    """Tell the kinds of edge points.

    Parameters
    ----------
    scale : Scale
        What `measure_scale` said of the cloud.
    edges : Edges
        What `detect` found, in the cloud's order.
    progress : callable, optional
        Called with (done, all).

    Notes
    -----
    Each edge point's crease is fitted anew with the two faces that meet in it. Their directions give the angle, and its error from the
    points' scatter; with oriented normals (see `orient_normals`) they give the kind. Where creases of several directions meet is a
    corner.
    """
    cells = scale.cells
    order = cells.order
    on_edge = edges.mask[order]
    assert edges.borders is not None  # the operators whose edges have kinds look for them
    borders = edges.borders.sorted(cells)
    rows = np.flatnonzero(on_edge & ~borders.outline)
    asked = rows[::EVERY]
    creases, usable = _creases(scale, asked)
    found = _oriented(scale, sorted_rows(cells, edges.normal), on_edge | _beside(cells, borders.mask, scale), creases, progress)
    kinds = _of_creases(scale, rows, asked, creases, found, usable & np.isfinite(found.sides.turn))
    ends = borders.mask & ~(on_edge & (kinds.confidence > 0.0))
    kinds.kind[ends] = BORDER
    kinds.angle[ends], kinds.angle_error[ends] = 180.0, 0.0
    kinds.confidence[ends] = borders.openness[ends]
    values = (kinds.kind, kinds.angle, kinds.angle_error, kinds.confidence, borders.outline)
    return EdgeKinds(*(unsorted(cells, value) for value in values))


def with_kinds(scale: Scale, edges: Edges, progress: Progress | None = None) -> Edges:
    """Return the edges with the kind of every point; borders where a sheet ends count as edges.

    The paper's operators and one-sided normals mark wide bands, and come back as they are: kinds belong to thin edges.
    """
    if any(operator in WIDE for operator, _ in edges.runs):
        return edges
    kinds = edge_kinds(scale, edges, progress)
    return replace(
        edges,
        mask=edges.mask | kinds.outline,
        kind=kinds.kind,
        angle=kinds.angle,
        angle_error=kinds.angle_error,
        confidence=kinds.confidence,
        borders=None,
    )


def _oriented(
    scale: Scale, normal: NDArray[np.float64], doubtful: NDArray[np.bool_], creases: Creases, progress: Progress | None
) -> Orientation:
    """Orient the normals by those that are of one face for sure."""
    cells = scale.cells
    neighbours = nearest_indices(cells, min(NEIGHBOURS, len(normal) - 1), reach=2.5 * scale.h, progress=progress)
    return orient_normals(cells, normal, neighbours, doubtful | _thick(cells, normal, neighbours, scale), creases, scale.noise)


def _thick(cells: Cells, normal: NDArray[np.float64], neighbours: NDArray[np.int32], scale: Scale) -> NDArray[np.bool_]:
    """Tell whose neighbours lie farther off its plane than noise puts them: two sides of something thin, whose normals may be either's."""
    thick = thickness(cells.points, normal, neighbours) > THICK * (np.sqrt(2.0) * scale.noise + 0.1 * scale.h)
    # Chance makes single points look thick, and where it is thick single points thin.
    return thick | (thick[neighbours].sum(axis=1) >= FEW)


def _beside(cells: Cells, mask: NDArray[np.bool_], scale: Scale) -> NDArray[np.bool_]:
    """Tell which points lie near some of them."""
    return within_reach(cells, mask, BESIDE * scale.h + scale.noise)


def _creases(scale: Scale, rows: NDArray[np.int64]) -> tuple[Creases, NDArray[np.bool_]]:
    """Fit a wedge at each edge point; tell where there is one nearby."""
    h, radius = scale.h, fit_radius(scale.noise / scale.h) * scale.h
    places = np.ascontiguousarray(scale.cells.points[rows])
    wedges = fit_wedges(scale.cells, places, radius, scale.noise, rounds=2)
    with np.errstate(invalid="ignore"):
        usable = np.linalg.norm(wedges.foot - places, axis=1) <= FOOT_REACH * h + scale.noise
    turn = np.where(usable, np.nan_to_num(wedges.angle), 0.0)
    # A known crease is looked at from farther than it is searched for: the angle's error falls with the square of the radius.
    looked_at = float(np.clip(LOOK * np.sqrt(scale.noise / h), *LOOK_RANGE)) * h
    return Creases(np.nan_to_num(wedges.foot), np.nan_to_num(wedges.direction), turn, looked_at), usable & (turn > 0.0)


def _of_creases(
    scale: Scale,
    rows: NDArray[np.int64],
    asked: NDArray[np.int64],
    creases: Creases,
    found: Orientation,
    good: NDArray[np.bool_],
) -> EdgeKinds:
    """Write what the good creases, of the points asked, say to the edge points (rows) nearest to them."""
    n, h = len(scale.cells.points), scale.h
    kinds = EdgeKinds(np.zeros(n, np.uint8), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n), np.zeros(n, bool))
    towards = found.sides.towards
    with np.errstate(invalid="ignore"):
        side = np.where(np.isfinite(towards).any(axis=1), np.nansum(towards, axis=1), 0.0)
    known = np.flatnonzero(good & (side != 0.0))
    if len(known) == 0:
        kinds.kind[rows] = CONVEX
        return kinds
    places = scale.cells.points[rows]
    near, nearest = KDTree(creases.foot[known]).query(places, min(8, len(known)))
    near, nearest = near.reshape(len(rows), -1), nearest.reshape(len(rows), -1)
    # The side is a matter of the neighbourhood: one wedge gone wrong is outvoted.
    vote = np.where(near <= np.maximum(near[:, :1], FOOT_REACH * h), side[known][nearest], 0.0).mean(axis=1)
    kinds.kind[rows] = np.where(vote > 0.0, CONCAVE, CONVEX)
    own = known[nearest[:, 0]]
    angle, error = np.degrees(found.sides.turn[own]), np.degrees(found.sides.turn_error[own])
    kinds.angle[rows], kinds.angle_error[rows] = angle, error
    seen = 1.0 - np.exp(-0.5 * (angle / (3.0 * np.maximum(error, 1e-3))) ** 2)
    close = np.where(near[:, 0] <= FOOT_REACH * h + scale.noise, 1.0, 0.5)
    kinds.confidence[rows] = close * seen * np.clip(np.abs(vote) / 2.0 + 0.25 * found.agreement[own], 0.0, 1.0)
    kinds.kind[rows[_corners(scale, places, scale.cells.points[asked], creases.direction, good)]] = CORNER
    return kinds


def _corners(
    scale: Scale, places: NDArray[np.float64], middles: NDArray[np.float64], direction: NDArray[np.float64], good: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell at which places creases of several directions, given at their middles, come together."""
    radius = CORNER_RADIUS * scale.h + CORNER_NOISE * scale.noise
    outer = np.einsum("ni,nj->nij", direction, direction).reshape(len(middles), 9) * good[:, None]
    pairs = KDTree(places).sparse_distance_matrix(KDTree(middles), radius, output_type="coo_matrix").tocsr()
    pairs.data[:] = 1.0
    total = (pairs @ outer).reshape(-1, 3, 3)
    count = np.trace(total, axis1=1, axis2=2)
    values = np.linalg.eigvalsh(total)
    return (count >= CORNER_COUNT) & (values[:, 1] > CORNER_SPREAD * np.maximum(count, 1e-300))
