"""From the borders of a face to closed wires in its parameter rectangle, along seams and poles where the face goes around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.layout import Layout
from scan2nurbs.brep.overlay import area
from scan2nurbs.edges.corrections import in_polygon
from scan2nurbs.errors import NoResultError

Floats = NDArray[np.float64]

POLE_LOW, POLE_HIGH, CORNER = -1, -2, -3
"""Vertices that no border ends in: the poles of a surface, and the point where the two seams of a torus meet."""


@dataclass(frozen=True)
class Step:
    """A piece of a border in a wire.

    Attributes
    ----------
    piece : int
        Its number among all pieces.
    forward : bool
    uv : (K, 2) float64
        Its parameters in the order of the piece, within the rectangle.
    nodes : (int, int)
        Vertices in the order of the wire.
    """

    piece: int
    forward: bool
    uv: Floats
    nodes: tuple[int, int]

    @property
    def path(self) -> Floats:
        """Parameters in the order of the wire."""
        return self.uv if self.forward else self.uv[::-1]


@dataclass(frozen=True)
class Side:
    """A stretch of a wire on the border of the parameter rectangle: on a seam, or in a pole.

    Attributes
    ----------
    axis : int
        The parameter that is constant: 0 for u, 1 for v.
    value : float
        Its value.
    high : bool
        Whether that is its upper end.
    low, top : float
        Range of the other parameter; the wire passes it upward on the right and the lower side, downward on the others.
    nodes : (int, int)
        Vertices at `low` and `top`.
    """

    axis: int
    value: float
    high: bool
    low: float
    top: float
    nodes: tuple[int, int]

    @property
    def forward(self) -> bool:
        """Whether the wire passes it upward."""
        return self.high == (self.axis == 0)

    @property
    def path(self) -> Floats:
        """Its ends (2, 2) in the order of the wire."""
        ends = np.empty((2, 2))
        ends[:, self.axis] = self.value
        ends[:, 1 - self.axis] = (self.low, self.top) if self.forward else (self.top, self.low)
        return ends


Wire = tuple[Step | Side, ...]


def regions(layout: Layout, loops: Sequence[Sequence[Step]]) -> list[list[Wire]]:
    """Return the connected regions of a face, each as its outer wire and its holes.

    Parameters
    ----------
    layout : Layout
    loops : sequence of sequences of Step
        Pieces in order, the face on the left; each within one period from the chart's start.

    Raises
    ------
    NoResultError
        If the loops do not bound a region.
    """
    rings, chains = _chains(layout, loops)
    wires = [tuple(ring) for ring in rings] + _Walls(layout, chains).wires()
    outlines = [np.vstack([part.path for part in wire]) for wire in wires]
    areas = [area(line) for line in outlines]
    outer = [k for k, area in enumerate(areas) if area > 0]
    if not outer:
        if not any(layout.cut):
            raise NoResultError("Its borders do not enclose it.")
        wires.append(_Walls(layout, []).whole())
        outlines.append(np.vstack([part.path for part in wires[-1]]))
        areas.append(area(outlines[-1]))
        outer = [len(wires) - 1]
    result = {k: [wires[k]] for k in outer}
    for k, wire in enumerate(wires):
        if k not in result:
            holders = [o for o in outer if in_polygon(outlines[k][:1], outlines[o])[0]] or outer
            result[min(holders, key=lambda o: areas[o])].append(wire)
    return list(result.values())


def _chains(layout: Layout, loops: Sequence[Sequence[Step]]) -> tuple[list[list[Step]], list[list[Step]]]:
    """Break loops where they jump from one side of the rectangle to the other."""
    rings, chains = [], []
    periods = np.array([p if p and c else np.inf for p, c in zip(layout.chart.period, layout.cut, strict=True)])
    for loop in loops:
        jumps = [bool((np.abs(loop[k].path[0] - loop[k - 1].path[-1]) > 0.5 * periods).any()) for k in range(len(loop))]
        if not any(jumps):
            rings.append(list(loop))
            continue
        first = jumps.index(True)
        turned, broken = [*loop[first:], *loop[:first]], [*jumps[first:], *jumps[:first]]
        for step, jump in zip(turned, broken, strict=True):
            if jump:
                chains.append([])
            chains[-1].append(step)
    return rings, chains


class _Walls:
    """The border of the parameter rectangle: lower, right, upper and left wall, passed counter-clockwise.

    Nodes are where borders meet a seam; they lie on both of its
    walls.
    """

    def __init__(self, layout: Layout, chains: list[list[Step]]) -> None:
        self.layout, self.chains = layout, chains
        chart, cut = layout.chart, layout.cut
        self.low = np.array(chart.start)
        self.high = np.array([s + p if p else np.inf for s, p in zip(chart.start, chart.period, strict=True)])
        # Where a direction is not cut, its parameters may lie in any one period.
        self.low[[not c for c in cut]], self.high[[not c for c in cut]] = -np.inf, np.inf
        self.solid = [cut[1], cut[0], cut[1], cut[0]]
        poles = chart.poles
        if chart.period[1] is None:
            self.low[1] = -np.inf if poles[0] is None else poles[0]
            self.high[1] = np.inf if poles[1] is None else poles[1]
            self.solid[0], self.solid[2] = poles[0] is not None, poles[1] is not None
        self._bound()
        self.nodes: tuple[dict[int, float], dict[int, float]] = ({}, {})
        self.starts = [self._meet(chain[0].path[0], chain[0].nodes[0]) for chain in chains]
        self.ends = [self._meet(chain[-1].path[-1], chain[-1].nodes[1]) for chain in chains]

    def _bound(self) -> None:
        """Give an unbounded direction ends that no chain reaches."""
        uv = np.vstack([step.uv for chain in self.chains for step in chain]) if self.chains else np.zeros((1, 2))
        for axis in (0, 1):
            margin = 1.0 + np.ptp(uv[:, axis])
            if not np.isfinite(self.low[axis]):
                self.low[axis] = uv[:, axis].min() - margin
            if not np.isfinite(self.high[axis]):
                self.high[axis] = uv[:, axis].max() + margin

    def _meet(self, uv: Floats, node: int) -> tuple[int, int]:
        """Return the wall that a chain's end lies on, and its node."""
        off = np.abs(np.stack([uv - self.low, uv - self.high])) / (self.high - self.low)
        off[:, [not cut for cut in self.layout.cut]] = np.inf
        high, axis = np.unravel_index(int(np.argmin(off)), off.shape)
        self.nodes[axis].setdefault(node, float(uv[1 - axis]))
        return ((3, 1) if axis == 0 else (0, 2))[int(high)], node

    def _share(self, wall: int, value: float) -> float:
        axis = wall % 2
        share = (value - self.low[axis]) / (self.high[axis] - self.low[axis])
        return float(np.clip(share if wall < 2 else 1.0 - share, 0.0, 1.0))

    def _stops(self) -> list[tuple[int, float, int]]:
        """Return where the border is divided, in order: wall, share of it passed, and node; at corners, and at nodes on seams."""
        both = all(self.layout.cut)
        low, high = (CORNER, CORNER) if both else (POLE_LOW, POLE_HIGH)
        stops = [(0, 0.0, low), (1, 0.0, low), (2, 0.0, high), (3, 0.0, high)]
        for axis in (0, 1):
            for node, value in self.nodes[axis].items():
                stops += [(wall, self._share(wall, value), node) for wall in ((1, 3) if axis == 0 else (0, 2))]
        return sorted(stops)

    def wires(self) -> list[Wire]:
        """Join the chains along the walls so that the region stays on the left."""
        stops = self._stops()
        where = {(wall, node): k for k, (wall, _, node) in enumerate(stops) if node >= 0}
        starts = {where[start]: k for k, start in enumerate(self.starts)}
        left = list(range(len(self.chains)))
        wires = []
        while left:
            first = current = left[0]
            wire: list[Step | Side] = []
            while True:
                if current not in left:
                    raise NoResultError("Its borders cross its seam in the wrong order.")
                left.remove(current)
                wire += self.chains[current]
                stop = where[self.ends[current]]
                for _ in range(len(stops)):
                    if stop in starts:
                        break
                    wire.append(self._side(stops, stop))
                    stop = (stop + 1) % len(stops)
                else:
                    raise NoResultError("Its borders cross its seam in the wrong order.")
                current = starts[stop]
                if current == first:
                    break
            wires.append(tuple(wire))
        return wires

    def whole(self) -> Wire:
        """Return the whole border of the rectangle."""
        stops = self._stops()
        return tuple(self._side(stops, k) for k in range(len(stops)))

    def _side(self, stops: list[tuple[int, float, int]], k: int) -> Side:
        (wall, begin, first), (following, end, last) = stops[k], stops[(k + 1) % len(stops)]
        if not self.solid[wall]:
            raise NoResultError("Its borders leave it open on one side.")
        axis = 1 - wall % 2
        shares = np.array([begin, end if following == wall else 1.0])
        values = self.low[1 - axis] + (shares if wall < 2 else 1.0 - shares) * (self.high[1 - axis] - self.low[1 - axis])
        high = wall in (1, 2)
        pairs = [(float(values[0]), first), (float(values[1]), last)]
        if wall >= 2:
            pairs.reverse()
        return Side(axis, float((self.high if high else self.low)[axis]), high, pairs[0][0], pairs[1][0], (pairs[0][1], pairs[1][1]))
