"""Fit a planar B-spline curve to scattered points about it, and measure distances from it: profiles of swept surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.shape import Floats

_DEGREE = 3
_FAIRNESS = 1e-3
_ROUNDS = 6
_MOST_SPANS = 256
_LEAST_SPAN = 4.0
"""Spans shorter than so many deviations of the points would follow the noise in zigzags."""
_STARTS_PER_SPAN = 8
_NODES = 400


@dataclass(frozen=True, eq=False)
class PlanarCurve:
    """A planar cubic B-spline curve; straight on beyond its ends where it is open.

    Attributes
    ----------
    knots : (m,) float64
        Clamped where open; periodic where closed: then the last three control points are the first three.
    control_points : (n, 2) float64
    closed : bool
    """

    knots: Floats
    control_points: Floats
    closed: bool

    @cached_property
    def spline(self) -> BSpline:
        """The curve as SciPy's spline."""
        return BSpline(self.knots, self.control_points, _DEGREE)

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return float(self.knots[_DEGREE]), float(self.knots[-_DEGREE - 1])

    @property
    def freedom(self) -> int:
        """Free control points: each is worth one parameter, as moving along the curve changes little."""
        return len(self.control_points) - (_DEGREE if self.closed else 0)

    def project(self, points: Floats, start: Floats | None = None) -> Floats:
        """Return the parameters (N,) of the feet of points (N, 2), by Newton's method; beyond the domain off the ends of an open curve."""
        low, high = self.domain
        if start is None:
            grid, tree = self._starts
            start = grid[tree.query(points)[1]]
        t, width = np.array(start, np.float64), (high - low) / max(len(np.unique(self.knots)) - 1, 1)
        for _ in range(8):
            c, d, dd = self.at(t)
            off = points - c
            slope, bend = np.einsum("ni,ni->n", off, d), np.einsum("ni,ni->n", d, d) - np.einsum("ni,ni->n", off, dd)
            square = np.einsum("ni,ni->n", d, d)
            step = np.clip(slope / np.where(bend > 0.2 * square, bend, square), -0.5 * width, 0.5 * width)
            t = t + step
            if self.closed:
                t = low + np.mod(t - low, high - low)
            if np.abs(step).max(initial=0.0) < 1e-12 * (high - low):
                break
        return t

    def at(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points, first and second derivatives (N, 2) at parameters."""
        low, high = self.domain
        inside = np.clip(t, low, high)
        c, d, dd = self.spline(inside), self._first(inside), self._second(inside)
        beyond = t - inside
        return c + beyond[:, None] * d, d, np.where((beyond == 0.0)[:, None], dd, 0.0)

    def distance(self, points: Floats) -> tuple[Floats, Floats]:
        """Return signed distances (N,) of points (N, 2), positive to the right of the curve, and unit normals (N, 2) to that side."""
        c, d, _ = self.at(self.project(points))
        normal = np.stack([d[:, 1], -d[:, 0]], axis=1) / np.maximum(np.linalg.norm(d, axis=1), 1e-300)[:, None]
        return np.einsum("ni,ni->n", points - c, normal), normal

    @cached_property
    def _first(self) -> BSpline:
        return self.spline.derivative()

    @cached_property
    def _second(self) -> BSpline:
        return self.spline.derivative(2)

    @cached_property
    def _starts(self) -> tuple[Floats, KDTree]:
        low, high = self.domain
        grid = np.linspace(low, high, _STARTS_PER_SPAN * (len(np.unique(self.knots)) - 1) + 1)
        return grid, KDTree(self.spline(grid))


def fit_profile(points: Floats, noise: float) -> PlanarCurve:
    """Fit a curve to points scattered about it, with as few spans as leave residuals that are noise.

    Parameters
    ----------
    points : (N, 2) float64
        In no order.
    noise : float
        Their standard deviation across the curve.

    Raises
    ------
    NoResultError
        If the points do not lie along one curve without branches.
    """
    nodes, closed = trace(points, noise)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    t = _onto_polyline(points, nodes, length)
    most = min(_MOST_SPANS, len(points) // 8, max(int(length[-1] / max(_LEAST_SPAN * noise, 1e-300)), 8))
    spans, before = (4 if closed else 1), np.inf
    while True:
        curve, t_new = _fit(points, t, float(length[-1]), spans, closed)
        d = curve.distance(points)[0]
        left = study(np.c_[curve.at(t_new)[0], np.zeros(len(points))], d, max(noise, 1e-9 * float(length[-1])))
        better = left.systematic < 0.9 * before
        if (left.systematic <= 0.25 * noise and left.off < 0.1) or left.chance > 1e-3 or 2 * spans > most:
            return curve
        if not better and spans > 32:
            return curve
        before, t, spans = min(before, left.systematic), t_new, 2 * spans


def trace(points: Floats, noise: float) -> tuple[Floats, bool]:
    """Return a polyline (K, 2) through points scattered about a curve, and whether it closes (its first point is repeated then)."""
    size = float(np.ptp(points, axis=0).max())
    cell = max(6.0 * noise, size / _NODES)
    nodes = _thin(points, cell)
    if len(nodes) < 3:
        raise NoResultError("The points do not lie along a curve that is longer than their noise.")
    pairs = KDTree(nodes).query_pairs(3.0 * cell, output_type="ndarray")
    weight = ((nodes[pairs[:, 0]] - nodes[pairs[:, 1]]) ** 2).sum(axis=1)
    # Squared lengths make paths go from node to node rather than skip some.
    graph = coo_array((np.concatenate([weight, weight]), (pairs.T.ravel(), pairs[:, ::-1].T.ravel())), shape=(len(nodes),) * 2).tocsr()
    tree = minimum_spanning_tree(graph)
    tree = tree + tree.T
    reached = dijkstra(tree, indices=0)
    if not np.isfinite(reached).all():
        raise NoResultError("The points do not lie along one curve: there is a gap.")
    first = int(np.argmax(reached))
    far, back = dijkstra(tree, indices=first, return_predecessors=True)
    path = [int(np.argmax(far))]
    while path[-1] != first:
        path.append(int(back[path[-1]]))
    on = nodes[path]
    if np.max(KDTree(on).query(nodes)[0]) > 3.0 * cell:
        raise NoResultError("The points do not lie along one curve: it has branches.")
    closed = len(path) > 8 and float(np.linalg.norm(on[0] - on[-1])) < 3.0 * cell
    return (np.concatenate([on, on[:1]]) if closed else on), closed


def _thin(points: Floats, cell: float) -> Floats:
    """Return the means of the points in square cells, and again of those that came too near each other."""
    for _ in range(2):
        key = np.floor(points / cell).astype(np.int64)
        _, group, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
        group = group.ravel()
        points = np.stack([np.bincount(group, points[:, i]) / count for i in range(2)], axis=1)
        points = points + 0.5 * cell
    return points - cell


def _onto_polyline(points: Floats, nodes: Floats, length: Floats) -> Floats:
    near = np.clip(KDTree(nodes).query(points)[1], 0, len(nodes) - 1)
    best, t = np.full(len(points), np.inf), np.zeros(len(points))
    for shift in (-1, 0):
        i = np.clip(near + shift, 0, len(nodes) - 2)
        side = nodes[i + 1] - nodes[i]
        share = np.clip(np.einsum("ni,ni->n", points - nodes[i], side) / np.maximum((side**2).sum(axis=1), 1e-300), 0.0, 1.0)
        off = ((points - nodes[i] - share[:, None] * side) ** 2).sum(axis=1)
        t = np.where(off < best, length[i] + share * (length[i + 1] - length[i]), t)
        best = np.minimum(best, off)
    return t


def _fit(points: Floats, t: Floats, end: float, spans: int, closed: bool) -> tuple[PlanarCurve, Floats]:
    """Alternate between control points and feet (The NURBS Book, section 9.4.1)."""
    low, high = (0.0, end) if closed else (float(t.min()), float(t.max()))
    breaks = np.linspace(low, high, spans + 1)
    p = _DEGREE
    if closed:
        knots = np.concatenate([breaks[-1 - p : -1] - (high - low), breaks, breaks[1 : p + 1] + (high - low)])
    else:
        knots = np.concatenate([np.full(p, low), breaks, np.full(p, high)])
    n = len(knots) - p - 1
    free = np.arange(n) % spans if closed else np.arange(n)
    merge = csc_array((np.ones(n), (np.arange(n), free)), shape=(n, int(free.max()) + 1))
    second = csc_array(np.diff(np.eye(n), 2, axis=0)) @ merge
    fair = (second.T @ second) * (_FAIRNESS * len(points) / n) + 1e-9 * len(points) / n * csc_array(merge.T @ merge)
    t = np.clip(t, low, np.nextafter(high, low))
    curve = PlanarCurve(knots, np.zeros((n, 2)), closed)
    for _ in range(_ROUNDS):
        basis = csc_array(BSpline.design_matrix(t, knots, p)) @ merge
        control = splu(csc_array(basis.T @ basis + fair)).solve(basis.T @ points)
        curve = PlanarCurve(knots, control[free], closed)
        moved = np.clip(curve.project(points, t), low, np.nextafter(high, low))
        small = np.abs(moved - t).max() < 1e-4 * (high - low) / spans
        t = moved
        if small:
            break
    return curve, t
