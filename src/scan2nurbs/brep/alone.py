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


def _outlined(shape: Shape, topology: Topology, f: int, h: float, scale: float) -> tuple[Any, ...]:
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS

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
    found = trimmed_face(surface, lines, tolerance=_TOLERANCE * h)
    if not found.wires:
        raise NoResultError("No outline is left of it.")
    face = build_face(found.surface, found.wires, scale=scale)
    if not (is_valid(face) and is_valid_meshed(face, every=False)):
        raise NoResultError("Its own outline is not valid.")
    return (TopoDS.Face(face.Oriented(TopAbs_REVERSED)) if topology.outward[f] < 0 else face,)


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
