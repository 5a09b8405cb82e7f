"""Group the points of a whole part into faces, each with the surface that explains it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.detect import Edges
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.compete import Sheet, along_the_surface, link_weights
from scan2nurbs.faces.contacts import face_contacts, smooth_contacts
from scan2nurbs.faces.finish import face_fits, rank_faces, refits, spread_labels, swept_fits
from scan2nurbs.faces.freeform import Pieces, join_freeform
from scan2nurbs.faces.primitives import find_primitives
from scan2nurbs.faces.settle import settle_borders
from scan2nurbs.kernels.bends import bends
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.primitives import KIND_NAMES, PATCH
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.ranges import require_float, require_int
from scan2nurbs.scale import Scale, measure_scale
from scan2nurbs.surfaces.shape import KINDS, Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit

_OWNER = "segment_points"

NEIGHBOURS = 12
TILT = 0.12
"""Sine of the angle by which normals of some two dozen noisy points stray."""
LEAST_NOISE = 0.05
"""Smaller noise than this, in h, is not believed: surfaces of a scan are never so exact, and starts of fits not either."""


@dataclass(frozen=True, kw_only=True)
class SegmentParams:
    """How to group points into faces; without arguments everything follows from noise and spacing.

    Attributes
    ----------
    tolerance : float, optional
        Points this far from a surface still belong to it, in the cloud's unit, (0, inf); None: three times the noise. It stands for the
        noise where parts are less exact than scans: castings, worn surfaces.
    max_faces : int, optional
        Keep at most so many faces, the largest, [1, inf); the points of the others belong to none.
    keep_types : tuple of str, optional
        Kinds of surfaces that faces may have; None: all of `KINDS`.
    min_points : int
        Smaller faces are given to their neighbours, [6, inf): twelve points hardly tell a surface.
    most_points : int
        Larger clouds are segmented on so many evenly chosen points, the others then follow, [1000, inf): faces are known well enough
        from them, and the time stays bounded.
    """

    tolerance: float | None = None
    max_faces: int | None = None
    keep_types: tuple[str, ...] | None = None
    min_points: int = 12
    most_points: int = 150_000

    def __post_init__(self) -> None:
        """Check every range."""
        if self.tolerance is not None:
            require_float(self.tolerance, "tolerance", _OWNER, 0)
        if self.max_faces is not None:
            require_int(self.max_faces, "max_faces", _OWNER, 1)
        require_int(self.min_points, "min_points", _OWNER, 6)
        require_int(self.most_points, "most_points", _OWNER, 1000)
        kinds = self.keep_types
        if kinds is not None and (not isinstance(kinds, tuple) or not kinds or any(kind not in KINDS for kind in kinds)):
            raise ParameterError(f"The 'keep_types' of segment_points must be among {', '.join(KINDS)}. Got {self.keep_types!r} instead.")

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """The kinds of surfaces that faces may have, in the order of `KINDS`."""
        return tuple(kind for kind in KINDS if self.keep_types is None or kind in self.keep_types)


@dataclass(frozen=True)
class Faces:
    """Which face every point belongs to, and the surface of each face.

    Attributes
    ----------
    label : (N,) int32
        Face of every point, numbered by falling size; −1 = none.
    fits : tuple of ShapeFit
        One a face.
    smooth : frozenset of (int, int)
        Pairs (i < j) of neighbouring faces that meet smoothly.
    notes : tuple of str
        What the caller should know, one sentence each.
    by_edges : bool
        Whether it mattered which points are marked as lying on an edge. That is asked only where smooth pieces meet which are not
        tangent, or make a long chain, whether they are one freeform face; elsewhere faces follow from the edges' normals alone.
    """

    label: NDArray[np.int32]
    fits: tuple[ShapeFit, ...]
    smooth: frozenset[tuple[int, int]]
    notes: tuple[str, ...] = ()
    by_edges: bool = False


def segment_points(
    points: NDArray[np.float64], scale: Scale, edges: Edges, params: SegmentParams, progress: Progress | None = None
) -> Faces:
    """Group points into faces.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    scale : Scale
        What `measure_scale` said of them.
    edges : Edges
        The detected edges: their one-sided normals, and the marked points for the borders of freeform faces.
    params : SegmentParams
    progress : callable, optional
        Called with (steps done, steps).

    Notes
    -----
    Primitives are grown from seeds where the surface bends evenly, then compete for the points (the energy of PEARL, Isack and Boykov
    2012: distances and normals, a cost where neighbours differ, a cost a model), are fitted anew and joined where that pays. Time is
    linear in the points; the result depends on the points and parameters alone.
    """
    chosen, part_scale = np.arange(len(points)), scale
    if len(points) > params.most_points:
        chosen = np.sort(scale.cells.order[:: -(-len(points) // params.most_points)])
        part_scale = measure_scale(points[chosen])
    sheet, one_sided, curvature = _sheet(part_scale, edges.normal[chosen], params)
    kinds = allowed_kinds(params.keep_types)
    piece, models = find_primitives(sheet, one_sided, curvature, kinds, params.min_points, progress)
    label = np.empty(len(chosen), np.int32)
    label[part_scale.cells.order] = piece
    if len(chosen) < len(points):
        label = spread_labels(points, label, part_scale, models, sheet)
    noise = sheet.sigma * part_scale.h
    label, kept = rank_faces(label, None)
    allowed = list(params.kinds)
    pieces = Pieces(points, edges.normal, label, face_fits(points, edges.normal, label, models[kept], noise, part_scale.h, allowed))
    if kinds[PATCH]:
        pieces = join_freeform(pieces, edges.mask, scale, noise, allowed)
    label, kept = rank_faces(settle_borders(points, pieces.label, pieces.fits, scale, noise), params.max_faces)
    fits = swept_fits(points, label, refits(points, label, [pieces.fits[k] for k in kept], noise), noise, allowed)
    smooth = smooth_contacts(points, label, face_contacts(label, scale), fits, scale)
    notes = _tolerance_notes(params, part_scale)
    return Faces(label=label, fits=fits, smooth=frozenset(contact.pair for contact in smooth), notes=notes, by_edges=pieces.by_edges)


def _sheet(scale: Scale, normals: NDArray[np.float64], params: SegmentParams) -> tuple[Sheet, NDArray[np.float64], NDArray[np.float64]]:
    """Return the cloud in units of h with its graph, in the order of the sorted points, its one-sided normals and its curvatures."""
    cells = scale.cells
    neighbours, _ = nearest_neighbours(cells, NEIGHBOURS, reach=2.0 * scale.h)
    local = cells.points / scale.h
    one_sided = np.ascontiguousarray(normals[cells.order])
    neighbours = along_the_surface(local, one_sided, neighbours, _noise(params, scale) / scale.h)
    curvature, smooth_normals = bends(local, one_sided, neighbours)
    sheet = Sheet(
        points=local,
        normals=smooth_normals,
        neighbours=neighbours,
        weights=link_weights(smooth_normals, neighbours),
        sigma=_noise(params, scale) / scale.h,
        tilt=TILT,
    )
    return sheet, one_sided, curvature


def allowed_kinds(keep_types: tuple[str, ...] | None) -> NDArray[np.bool_]:
    """Tell which kinds of models may be tried."""
    return np.array([keep_types is None or name in keep_types for name in KIND_NAMES], bool)


def _tolerance_notes(params: SegmentParams, scale: Scale) -> tuple[str, ...]:
    least = 3.0 * _noise(replace(params, tolerance=None), scale)
    if params.tolerance is None or params.tolerance > least:
        return ()
    return (f"A tolerance of {params.tolerance:.3g} changes nothing: points {least:.3g} from a surface belong to it by their noise.",)


def _noise(params: SegmentParams, scale: Scale) -> float:
    noise = max(1.05 * scale.noise, LEAST_NOISE * scale.h)
    return noise if params.tolerance is None else max(params.tolerance / 3.0, noise)
