"""Faces laid out in their parameters: which way their borders go around, where the seam runs, and where it cuts borders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.charts import Chart, SplineChart
from scan2nurbs.brep.overlay import area

Floats = NDArray[np.float64]
Path = tuple[tuple[int, bool], ...]

_LEAST = 48
_CLEAR = 1.5
_NEAR = 0.02
_ALONG = 20
"""What it costs a seam to run along a border, or to touch a loop, in borders that it cuts."""


@dataclass(frozen=True)
class Layout:
    """How a face lies in its parameters.

    Attributes
    ----------
    chart : Chart
        Turned so that its seam lies well.
    cut : (bool, bool)
        Whether the face goes around in u and in v, so that the seam there is a line within the face.
    window : (float, float)
        Where the period begins that holds the face.
    """

    chart: Chart
    cut: tuple[bool, bool]
    window: tuple[float, float]

    def within(self, uv: Floats) -> Floats:
        """Return the unwrapped parameters of a piece of border, moved by whole periods into the window."""
        uv = unwrapped(uv, self.chart)
        middle = uv[len(uv) // 2]
        for axis, (period, start) in enumerate(zip(self.chart.period, self.window, strict=True)):
            if period:
                uv[:, axis] -= period * np.floor((middle[axis] - start) / period)
        return uv


def unwrapped(uv: Floats, chart: Chart) -> Floats:
    """Undo the jumps by a period between consecutive parameters."""
    uv = uv.copy()
    for axis, period in enumerate(chart.period):
        if period:
            uv[:, axis] = np.unwrap(uv[:, axis], period=period)
    return uv


def unrolled(chart: Chart, loops: Sequence[Floats]) -> tuple[list[Floats], tuple[bool, bool]]:
    """Unwrap the parameters of loops, those that go around nothing into one period; tell in which parameters one of them goes around."""
    loops = [unwrapped(uv, chart) for uv in loops]
    around = [any(p and round((uv[-1, axis] - uv[0, axis]) / p) for uv in loops) for axis, p in enumerate(chart.period)]
    for axis, period in enumerate(chart.period):
        if period and not around[axis]:
            start = widest_gap(np.concatenate([uv[:, axis] for uv in loops]), period)
            for uv in loops:
                uv[:, axis] -= period * np.floor((uv[len(uv) // 2, axis] - start) / period)
    return loops, (bool(around[0]), bool(around[1]))


def lay_out(chart: Chart, loops: Sequence[Path], curves: Sequence[BorderCurve], marked: Sequence[Sequence[float]], h: float) -> Layout:
    """Decide whether a face needs a seam, and where.

    Parameters
    ----------
    chart : Chart
        Of its surface.
    loops : sequence of paths
        Borders in order, with the face on their left as the surface's normal sees it.
    curves : sequence of BorderCurve
    marked : sequence of sequences of float
        Parameters on every border where there is, or will be, a vertex between its ends.
    h : float

    Notes
    -----
    A face goes around if a loop of it does, or if no loop is an outer one (a whole sphere, with holes or without). The seam is laid
    through a vertex or amid a wide gap between vertices, where it cuts the fewest borders.
    """
    around, outer = np.zeros(2, bool), False
    paths = []
    if isinstance(chart, SplineChart):
        chart = chart.guided([_along(loop, curves) for loop in loops], h)
    for loop in loops:
        uv = loop_uv(chart, loop, curves)
        turns = np.array([round((uv[-1, k] - uv[0, k]) / p) if p else 0 for k, p in enumerate(chart.period)])
        around |= turns != 0
        outer |= not turns.any() and area(uv) > 0
        paths.append((uv, turns))
    whole = not around.any() and not outer
    closed = np.array([p is not None for p in chart.period])
    cut = (around | whole) & closed
    window = list(chart.start)
    for axis in (0, 1):
        if not closed[axis]:
            continue
        if not cut[axis]:
            window[axis] = _outside(paths, axis, chart.period[axis] or 1.0)
            chart, window[axis] = chart.turned(window[axis], axis)
        elif axis == 0:
            chart, window[axis] = chart.turned(_best_seam(chart, loops, curves, marked, paths, h), axis)
    return Layout(chart, (bool(cut[0]), bool(cut[1])), (window[0], window[1]))


def widest_gap(values: Floats, period: float) -> float:
    """Return the middle of the widest interval of a period that holds no value."""
    places = np.unique(values % period)
    return _middle(places, np.diff(np.append(places, places[0] + period)), period)


def _middle(places: Floats, gaps: Floats, period: float) -> float:
    k = int(np.argmax(gaps))
    return float((places[k] + 0.5 * gaps[k]) % period)


def _outside(paths: Sequence[tuple[Floats, Floats]], axis: int, period: float) -> float:
    """Return a parameter beside the face, where it goes around in the other direction or in none.

    Between two rings around a tube lie two strips, and the wider may be the face: a bend by more than half a turn. The face is left of
    its rings; the strip beside it begins where the face ends.
    """
    values = np.concatenate([uv[:, axis] for uv, _ in paths]) % period
    # Left of a ring that goes up in v is less of u, left of one that goes up in u is more of v.
    ring = np.concatenate([np.full(len(uv), (1 if axis == 0 else -1) * np.sign(turns[1 - axis])) for uv, turns in paths])
    order = np.argsort(values, kind="stable")
    places, ring = values[order], ring[order]
    gaps = np.diff(np.append(places, places[0] + period))
    if (ring > 0).any() and (ring < 0).any():
        gaps = np.where((ring > 0) & (np.roll(ring, -1) < 0), gaps, 0.0)
    return _middle(places, gaps, period)


def loop_uv(chart: Chart, loop: Path, curves: Sequence[BorderCurve]) -> Floats:
    """Return the unwrapped parameters (K, 2) along a loop, from its start to where it comes back to it."""
    return unwrapped(chart.uv(_along(loop, curves)), chart)


def _along(loop: Path, curves: Sequence[BorderCurve]) -> Floats:
    points = []
    for border, forward in loop:
        at = curves[border].curve(curves[border].curve.samples(_LEAST))
        points.append(at if forward else at[::-1])
    return np.vstack(points)


def cuts(layout: Layout, curve: BorderCurve, h: float) -> list[float]:
    """Return the parameters between a border's ends where the seams of a face cut it."""
    found: list[float] = []
    chart = layout.chart
    t = curve.curve.samples(_LEAST)
    uv = unwrapped(chart.uv(curve.curve(t)), chart)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve.curve(t), axis=0), axis=1))])
    for axis in (0, 1):
        period = chart.period[axis]
        if not (layout.cut[axis] and period):
            continue
        turns = (uv[:, axis] - chart.start[axis]) / period
        for k in range(len(t) - 1):
            low, high = sorted((turns[k], turns[k + 1]))
            for line in range(int(np.ceil(low)), int(np.floor(high)) + 1):
                if turns[k + 1] == line and k + 1 < len(t) - 1:
                    continue
                root = _root(chart, axis, curve, (t[k], t[k + 1]), (turns[k], turns[k + 1]), line)
                at = float(np.interp(root, t, length))
                if _NEAR * h < at < length[-1] - _NEAR * h:
                    found.append(root)
    return sorted(found)


def _root(chart: Chart, axis: int, curve: BorderCurve, t: tuple[float, float], turns: tuple[float, float], line: int) -> float:
    if turns[0] == line or turns[1] == line:
        return float(t[0] if turns[0] == line else t[1])
    period = chart.period[axis] or 1.0
    middle = 0.5 * (turns[0] + turns[1])

    def off(at: float) -> float:
        turn = (chart.uv(curve.curve(np.array([at])))[0, axis] - chart.start[axis]) / period
        return turn + round(middle - turn) - line

    if off(t[0]) * off(t[1]) > 0:
        share = (line - turns[0]) / (turns[1] - turns[0])
        return float(t[0] + share * (t[1] - t[0]))
    return float(brentq(off, t[0], t[1], xtol=1e-15 * max(1.0, abs(t[1]))))  # type: ignore[arg-type] - the stubs want float64 back


def _stretch(chart: Chart, uv: Floats, period: float) -> Floats:
    """Return by how much a step in u moves points (N,) at parameters (N, 2)."""
    step = 1e-4 * period
    return np.linalg.norm(chart.point(uv + np.array([step, 0.0])) - chart.point(uv), axis=1) / step if len(uv) else np.empty(0)


def _cost(aside: Floats, period: float, length: Floats, near: float) -> int:
    """Return how often a seam cuts a loop apart from its vertices; more where it runs along it, or touches it.

    What only touches a loop parts it nowhere, and two wires may not touch.

    Parameters
    ----------
    aside : (K,) float64
        How far from the seam, in u within half a period, the loop runs.
    period : float
    length : (K,) float64
        By how much a step in u moves its points.
    near : float
        Up to which distance they lie on the seam.
    """
    kept = np.r_[True, np.diff(aside) != 0.0]  # where two borders meet, the loop has a point twice
    aside, length = aside[kept], length[kept]
    side = np.where(np.abs(aside) * length <= near, 0.0, np.sign(aside))
    if not side.any():
        return _ALONG
    first = int(np.flatnonzero(side)[0])
    side, aside = (np.append(np.roll(x, -first), x[first]) for x in (side, aside))
    off = np.flatnonzero(side)
    before, after = off[:-1], off[1:]
    on = after - before - 1
    passes = (side[before] != side[after]) & (np.abs(aside[before] - aside[after]) < 0.5 * period)
    return int(np.count_nonzero(passes & (on == 0))) + _ALONG * int(np.count_nonzero((on > 1) | ((on == 1) & ~passes)))


def _best_seam(
    chart: Chart, loops: Sequence[Path], curves: Sequence[BorderCurve], marked: Sequence[Sequence[float]], paths: list, h: float
) -> float:
    """Return the u where the seam meets the fewest borders and passes vertices exactly or not at all."""
    period, start = chart.period[0] or 1.0, chart.start[0]
    vertices = [np.empty((0, 3))]
    for border, _ in {border: None for loop in loops for border in loop}:
        domain = curves[border].curve.domain
        ends = [] if curves[border].closed and not marked[border] else [*marked[border]]
        ends += [] if curves[border].closed else [*domain]
        vertices.append(curves[border].curve(np.array(ends)) if ends else np.empty((0, 3)))
    at = np.vstack(vertices)
    uv = chart.uv(at) if len(at) else np.empty((0, 2))
    stretch = _stretch(chart, uv, period)
    lengths = [_stretch(chart, path, period) for path, _ in paths]
    places = np.unique(uv[:, 0])
    gaps = np.append(places, places[:1] + period) if len(places) else start + period * np.arange(9) / 8
    candidates = np.concatenate([start + period * np.arange(8) / 8, places, start + (0.5 * (gaps[:-1] + gaps[1:]) - start) % period])
    best, least = start, np.inf
    for u in candidates:
        off = np.abs((uv[:, 0] - u + 0.5 * period) % period - 0.5 * period) * stretch
        hit = off <= _NEAR * h
        aside = [(path[:, 0] - u + 0.5 * period) % period - 0.5 * period for path, _ in paths]
        near = off[~hit].min(initial=np.inf)
        cost = float(sum(_cost(d, period, length, _NEAR * h) for d, length in zip(aside, lengths, strict=True)))
        cost += 10.0 if near < 0.5 * h else 1.0 if near < _CLEAR * h else 0.0
        cost += 0.01 * (off[hit].max(initial=0.0) / h)
        if cost < least - 1e-9:
            best, least = float(u), cost
    return best
