"""Where a wire is cut into edges: at sharp corners, and where it enters or leaves the border of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.outline import Frame

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHARP = np.cos(np.radians(35.0))
_WINDOWS = 16
_PARTS = 64


@dataclass(frozen=True)
class Piece:
    """A stretch of a wire that becomes one edge.

    Attributes
    ----------
    uv : (K, 2) float64
        Its points in (u, v), both ends included; a whole wire without a corner repeats its first point.
    side : (int, int) or None
        The side of the parameter rectangle on which it runs, as the axis that is constant and 0 (low) or 1 (high).
    straight : bool
        Whether a straight line in (u, v) has to do, whatever its deviation.
    """

    uv: Floats
    side: tuple[int, int] | None = None
    straight: bool = False

    @property
    def closed(self) -> bool:
        """Whether the piece is a wire of its own."""
        return bool((self.uv[0] == self.uv[-1]).all())


def split(wire: Floats, frame: Frame, *, tolerance: float, every: bool = False) -> list[Piece]:
    """Cut a wire into pieces.

    Parameters
    ----------
    wire : (K, 2) float64
        A simple closed polyline in (u, v) inside the frame.
    frame : Frame
        The parameter rectangle.
    tolerance : float
        Bends within a few tolerances count as one corner; in the unit of the surface.
    every : bool
        Cut at every point that simplifying within the tolerance leaves, for an outline of straight edges.
    """
    wire = _without_gaps(wire, frame)
    sides = _sides(wire, frame)
    previous = np.roll(sides, 1, axis=0)
    # sides[k] is that of the segment k → k + 1; where it changes, an edge begins.
    breaks = set(np.flatnonzero((sides != previous).any(axis=1)).tolist())
    metric = (wire - frame.low) * frame.scale
    corners = _kept(metric, sorted(breaks), tolerance) if every else _corners(metric, tolerance)
    on_side = (sides[:, 0] >= 0) & (previous == sides).all(axis=1)
    breaks |= {k for k in corners.tolist() if not on_side[k]}
    if not breaks:
        return [Piece(np.vstack([wire, wire[:1]]))]
    cuts = sorted(breaks)
    ring = np.vstack([wire, wire, wire[:1]])
    pieces = []
    for begin, stop in zip(cuts, [*cuts[1:], cuts[0] + len(wire)], strict=True):
        axis, end = sides[begin].tolist()
        uv = ring[begin : stop + 1]
        if axis >= 0:
            pieces.append(Piece(uv[[0, -1]], (axis, end)))
        else:
            pieces.append(Piece(uv, straight=every))
    return pieces


def _without_gaps(wire: Floats, frame: Frame) -> Floats:
    """Add points on segments that are long for their wire: they are known to be straight, and a smooth curve has to heed that."""
    ahead = np.roll(wire, -1, axis=0)
    step = np.linalg.norm((ahead - wire) * frame.scale, axis=1)
    usual = 2.0 * float(np.median(step))
    on_side = _sides(wire, frame)[:, 0] >= 0
    parts = np.where((step > 2.0 * usual) & ~on_side, np.minimum(np.ceil(step / max(usual, 1e-300)), _PARTS), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(wire)), parts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[owner]
    return wire[owner] + share[:, None] * (ahead - wire)[owner]


def _sides(wire: Floats, frame: Frame) -> Ints:
    """Return for every segment the axis and end of the side on which it lies, or −1."""
    sides = np.full((len(wire), 2), -1)
    ahead = np.roll(wire, -1, axis=0)
    for axis in (0, 1):
        for end, value in enumerate((frame.low[axis], frame.high[axis])):
            sides[(wire[:, axis] == value) & (ahead[:, axis] == value)] = axis, end
    return sides


def _corners(points: Floats, tolerance: float) -> Ints:
    """Return the indices of the points in which a closed polyline turns by more than 35 degrees at once.

    The turn is taken between the ways of the polyline through one window before the point and one behind it. A bend that spreads over
    the window turns half as much within half of it; a corner turns as much.
    """
    n = len(points)
    if n < 5:
        return np.arange(n)
    step = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    length = float(step.sum())
    window = min(6.0 * tolerance, length / _WINDOWS)
    wide, narrow = (_turn(points, step, share * window) for share in (1.0, 0.5))
    sharp = (np.cos(wide) < _SHARP) & (np.abs(narrow) > 0.75 * np.abs(wide))
    along = np.concatenate([[0.0], np.cumsum(step)[:-1]])
    found: list[int] = []
    for k in np.argsort(-np.abs(wide), kind="stable").tolist():
        if sharp[k]:
            gaps = np.abs(along[found] - along[k])
            if (np.minimum(gaps, length - gaps) > window).all():
                found.append(k)
    return np.sort(np.array(found, np.int64))


def _turn(points: Floats, step: Floats, window: float) -> Floats:
    """Return the angle in radians between the ways into and out of every point, each within `window` of it.

    A way leads from the mean of the window's first half to that of its second, so that noise averages out.
    """
    ring = np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(step)])
    length = along[-1]
    slope = np.diff(ring, axis=0) / np.maximum(step, 1e-300)[:, None]
    integral = np.vstack([np.zeros(2), np.cumsum(0.5 * step[:, None] * (ring[1:] + ring[:-1]), axis=0)])

    def up_to(position: Floats) -> Floats:
        """Integrate the polyline from its first point; around and around."""
        laps = np.floor(position / length)
        rest = position - laps * length
        k = np.clip(np.searchsorted(along, rest, side="right") - 1, 0, len(step) - 1)
        beyond = (rest - along[k])[:, None]
        return laps[:, None] * integral[-1] + integral[k] + beyond * (ring[k] + 0.5 * beyond * slope[k])

    at = along[:-1]
    marks = [up_to(at + share * window) for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    means = np.diff(np.array(marks), axis=0)
    into, out = means[1] - means[0], means[3] - means[2]
    return np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], np.einsum("nd,nd->n", into, out))


def _kept(points: Floats, fixed: list[int], tolerance: float) -> Ints:
    """Return the points of a closed polyline that stay when it is simplified (Douglas and Peucker, 1973), the fixed ones among them."""
    n = len(points)
    if len(fixed) < 2:
        first = fixed[0] if fixed else 0
        fixed = sorted({first, int(np.argmax(np.linalg.norm(points - points[first], axis=1)))})
    kept = set(fixed)
    stack = list(zip(fixed, [*fixed[1:], fixed[0] + n], strict=True))
    while stack:
        begin, stop = stack.pop()
        inside = np.arange(begin + 1, stop) % n
        if not len(inside):
            continue
        start, chord = points[begin % n], points[stop % n] - points[begin % n]
        away = points[inside] - start
        share = np.clip(away @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
        distance = np.linalg.norm(away - share[:, None] * chord, axis=1)
        worst = int(np.argmax(distance))
        if distance[worst] > tolerance:
            middle = begin + 1 + worst
            kept.add(middle % n)
            stack += [(begin, middle), (middle, stop)]
    return np.array(sorted(kept), np.int64)
