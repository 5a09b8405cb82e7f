"""A surface and loops in, a trimmed face out, whatever the loops are like."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.build import build_face, natural_face
from scan2nurbs.brep.check import check, is_valid
from scan2nurbs.brep.edges import FaceEdge, fit_edges, pair_seams
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.brep.outline import Frame, Loop, Outline, frame_of, outline
from scan2nurbs.brep.overlay import crosses
from scan2nurbs.brep.pieces import split
from scan2nurbs.brep.seam import with_true_seams
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]
Wires = tuple[tuple[FaceEdge, ...], ...]

_BEARABLE = 2.0


@dataclass(frozen=True)
class TrimmedFace:
    """A face of a CAD model, as curves and as an object of the CAD kernel.

    Attributes
    ----------
    surface : BSplineSurface
        What lies under the face. On a tube its seam may have been moved out of the face.
    wires : tuple of tuples of FaceEdge
        The outer wire first; empty where only the kernel's own face of the whole surface was possible.
    shape : TopoDS_Face
        The kernel's face, its lengths those of the surface times `kernel_scale`.
    kernel_scale : float
        1, or a power of ten for a surface so small or large that the kernel's absolute tolerances would not fit it.
    n_edges : int
        Distinct edges.
    max_tolerance : float
        The largest gap between vertices, edges and surface, in the unit of the surface.
    area : float
        In the unit of the surface, squared.
    valid : bool
        Whether the kernel's own analysis finds nothing wrong.
    deviation : float
        The largest distance of the cleaned loops' points from the edges, in the unit of the surface.
    notes : tuple of str
        What was changed, left out or given up, one sentence each.
    """

    surface: BSplineSurface
    wires: Wires
    shape: Any
    kernel_scale: float
    n_edges: int
    max_tolerance: float
    area: float
    valid: bool
    deviation: float
    notes: tuple[str, ...] = field(default=())


def trimmed_face(
    surface: BSplineSurface,
    loops: Sequence[Loop | Floats] = (),
    *,
    tolerance: float,
    smooth: bool = True,
) -> TrimmedFace:
    """Trim a surface by loops in its parameter space.

    Parameters
    ----------
    surface : BSplineSurface
        May be rational, and closed in u or v.
    loops : sequence of Loop or (K, 2) array
        Polylines in (u, v) in any order and direction: the one around the largest area is the outer one, the others are holes. They
        may be noisy, cross themselves and each other, and leave the surface. See `Loop` for those that go around a tube. Without
        loops the face is the whole surface.
    tolerance : float
        How far an edge may lie from the points of its loop, in the unit of the surface. Also the width below which loops, and
        slivers at the border of the surface, are left out.
    smooth : bool
        Lay smooth curves through the loops, with corners only where they turn sharply; straight edges in (u, v) otherwise.

    Returns
    -------
    TrimmedFace
        Always a face. Where smooth edges do not give a valid one, finer ones, then straight ones, then the whole surface are tried;
        the notes say so.

    Raises
    ------
    ParameterError
        If the tolerance is not a positive number, or a loop is not a (K, 2) array.
    NoResultError
        If the CAD kernel does not even accept the surface.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ParameterError(f"The 'tolerance' parameter of trimmed_face must be a float in (0, inf). Got {tolerance} instead.")
    notes: list[str] = []
    surface = with_true_seams(surface, notes)
    lines = outline(surface, [_as_loop(loop) for loop in loops], tolerance=tolerance)
    notes += lines.notes
    surface, frame = lines.surface, frame_of(lines.surface)
    extent = float(np.linalg.norm(np.ptp(surface.control_points.reshape(-1, 3), axis=0)))
    scale = kernel_scale(extent)
    gap = float(np.clip(0.02 * tolerance, 1e-8 * extent, 1e-5 * extent))
    for wires, note in _attempts(lines, frame, tolerance, gap, smooth):
        if note:
            notes.append(note)
        if not _is_simple(wires, frame) or _deviation(wires) > _BEARABLE * tolerance:
            continue
        try:
            shape = build_face(surface, wires, scale=scale)
            if is_valid(shape):
                return _result(surface, wires, shape, scale, notes)
        except KernelError as error:
            notes.append(str(error))
    notes.append("No outline gave a valid face: the face is the whole surface.")
    return _result(surface, (), natural_face(surface, scale=scale), scale, notes)


def kernel_scale(extent: float) -> float:
    """Return the factor that brings an extent into the range for which the kernel's absolute tolerances are made."""
    if extent <= 0 or not np.isfinite(extent):
        raise NoResultError("The surface has no extent: all its control points are one.")
    return 1.0 if 1.0 <= extent <= 1e5 else float(10.0 ** (2 - np.floor(np.log10(extent))))


def _as_loop(loop: Loop | Floats) -> Loop:
    uv = np.asarray(loop.uv if isinstance(loop, Loop) else loop, np.float64)
    if uv.ndim != 2 or uv.shape[1] != 2:
        raise ParameterError(f"A loop must be a (K, 2) array. Got the shape {uv.shape} instead.")
    return Loop(uv, loop.closed if isinstance(loop, Loop) else True)


def _attempts(lines: Outline, frame: Frame, tolerance: float, gap: float, smooth: bool) -> Iterator[tuple[Wires, str]]:
    """Yield the edges to try, from the most editable to the safest, and what to tell the user when it comes to them."""
    for share in (1.0, 0.25, 0.0625) if smooth else ():
        pieces = [split(wire, frame, tolerance=tolerance) for wire in lines.wires]
        wires = [fit_edges(lines.surface, frame, wire, tolerance=share * tolerance, gap=gap) for wire in pieces]
        note = "" if share == 1.0 else f"Smooth edges did not give a valid face: edges within {share * tolerance:.3g} were tried."
        yield pair_seams(wires, frame), note
    for share in (1.0, 0.1):
        pieces = [split(wire, frame, tolerance=share * tolerance, every=True) for wire in lines.wires]
        wires = [fit_edges(lines.surface, frame, wire, tolerance=tolerance, gap=gap) for wire in pieces]
        yield pair_seams(wires, frame), "Smooth edges did not give a valid face: straight ones were tried." if smooth and share == 1 else ""


def _is_simple(wires: Wires, frame: Frame) -> bool:
    """Return whether the edges, finely sampled, meet nowhere but in their common ends."""
    loops = []
    for wire in wires:
        points = []
        for edge in wire:
            uv = edge.pcurve(edge.pcurve.samples(8 if edge.pcurve.degree > 1 else 1))
            points.append((uv if edge.forward else uv[::-1])[:-1])
        loops.append((np.vstack(points) - frame.low) * frame.scale)
    return all(len(loop) > 2 for loop in loops) and not crosses(loops, 0.0)


def _deviation(wires: Wires) -> float:
    return max((edge.deviation for wire in wires for edge in wire), default=0.0)


def _result(surface: BSplineSurface, wires: Wires, shape: Any, scale: float, notes: list[str]) -> TrimmedFace:
    found = check(shape)
    return TrimmedFace(
        surface=surface,
        wires=wires,
        shape=shape,
        kernel_scale=scale,
        n_edges=found.n_edges,
        max_tolerance=found.max_tolerance / scale,
        area=found.area / scale**2,
        valid=found.valid,
        deviation=_deviation(wires),
        notes=tuple(notes),
    )
