"""The edges of a face as curves: each in the parameter space, and each in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.curve import Curve, fit_curve, line
from scan2nurbs.brep.outline import Frame
from scan2nurbs.brep.pieces import Piece
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_PER_SPAN = 16
_SHARES = (1.0, 0.25, 0.0625)


@dataclass(frozen=True)
class FaceEdge:
    """One edge of a face.

    Attributes
    ----------
    pcurve : Curve
        In (u, v).
    space : Curve or None
        The same in space, over the same parameters; None for an edge on a side of the parameter rectangle, whose curve is that of
        the surface itself.
    forward : bool
        Whether the wire runs along the curve; against it otherwise.
    side : (int, int) or None
        The side on which it runs, as in `Piece`.
    seam : Curve or None
        On a seam, the curve in (u, v) on the other side of the rectangle; `forward` then tells of `pcurve`.
    deviation : float
        Largest distance of the given points from the edge, in the unit of the surface.
    gap : float
        Largest distance in space between the two curves.
    """

    pcurve: Curve
    space: Curve | None
    forward: bool = True
    side: tuple[int, int] | None = None
    seam: Curve | None = None
    deviation: float = 0.0
    gap: float = 0.0


def fit_edges(surface: BSplineSurface, frame: Frame, pieces: Sequence[Piece], *, tolerance: float, gap: float) -> tuple[FaceEdge, ...]:
    """Make an edge of every piece of a wire.

    Parameters
    ----------
    surface : BSplineSurface
        What the pieces lie on.
    frame : Frame
        Its measured parameter rectangle.
    pieces : sequence of Piece
        In the order of the wire.
    tolerance : float
        Largest distance in space of the given points from an edge.
    gap : float
        Largest distance between an edge's curve in space and the curve in (u, v), laid on the surface.
    """
    return tuple(_on_side(piece) if piece.side else _free(surface, frame, piece, tolerance, gap) for piece in pieces)


def pair_seams(wires: Sequence[Sequence[FaceEdge]], frame: Frame) -> tuple[tuple[FaceEdge, ...], ...]:
    """Give the edges on the two ends of a closed direction, which are one edge in space, each other's curves.

    Both stay in their wires, as the two passages of the face along its seam; where an edge has no partner it remains a border.
    """
    edges = [edge for wire in wires for edge in wire]
    paired = dict(enumerate(edges))
    for i, low in enumerate(edges):
        if low.side is None or low.side[1] != 0 or frame.period[low.side[0]] is None:
            continue
        axis = low.side[0]
        reach = 8.0 * frame.snap / frame.scale[1 - axis]
        for j, high in enumerate(edges):
            same = high.side == (axis, 1) and high.forward != low.forward
            if same and np.abs(np.subtract(high.pcurve.domain, low.pcurve.domain)).max() <= reach:
                # One range for both: they are one edge.
                ends = low.pcurve.control_points.copy()
                ends[:, axis] = frame.high[axis]
                other = replace(low.pcurve, control_points=ends)
                paired[i] = replace(low, seam=other)
                paired[j] = replace(high, pcurve=other, seam=low.pcurve)
    numbers = iter(range(len(edges)))
    return tuple(tuple(paired[next(numbers)] for _ in wire) for wire in wires)


def _on_side(piece: Piece) -> FaceEdge:
    """Return the edge on a side of the rectangle, over the parameter that varies there, which only grows."""
    axis = piece.side[0] if piece.side else 0
    start, end = piece.uv[0], piece.uv[-1]
    forward = bool(end[1 - axis] > start[1 - axis])
    low, high = (start, end) if forward else (end, start)
    return FaceEdge(line(low, high, (low[1 - axis], high[1 - axis])), None, forward=forward, side=piece.side)


def _free(surface: BSplineSurface, frame: Frame, piece: Piece, tolerance: float, gap: float) -> FaceEdge:
    metric = piece.uv * frame.scale
    parameters = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(metric, axis=0), axis=1))])
    given = surface.evaluate(piece.uv)

    def in_space(fitted: Floats, _: Floats) -> Floats:
        return np.linalg.norm(_on(surface, fitted / frame.scale) - given, axis=1)

    pcurve = line(piece.uv[0], piece.uv[-1], (0.0, float(parameters[-1])))
    deviation = float(in_space(pcurve(parameters) * frame.scale, metric).max())
    if not piece.straight and (piece.closed or deviation > 0.5 * tolerance):
        for share in _SHARES:
            fitted = fit_curve(metric, parameters, tolerance=share * tolerance, measure=in_space, closed=piece.closed)
            pcurve = _inside(frame, fitted, None if piece.closed else piece.uv[[0, -1]])
            deviation = float(in_space(pcurve(parameters) * frame.scale, metric).max())
            if deviation <= tolerance:
                break
    space, apart = _in_space(surface, pcurve, gap)
    return FaceEdge(pcurve, space, deviation=deviation, gap=apart)


def _inside(frame: Frame, fitted: Curve, ends: Floats | None) -> Curve:
    """Return a curve in the frame's lengths as one in (u, v) that stays in the rectangle and meets the ends to the bit."""
    points = fitted.control_points / frame.scale
    if ends is not None:
        points[[0, -1]] = ends
    pcurve = replace(fitted, control_points=points)
    drawn = pcurve(pcurve.samples(_PER_SPAN))
    if ((drawn < frame.low) | (drawn > frame.high)).any():
        # With all its control points in the rectangle the curve is, too.
        pcurve = replace(pcurve, control_points=np.clip(points, frame.low, frame.high))
    return pcurve


def _in_space(surface: BSplineSurface, pcurve: Curve, gap: float) -> tuple[Curve, float]:
    """Fit the curve in space to the curve in (u, v) laid on the surface, and measure what is left between them."""
    per_span = _PER_SPAN if len(pcurve.knots) > 8 else 8 * _PER_SPAN
    space, apart = _at_density(surface, pcurve, gap, per_span)
    for _ in range(3):
        if apart <= 1.5 * gap:
            break
        per_span *= 3
        space, apart = _at_density(surface, pcurve, gap, per_span)
    return space, apart


def _at_density(surface: BSplineSurface, pcurve: Curve, gap: float, per_span: int) -> tuple[Curve, float]:
    parameters = pcurve.samples(per_span)
    space = fit_curve(_on(surface, pcurve(parameters)), parameters, tolerance=gap)
    between = 0.5 * (parameters[1:] + parameters[:-1])
    return space, float(np.linalg.norm(space(between) - _on(surface, pcurve(between)), axis=1).max())


def _on(surface: BSplineSurface, uv: Floats) -> Floats:
    """Evaluate the surface, after rounding has been kept from leaving its domain."""
    low, high = np.array(surface.domain).T
    return surface.evaluate(np.clip(uv, low, high))
