"""Faces that do not fit their neighbours: trimmed by an outline of their own, so that none is lost."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.build import build_face
from scan2nurbs.brep.charts import Chart, SplineChart, chart_of
from scan2nurbs.brep.check import is_valid, is_valid_meshed
from scan2nurbs.brep.conform import mesh_surface
from scan2nurbs.brep.crossing import borders_cross
from scan2nurbs.brep.face import trimmed_face
from scan2nurbs.brep.layout import unrolled
from scan2nurbs.brep.measure import tolerance
from scan2nurbs.brep.outline import Loop as Polyline
from scan2nurbs.brep.shared import border_points, trim_faces
from scan2nurbs.brep.wide import widened
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.outline import find_outline
from scan2nurbs.faces.topology import Border, Loop, Topology
from scan2nurbs.surfaces.bspline import BSplineSurface, bicubic
from scan2nurbs.surfaces.shape import Shape

Floats = NDArray[np.float64]

_TOLERANCE = 0.5
_SPANS = 64


def trim_alone(f: int, shape: Shape, topology: Topology, h: float, scale: float) -> tuple[Any, ...]:
    """Trim one face by its own borders, whatever its neighbours do.

    Parameters
    ----------
    f : int
        The face.
    shape : Shape
        Its surface.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.

    Returns
    -------
    tuple of TopoDS_Face
        First by smooth curves along its borders; then by what remains of them once loops that cross are parted, on a patch of the
        surface as a B-spline. Empty where even that fails.
    """
    borders: list[Border] = []
    loops: list[Loop] = []
    for loop in topology.loops[f]:
        path: list[tuple[int, bool]] = []
        for k, forward in loop:
            path.append((len(borders), forward))
            borders.append(replace(topology.borders[k], faces=(0, -1) if forward else (-1, 0)))
        loops.append(tuple(path))
    lone = replace(topology, borders=tuple(borders), loops=(tuple(loops),), outward=topology.outward[f : f + 1])
    for care in (0, 2):
        made = trim_faces([shape], lone, h, scale, [care] * len(borders))
        if not made.failures and all(tolerance(face) <= h * scale and not borders_cross(face, h * scale) for face in made.faces[0]):
            return made.faces[0]
    try:
        return _outlined(widened(shape, border_points(topology, f), h), topology, f, h, scale)
    except (NoResultError, ValueError):
        return ()


def trim_anew(f: int, topology: Topology, h: float, scale: float) -> tuple[Any, ...]:
    """Trim one face on a B-spline surface through its part of the mesh, which has no poles and fits its borders; see `trim_alone`."""
    try:
        return _outlined(widened(mesh_surface(topology, f, h), border_points(topology, f), h), topology, f, h, scale)
    except (NoResultError, ValueError):
        return ()


def trim_by_points(f: int, shape: Shape, topology: Topology, h: float, scale: float) -> tuple[Any, ...]:
    """Trim one face by an outline of its part of the mesh, whatever its borders are: they may enclose nothing; see `trim_alone`."""
    mesh = topology.mesh
    triangles = mesh.triangles[mesh.face == f]
    places = np.vstack([mesh.vertices[np.unique(triangles)], mesh.vertices[triangles].mean(axis=1)])
    for surface in (lambda: shape, lambda: mesh_surface(topology, f, h)):
        try:
            return _within_points(chart_of(widened(surface(), places, h), 1.0), places, topology.outward[f], h, scale)
        except (NoResultError, ValueError):
            continue
    return ()


def _within_points(chart: Chart, places: Floats, outward: int, h: float, scale: float) -> tuple[Any, ...]:
    """Trim a surface by the outline of points on it."""
    if chart.period[1]:
        raise NoResultError("Outlines are found on surfaces that come back to themselves in one direction at most.")
    uv = chart.uv(places)
    lengths = _lengths(chart, uv)
    outline = find_outline(uv * lengths, spacing=h, period=chart.period[0] * lengths[0] if chart.period[0] else None)
    lines = [Polyline(loop.points / lengths, closed=not np.any(loop.shift)) for loop in outline.loops]
    around = (any(not line.closed for line in lines), False)
    surface = chart.surface if isinstance(chart, SplineChart) else _patch(chart, np.vstack([line.uv for line in lines]), around)
    return _trimmed(surface, lines, outward, h, scale)


def _lengths(chart: Chart, uv: Floats) -> Floats:
    """Return what one unit of u and of v is worth in length, on average over parameters (N, 2)."""
    size = 1e-4 * np.ptp(uv, axis=0)
    steps = [np.linalg.norm(chart.point(uv + step) - chart.point(uv), axis=1).mean() for step in np.diag(size)]
    lengths = np.array(steps) / size
    if not (np.isfinite(lengths).all() and lengths.min() > 0.0):
        raise NoResultError("The points lie in one place of the surface.")
    return lengths


def _outlined(shape: Shape, topology: Topology, f: int, h: float, scale: float) -> tuple[Any, ...]:
    chart = chart_of(shape, 1.0)
    loops = []
    for loop in topology.loops[f]:
        lines = [topology.borders[k].points if forward else topology.borders[k].points[::-1] for k, forward in loop]
        loops.append(chart.uv(np.vstack(lines)))
    if not loops:
        raise NoResultError("It has no borders.")
    loops, around = unrolled(chart, loops)
    surface = chart.surface if isinstance(chart, SplineChart) else _patch(chart, np.vstack(loops), around)
    lines = [Polyline(uv, closed=not any(p and abs(uv[-1, a] - uv[0, a]) > 0.5 * p for a, p in enumerate(chart.period))) for uv in loops]
    return _trimmed(surface, lines, topology.outward[f], h, scale)


def _trimmed(surface: BSplineSurface, lines: list[Polyline], outward: int, h: float, scale: float) -> tuple[Any, ...]:
    """Build the face of a surface within given lines."""
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS

    found = trimmed_face(surface, lines, tolerance=_TOLERANCE * h)
    if not found.wires:
        raise NoResultError("No outline is left of it.")
    face = build_face(found.surface, found.wires, scale=scale)
    if not (is_valid(face) and is_valid_meshed(face, every=False)):
        raise NoResultError("Its own outline is not valid.")
    return (TopoDS.Face(face.Oriented(TopAbs_REVERSED)) if outward < 0 else face,)


def _patch(chart: Chart, uv: Floats, around: tuple[bool, bool]) -> BSplineSurface:
    """Return the part of a surface that holds given parameters as a bicubic B-spline over them, true to a millionth of its radius."""
    axes = []
    for axis in (0, 1):
        period = chart.period[axis]
        low, high = float(uv[:, axis].min()), float(uv[:, axis].max())
        if around[axis] and period:
            low, high = chart.start[axis], chart.start[axis] + period
        else:
            margin = 0.02 * (high - low) + 1e-9
            low, high = low - margin, high + margin
        axes.append(np.linspace(low, high, _SPANS + 1 if period else 9))
    u, v = np.meshgrid(*axes, indexing="ij")
    points = chart.point(np.column_stack([u.ravel(), v.ravel()])).reshape(*u.shape, 3)
    return bicubic((axes[0], axes[1]), points, around)
