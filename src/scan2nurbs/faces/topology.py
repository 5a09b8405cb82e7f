"""From labelled points and a surface a face to a cell complex that is consistent by construction: it is read off one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.bridge import bridge
from scan2nurbs.faces.complex import Border, LabelledMesh, Loop, Topology
from scan2nurbs.faces.double import part_double_edges
from scan2nurbs.faces.draw import draw
from scan2nurbs.faces.gaps import is_covered, is_pinhole, to_the_rim
from scan2nurbs.faces.merge import merge_vertices
from scan2nurbs.faces.orient import find_patches, outward_signs
from scan2nurbs.faces.pinholes import close_pinholes
from scan2nurbs.faces.regions import find_regions
from scan2nurbs.faces.relabel import Samples, take_samples
from scan2nurbs.faces.sheet import Sheet, components, drop_triangles, peel, span_sheet, triangle_areas
from scan2nurbs.faces.split import split_mesh
from scan2nurbs.faces.trace import Closed, Traced, cap_holes, genera, trace
from scan2nurbs.faces.tunnels import without_tunnels
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.kernels.tucking import tuck_in
from scan2nurbs.ranges import require_float, require_int
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.shape import Floats, Shape

__all__ = ["Border", "LabelledMesh", "Loop", "Topology", "TopologyParams", "find_topology"]

STAGES = 5
BRIDGES = 3
PINHOLE = 50.0
"""Gaps in a face of less area than this, in h², a circle of four h, are chance and no missing data."""
CIRCUMFERENCE = float(np.sqrt(np.pi * PINHOLE))
"""A quarter of the area within a face counts as chance anywhere, too: so does a hole with the circumference of such a circle, in h."""
_NEVER_CLOSED = ("plane", "cylinder", "cone", "extrusion")
"""Surfaces that enclose nothing."""


class Fitted(Protocol):
    """What is known of a face's surface."""

    @property
    def shape(self) -> Shape:
        """The surface."""
        ...


@dataclass(frozen=True, kw_only=True)
class TopologyParams:
    """How a cell complex is made of points.

    Attributes
    ----------
    fill_holes : bool
        Whether missing data is bridged; else the scan ends there.
    reach : float
        Farthest, in local spacings, that a place of the surface may lie from the points of the scan; in [1, inf).
    least_area : float
        Least area of a piece of surface that is kept, in h²; in [0, inf).
    max_points : int
        Clouds with more points are thinned; at least 1000.
    """

    fill_holes: bool = False
    reach: float = 2.5
    least_area: float = 20.0
    max_points: int = 150_000

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        require_float(self.reach, "reach", "find_topology", 1, closed="low")
        require_float(self.least_area, "least_area", "find_topology", 0, closed="low")
        require_int(self.max_points, "max_points", "find_topology", 1000)


def find_topology(
    points: Floats,
    label: NDArray[np.int32],
    fits: Sequence[Fitted],
    scale: Scale,
    params: TopologyParams | None = None,
    progress: Progress | None = None,
    *,
    reading: int = 0,
) -> Topology:
    """Find the faces, borders and vertices of a part.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    label : (N,) int32
        Face of each point, −1 for none.
    fits : sequence with ``shape``
        Surface of each face.
    scale : Scale
        What `measure_scale` said of the points.
    params : TopologyParams, optional
    progress : callable, optional
        Called with (stages done, stages).
    reading : int
        0, or which tenth of the points to leave out, from 1 to 10, so that borders are drawn through others.

    Raises
    ------
    NoResultError
        If no surface can be spanned through the labelled points.

    Notes
    -----
    Every point moves onto the surface of its face, so that normals are exact up to one sign a face; the signs follow from how
    neighbouring faces lie to each other. The Delaunay tetrahedra of these points are parted into inside and outside, and the triangles
    between the two are one oriented manifold, of which regions, borders and vertices are read. So every border has two sides, and all
    half-edges pair. Deterministic.
    """
    params = params or TopologyParams()
    tell = (lambda done: progress(done, STAGES)) if progress else (lambda _done: None)
    samples = take_samples(points, label, [f.shape for f in fits], scale, params.max_points, reading)
    if len(samples.points) < 4:
        raise NoResultError(f"Only {len(samples.points)} points lie on the surfaces of faces: too few for a part.")
    tell(1)
    patch = find_patches(samples.label, samples.neighbours[:, :8])
    signs = outward_signs(samples.points, samples.normals, patch, samples.neighbours, 2.0 * samples.spacing)
    outward = samples.normals * signs[patch][:, None]
    tucked = tuck_in(samples.points, outward, samples.label, samples.neighbours, 2.0 * samples.spacing)
    tell(2)
    sheet = span_sheet(tucked, outward, samples.h)
    tell(3)
    sheet, notes = _trim(sheet, tucked, outward, samples, scale, params)
    tell(4)
    topology = _read(sheet, tucked, signs[patch], samples, [f.shape for f in fits], notes)
    missing = len(np.setdiff1d(label[label >= 0], topology.source))
    if missing:
        few = f"{missing} faces have" if missing > 1 else "1 face has"
        topology = replace(topology, notes=(*topology.notes, f"{few} no part in the surface that borders were read from."))
    tell(5)
    return topology


def _trim(sheet: Sheet, points: Floats, outward: Floats, samples: Samples, scale: Scale, params: TopologyParams) -> tuple[Sheet, list[str]]:
    """Open the surface where there is no data, and drop pieces too small to be a part."""
    if not params.fill_holes:
        covered = is_covered(sheet, points, samples.spacing, scale.cells, params.reach)
        covered = to_the_rim(sheet, points, samples.spacing, covered, params.reach)
        sheet = drop_triangles(sheet, covered | is_pinhole(sheet, points, samples.label, covered, PINHOLE * samples.h**2))
        sheet = close_pinholes(peel(sheet, points, outward), points, CIRCUMFERENCE * samples.h)
    n, piece = components(sheet)
    area = np.bincount(piece, triangle_areas(points, sheet.source[sheet.triangles]), minlength=n)
    small = area < params.least_area * samples.h**2
    small[np.argmax(area)] = False
    lost = int(np.count_nonzero(small))
    if lost:
        sheet = drop_triangles(sheet, ~small[piece])
    return sheet, [f"{lost} specks of surface, {area[small].sum():.3g} in area, were left out."] if lost else []


def _read(sheet: Sheet, points: Floats, sign: NDArray[np.int8], samples: Samples, shapes: list[Shape], notes: list[str]) -> Topology:
    whole = sheet
    sheet, place = part_double_edges(whole, points[whole.source])
    mesh = cap_holes(sheet)
    region, source, traced = _regions(sheet, mesh, place, samples, shapes)
    bubble = _bubbles(sheet, region, [shapes[s].kind for s in source])
    if bubble.any() and not bubble.all():
        notes = [*notes, "Closed specks of surface between the points of one face were left out."]
        return _read(drop_triangles(whole, ~bubble[: len(whole.triangles)]), points, sign, samples, shapes, notes)
    own = [shapes[s] for s in source]
    drawn = draw(mesh, traced, place, region, own, samples.h)
    n_loops = np.array([len(loops) for loops in traced.loops], np.int64)
    labelled = split_mesh(mesh, traced, drawn, place, region)
    body, closed = _bodies(sheet, place, region, traced.sides, len(source))
    outward = np.where(np.bincount(region, sign[sheet.source], minlength=len(source)) < 0, -1, 1).astype(np.int8)
    traced, drawn = merge_vertices(traced, drawn, own, samples.h)
    traced, drawn = without_tunnels(traced, drawn, own, outward, samples.h, CIRCUMFERENCE * samples.h)
    borders = tuple(
        Border(line, (int(a), int(b)), (int(u), int(v)))
        for line, (a, b), (u, v) in zip(drawn.lines, traced.sides, traced.ends, strict=True)
    )
    return Topology(
        drawn.vertices, borders, traced.loops, source, outward, body, closed, genera(mesh, region, n_loops), labelled, tuple(notes)
    )


def _bubbles(sheet: Sheet, region: NDArray[np.int32], kinds: Sequence[str]) -> NDArray[np.bool_]:
    """Tell which triangles close up on a single surface that encloses nothing: they are spanned between points of its noise."""
    n, piece = components(sheet)
    low, high = np.full(n, len(kinds)), np.full(n, -1)
    np.minimum.at(low, piece, region[sheet.triangles].min(axis=1))
    np.maximum.at(high, piece, region[sheet.triangles].max(axis=1))
    is_open = np.zeros(n, bool)
    is_open[piece[np.flatnonzero(sheet.twin < 0) // 3]] = True
    flat = np.array([kind in _NEVER_CLOSED for kind in kinds], bool)
    return (~is_open & (low == high) & flat[low])[piece]


def _regions(
    sheet: Sheet, mesh: Closed, place: Floats, samples: Samples, shapes: list[Shape]
) -> tuple[NDArray[np.int32], NDArray[np.int32], Traced]:
    region, source = find_regions(sheet, samples.label[sheet.source])
    traced = trace(mesh, region)
    for _ in range(BRIDGES):
        label = bridge(mesh, traced, region, source, place, shapes, samples.spread, samples.h)
        if np.array_equal(label, source[region]):
            break
        region, source = find_regions(sheet, label)
        traced = trace(mesh, region)
    return region, source, traced


def _bodies(
    sheet: Sheet, points: Floats, region: NDArray[np.int32], sides: NDArray[np.int32], n: int
) -> tuple[NDArray[np.int32], tuple[bool, ...]]:
    """Count off the connected bodies by falling area."""
    count, piece = components(sheet)
    area = np.bincount(piece, triangle_areas(points, sheet.triangles), minlength=count)
    rank = np.empty(count, np.int32)
    rank[np.argsort(-area, kind="stable")] = np.arange(count, dtype=np.int32)
    body = np.empty(n, np.int32)
    body[region[sheet.triangles[:, 0]]] = rank[piece]
    is_open = np.zeros(count, bool)
    is_open[body[sides[sides[:, 1] < 0, 0]]] = True
    return body, tuple(bool(b) for b in ~is_open)
