"""From loops as they come to the wires of one face: simple, inside the surface, outer one first."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.overlay import area, overlay, winding
from scan2nurbs.brep.seam import roll
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_SNAP = 1e-7
"""Points closer than this share of the surface's extent are one."""


@dataclass(frozen=True)
class Loop:
    """A polyline in the parameter space of a surface that trims it.

    Attributes
    ----------
    uv : (K, 2) float64
        Ordered points; the last is joined to the first, repeated or not. On a closed surface they may leave the domain or jump
        by a period where they pass the seam.
    closed : bool
        False for a polyline that goes once around a tube and ends a period from where it began.
    """

    uv: Floats
    closed: bool = True


@dataclass(frozen=True)
class Outline:
    """The wires of a face as simple closed polylines.

    Attributes
    ----------
    surface : BSplineSurface
        The surface they lie on: the given one, or on a tube the same with its seam moved out of the way.
    wires : tuple of (K, 2) float64
        The outer one, counter-clockwise, then the holes, clockwise, in (u, v). None repeats a point.
    notes : tuple of str
        What was left out or changed, one sentence each.
    """

    surface: BSplineSurface
    wires: tuple[Floats, ...]
    notes: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class Frame:
    """The parameter rectangle, measured: what one step in u and in v is worth in space.

    Attributes
    ----------
    low, high : (2,) float64
        The corners of the rectangle in (u, v).
    scale : (2,) float64
        Mean length of the derivatives in u and v.
    period : tuple of float or None
        The period in u and v where the surface is closed.
    """

    low: Floats
    high: Floats
    scale: Floats
    period: tuple[float | None, float | None]

    @property
    def snap(self) -> float:
        """The length below which two points are one."""
        return _SNAP * float(np.linalg.norm((self.high - self.low) * self.scale))


def frame_of(surface: BSplineSurface) -> Frame:
    """Measure the parameter rectangle of a surface."""
    (u0, u1), (v0, v1) = surface.domain
    low, high = np.array([u0, v0]), np.array([u1, v1])
    steps = (np.arange(12) + 0.5) / 12
    u, v = np.meshgrid(u0 + (u1 - u0) * steps, v0 + (v1 - v0) * steps, indexing="ij")
    slopes = surface.derivatives(np.column_stack([u.ravel(), v.ravel()]))[:, 1:]
    scale = np.linalg.norm(slopes, axis=2).mean(axis=0)
    # A surface that has shrunk to a curve or a point has no length in one direction; any positive one will do.
    scale = np.where(scale > 0, scale, max(float(scale.max()), 1.0))
    period = tuple(float(b - a) if closed else None for a, b, closed in zip(low, high, surface.closed, strict=True))
    return Frame(low, high, scale, (period[0], period[1]))


def outline(surface: BSplineSurface, loops: Sequence[Loop], *, tolerance: float) -> Outline:
    """Clean the loops and arrange them to the outline of one face.

    Parameters
    ----------
    surface : BSplineSurface
        May be closed in u or v.
    loops : sequence of Loop
        The one around the largest area is the outer one, the others are holes; on a closed surface the lowest and the highest of
        those that go around it bound the face. Without any, the face is the whole surface.
    tolerance : float
        In the unit of the surface. What is narrower than this is left out, and points closer to the border of the surface than
        half of it are put onto the border.

    Returns
    -------
    Outline
        Where nothing usable is left, the border of the whole surface, with a note that says so.
    """
    notes: list[str] = []
    frame = frame_of(surface)
    usable = [loop for loop in (_unwrapped(loop, frame) for loop in loops) if _is_usable(loop, notes)]
    if usable:
        surface, frame, regions = _regions(surface, frame, usable, tolerance, notes)
        if regions:
            wires = _one_face(frame, regions, tolerance, notes)
            if wires:
                return Outline(surface, wires, tuple(notes))
    if loops:
        notes.append("No usable outline: the face is the whole surface.")
    corners = np.array([frame.low, [frame.high[0], frame.low[1]], frame.high, [frame.low[0], frame.high[1]]])
    return Outline(surface, (corners,), tuple(notes))


def _unwrapped(loop: Loop, frame: Frame) -> Loop:
    """Drop points that say nothing, undo the jumps at a seam, and see whether the loop goes around."""
    uv = np.asarray(loop.uv, np.float64).reshape(-1, 2)
    uv = uv[np.isfinite(uv).all(axis=1)]
    uv = uv[np.r_[True, (np.diff(uv, axis=0) != 0).any(axis=1)]] if len(uv) else uv
    if loop.closed and len(uv) > 1 and (uv[0] == uv[-1]).all():
        uv = uv[:-1]
    closed = loop.closed
    for axis, period in enumerate(frame.period):
        if period is None or len(uv) < 8:
            continue
        step = np.diff(np.append(uv[:, axis], uv[0, axis]))
        jumps = np.abs(step) > 0.5 * period
        # Only the jumps of a finely sampled loop are passages of the seam; a coarse one means its long segments.
        if np.median(np.abs(step)) < 0.1 * period:
            turns = np.where(jumps, -np.sign(step), 0.0)
            uv = uv.copy()
            uv[1:, axis] += period * np.cumsum(turns[:-1])
            if closed and turns.sum() != 0:
                closed = False
                uv = np.vstack([uv, uv[0] + np.eye(2)[axis] * period * turns.sum()])
    return Loop(uv, closed)


def _is_usable(loop: Loop, notes: list[str]) -> bool:
    if len(loop.uv) >= (3 if loop.closed else 2):
        return True
    notes.append(f"A loop of {len(loop.uv)} distinct points was left out.")
    return False


def _regions(
    surface: BSplineSurface, frame: Frame, loops: list[Loop], tolerance: float, notes: list[str]
) -> tuple[BSplineSurface, Frame, list[Floats]]:
    """Return the loops of the region to keep, in the frame's lengths, the region on their left."""
    around = [loop.uv for loop in loops if not loop.closed]
    patches = [loop.uv for loop in loops if loop.closed]
    axis = _axis_around(around, frame, notes)
    if axis is not None:
        outer = _strip(around, frame, axis, notes)
    else:
        patches.sort(key=lambda uv: -abs(area(uv)))
        if not patches:
            return surface, frame, []
        outer, *patches = patches
        surface, frame, outer = _off_the_seam(surface, frame, outer, notes)
    copies = [np.array(shift) for shift in itertools.product(*((-p, 0.0, p) if p else (0.0,) for p in frame.period))]
    holes = [hole + shift for hole in patches for shift in copies]
    rectangle = np.array([frame.low, [frame.high[0], frame.low[1]], frame.high, [frame.low[0], frame.high[1]]])
    _note_outside(outer, frame, axis, tolerance, notes)
    metric = [(_snapped(uv, frame, tolerance) - frame.low) * frame.scale for uv in (rectangle, outer, *holes)]
    found = overlay(metric, lambda w: bool(w[0] and w[1] and not w[2:].any()), snap=frame.snap)
    return surface, frame, found


def _axis_around(around: list[Floats], frame: Frame, notes: list[str]) -> int | None:
    """Return the axis that the open polylines go around; those that do not span a period are left out."""
    axis = None
    kept = []
    for uv in around:
        span = uv[-1] - uv[0]
        spanned = [k for k, period in enumerate(frame.period) if period and abs(abs(span[k]) - period) <= 0.02 * period]
        axis = spanned[0] if axis is None and spanned else axis
        if axis is None or axis not in spanned:
            notes.append("An open polyline that does not go around the surface was left out.")
            continue
        forward = uv if span[axis] > 0 else uv[::-1]
        # It closes exactly: what is missing is spread over its length.
        missing = forward[0] + np.eye(2)[axis] * (frame.period[axis] or 0.0) - forward[-1]
        kept.append(forward + np.linspace(0, 1, len(uv))[:, None] * missing)
    around[:] = kept
    return axis


def _strip(around: list[Floats], frame: Frame, axis: int, notes: list[str]) -> Floats:
    """Return the polygon, over three periods, between the lowest and the highest polyline that goes around."""
    other = 1 - axis
    around.sort(key=lambda uv: float(np.mean(uv[:, other])))
    period = np.eye(2)[axis] * (frame.period[axis] or 0.0)

    def end(value: float) -> Floats:
        points = np.empty((2, 2))
        points[:, axis], points[:, other] = (frame.low[axis], frame.high[axis]), value
        return points

    if len(around) == 1:
        notes.append("One loop goes around the surface; the face is its larger side.")
        middle = 0.5 * (frame.low[other] + frame.high[other])
        below = float(np.mean(around[0][:, other])) > middle
        around = [end(frame.low[other]), around[0]] if below else [around[0], end(frame.high[other])]
    elif len(around) > 2:
        notes.append(f"{len(around) - 2} loops between the lowest and the highest that go around were left out.")
    low, high = (np.vstack([uv[:-1] + k * period for k in (-2, -1, 0, 1, 2)]) for uv in (around[0], around[-1]))
    return np.vstack([low, high[::-1]])


def _off_the_seam(surface: BSplineSurface, frame: Frame, outer: Floats, notes: list[str]) -> tuple[BSplineSurface, Frame, Floats]:
    """Shift the outer loop into the domain; where it crosses the seam, move the seam to the other side of the tube."""
    for axis, period in enumerate(frame.period):
        if period is None:
            continue
        low, high = outer[:, axis].min(), outer[:, axis].max()
        shift = np.eye(2)[axis] * period
        outer = outer - shift * np.floor((low - frame.low[axis]) / period + 1e-9)
        if high - low < (1.0 - 1e-9) * period and outer[:, axis].max() > frame.high[axis] + 1e-9 * period:
            at = outer[:, axis].min() - 0.5 * (period - (high - low))
            surface = roll(surface, axis, at)
            notes.append("The seam of the closed surface was moved out of the face.")
            frame = replace(frame, low=np.array([d[0] for d in surface.domain]), high=np.array([d[1] for d in surface.domain]))
            outer = outer - shift * np.floor((outer[:, axis].min() - frame.low[axis]) / period)
    return surface, frame, outer


def _snapped(uv: Floats, frame: Frame, tolerance: float) -> Floats:
    """Put points that lie on the border of an open direction but for half the tolerance onto it."""
    uv = uv.copy()
    for axis, period in enumerate(frame.period):
        if period is None:
            reach = min(0.5 * tolerance / frame.scale[axis], 0.01 * (frame.high[axis] - frame.low[axis]))
            for side in (frame.low[axis], frame.high[axis]):
                uv[np.abs(uv[:, axis] - side) <= reach, axis] = side
    return uv


def _note_outside(outer: Floats, frame: Frame, around: int | None, tolerance: float, notes: list[str]) -> None:
    beyond = np.maximum(frame.low - outer, outer - frame.high).clip(0.0) * frame.scale
    if around is not None:
        beyond[:, around] = 0.0
    if (furthest := float(beyond.max(initial=0.0))) > tolerance:
        notes.append(f"The outline leaves the surface by up to {furthest:.4g} and was cut at its border.")


def _one_face(frame: Frame, regions: list[Floats], tolerance: float, notes: list[str]) -> tuple[Floats, ...]:
    """Choose the largest outer loop and its holes, and give them back in (u, v)."""
    areas = np.array([area(loop) for loop in regions])
    # The width of a loop is its area over its length; the diagonal stands for that, since noise lengthens the polyline itself.
    diagonals = np.array([np.linalg.norm(np.ptp(loop, axis=0)) for loop in regions])
    narrow = np.abs(areas) <= 1.2 * tolerance * diagonals
    if narrow.any():
        notes.append(f"{int(narrow.sum())} loops narrower than the tolerance were left out.")
    outers = np.flatnonzero(~narrow & (areas > 0))
    if not len(outers):
        return ()
    best = int(outers[np.argmax(areas[outers])])
    if len(outers) > 1:
        share = 1.0 - areas[best] / areas[outers].sum()
        notes.append(f"{len(outers) - 1} separate pieces, {share:.2%} of the area, were left out: a face has one outline.")
    holes = [k for k in np.flatnonzero(~narrow & (areas < 0)) if np.mean(winding(regions[best], regions[k]) != 0) > 0.5]
    wires = []
    for k in (best, *holes):
        uv = np.clip(regions[k] / frame.scale + frame.low, frame.low, frame.high)
        for side in (frame.low, frame.high):
            on = np.abs(uv - side) * frame.scale <= 4.0 * frame.snap
            uv = np.where(on, side, uv)
        wires.append(uv[(uv != np.roll(uv, 1, axis=0)).any(axis=1)])
    return tuple(wires)
