"""Curves in space that edges lie on: the simplest of line, circle and B-spline through ordered points."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline

from scan2nurbs.brep.curve import Curve
from scan2nurbs.brep.occ import to_knots, to_points
from scan2nurbs.surfaces.shape import unit

Floats = NDArray[np.float64]
Draw = Callable[[Floats], Floats]


@dataclass(frozen=True)
class SpaceCurve:
    """A curve over an interval.

    Attributes
    ----------
    kind : {"line", "circle", "spline"}
    origin, x, y : (3,) float64
        Of a line its point and (x) direction; of a circle its centre and axes.
    radius : float
        Of a circle.
    spline : Curve or None
    domain : (float, float)
        Lengths along a line, radians on a circle.
    """

    kind: str
    origin: Floats
    x: Floats
    y: Floats
    radius: float
    spline: Curve | None
    domain: tuple[float, float]

    def __call__(self, t: Floats) -> Floats:
        """Return the points (N, 3) at parameters (N,)."""
        if self.kind == "line":
            return self.origin + np.asarray(t)[:, None] * self.x
        if self.kind == "circle":
            return self.origin + self.radius * (np.cos(t)[:, None] * self.x + np.sin(t)[:, None] * self.y)
        assert self.spline is not None
        return self.spline(t)

    def samples(self, least: int) -> Floats:
        """Return at least `least` parameters from start to end, closer where the curve has more pieces."""
        if self.spline is not None:
            return self.spline.samples(max(4, -(-least // max(1, len(np.unique(self.spline.knots)) - 1))))
        count = least if self.kind == "line" else max(least, int(24 * (self.domain[1] - self.domain[0]) / np.pi) + 4)
        return np.linspace(*self.domain, count)

    def started_at(self, t: float) -> SpaceCurve:
        """Return a closed curve that starts and ends at a parameter; a spline is laid anew through its points."""
        low, high = self.domain
        if t <= low or t >= high or self.kind == "line":
            return self
        if self.kind == "circle":
            x, y = np.cos(t) * self.x + np.sin(t) * self.y, np.cos(t) * self.y - np.sin(t) * self.x
            return SpaceCurve("circle", self.origin, x, y, self.radius, None, (0.0, high - low))
        assert self.spline is not None
        knots = np.unique(self.spline.knots)
        step = 0.1 * float(np.diff(knots).min())
        after, before = knots[(knots > t + step)], knots[(knots < t - step)]
        return interpolate(self(np.concatenate([[t], after, before[before > low], [t]])), True)

    def in_kernel(self, t: float, scale: float) -> float:
        """Return the parameter of the kernel's curve that belongs to a parameter."""
        return t * scale if self.kind == "line" else t

    def geometry(self, scale: float) -> Any:
        """Return the kernel's ``Geom_Curve``, its lengths times `scale`."""
        from OCP.Geom import Geom_BSplineCurve, Geom_Circle, Geom_Line
        from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

        origin = gp_Pnt(*(self.origin * scale).tolist())
        if self.kind == "line":
            return Geom_Line(origin, gp_Dir(*self.x.tolist()))
        if self.kind == "circle":
            normal = np.cross(self.x, self.y)
            return Geom_Circle(gp_Ax2(origin, gp_Dir(*normal.tolist()), gp_Dir(*self.x.tolist())), self.radius * scale)
        assert self.spline is not None
        return Geom_BSplineCurve(to_points(self.spline.control_points * scale), *to_knots(self.spline.knots), self.spline.degree)


def lay_curve(points: Floats, *, closed: bool, tolerance: float, draw: Draw | None = None) -> SpaceCurve:
    """Lay a spline through ordered points.

    Parameters
    ----------
    points : (K, 3) float64
        From start to end, distinct; the last repeats the first on a closed curve.
    closed : bool
        Whether the curve closes smoothly.
    tolerance : float
        Largest distance that a spline may have, midway between its points, to where `draw` puts these middles.
    draw : callable, optional
        Draws points onto the border; points are added where the spline strays from it.
    """
    for _ in range(5):
        curve = interpolate(points, closed)
        if draw is None or len(points) > 400:
            break
        knots = _parameters(points)
        middles = 0.5 * (knots[:-1] + knots[1:])
        drawn = draw(curve(middles))
        astray = np.linalg.norm(drawn - curve(middles), axis=1)
        sides = np.linalg.norm(np.diff(points, axis=0), axis=1)
        # A middle that is drawn out of its interval would turn the curve back.
        fits = (np.linalg.norm(drawn - points[:-1], axis=1) < 0.7 * sides) & (np.linalg.norm(drawn - points[1:], axis=1) < 0.7 * sides)
        if not closed:
            fits[[0, -1]] &= astray[[0, -1]] > 0.05 * sides[[0, -1]]
        add = np.flatnonzero((astray > tolerance) & fits)
        if not len(add):
            break
        points = np.insert(points, add + 1, drawn[add], axis=0)
    return interpolate(points, closed)


def simple_curve(points: Floats, closed: bool, simple: float, slack: float) -> SpaceCurve | None:
    """Return the line or the circle through ordered points, if there is one.

    Parameters
    ----------
    points : (K, 3) float64
        From start to end; the last repeats the first on a closed curve.
    closed : bool
    simple : float
        Largest distance of the points between the ends.
    slack : float
        Largest distance of the ends.
    """
    inner = points if closed or len(points) < 6 else points[1:-1]
    return (None if closed else _line(points, inner, simple, slack)) or _circle(points, inner, closed, simple, slack)


def interpolate(points: Floats, closed: bool) -> SpaceCurve:
    """Return the cubic spline through ordered points, with chord lengths as parameters; smooth at its ends if closed."""
    t = _parameters(points)
    if closed and len(points) > 3:
        ends = CubicSpline(t, points, bc_type="periodic")(t[[0, -1]], 1)
        made = make_interp_spline(t, points, k=3, bc_type=([(1, ends[0])], [(1, ends[1])]))
    else:
        made = make_interp_spline(t, points, k=min(3, len(points) - 1))
    control = np.ascontiguousarray(made.c)
    control[0], control[-1] = points[0], points[-1]
    zero = np.zeros(3)
    return SpaceCurve("spline", zero, zero, zero, 0.0, Curve(int(made.k), made.t, control), (float(t[0]), float(t[-1])))


def _parameters(points: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _line(points: Floats, inner: Floats, simple: float, slack: float) -> SpaceCurve | None:
    centre = inner.mean(axis=0)
    x = np.linalg.svd(inner - centre, full_matrices=False)[2][0]
    x = x if x @ (points[-1] - points[0]) >= 0 else -x
    if len(points) < 6:
        centre, x = points[0], unit(points[-1] - points[0])

    def off(at: Floats) -> float:
        offset = at - centre
        return float(np.linalg.norm(offset - (offset @ x)[:, None] * x, axis=1).max())

    low, high = ((points[[0, -1]] - centre) @ x).tolist()
    if off(inner) > simple or off(points[[0, -1]]) > slack or high - low <= 2.0 * slack * 1e-3:
        return None
    zero = np.zeros(3)
    return SpaceCurve("line", centre + low * x, x, zero, 0.0, None, (0.0, high - low))


def _circle(points: Floats, inner: Floats, closed: bool, simple: float, slack: float) -> SpaceCurve | None:
    """Return the circle, or the arc between the ends, that is near all points."""
    if len(inner) < 4:
        return None
    centre = inner[:-1].mean(axis=0) if closed else inner.mean(axis=0)
    _, spread, axes = np.linalg.svd(inner - centre, full_matrices=False)
    if np.abs((inner - centre) @ axes[2]).max() > simple or spread[1] < 1e-9 * spread[0]:
        return None
    flat = (inner - centre) @ axes[:2].T
    middle, radius = _circle_through(flat)
    away = flat - middle
    if not 0 < radius < 1e3 * np.abs(flat).max() or np.abs(np.linalg.norm(away, axis=1) - radius).max() > simple:
        return None
    ends = (points[[0, -1]] - centre) @ axes.T
    if np.hypot(np.linalg.norm(ends[:, :2] - middle, axis=1) - radius, ends[:, 2]).max() > slack:
        return None
    turns = (away[:-1, 0] * away[1:, 1] - away[:-1, 1] * away[1:, 0]).sum()
    x = unit((ends[0, :2] - middle) @ axes[:2])
    y = np.cross(np.cross(axes[0], axes[1]) * np.sign(turns if turns else 1.0), x)
    around = points - centre - middle @ axes[:2]
    angle = np.unwrap(np.arctan2(around @ y, around @ x))
    end = 2.0 * np.pi if closed or (points[0] == points[-1]).all() else float(angle[-1])
    if not 0 < end <= 2.0 * np.pi + 1e-12 or (np.diff(angle) <= 0).any() or abs(angle[-1] - end) > 0.5:
        return None
    return SpaceCurve("circle", centre + middle @ axes[:2], x, y, radius, None, (0.0, end))


def _circle_through(flat: Floats) -> tuple[Floats, float]:
    """Return centre and radius of the circle through points (K, 2): Kåsa's, then steps of Gauss and Newton on the distances."""
    size = float(np.abs(flat).max())
    rows = np.column_stack([2.0 * flat / size, np.ones(len(flat))])
    found = np.linalg.lstsq(rows, (flat**2).sum(axis=1) / size**2, rcond=None)[0]
    middle, radius = found[:2] * size, float(np.sqrt(max(found[2] + found[:2] @ found[:2], 0.0))) * size
    for _ in range(3):
        away = flat - middle
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        rows = np.column_stack([away / distance[:, None], np.ones(len(flat))])
        step = np.linalg.lstsq(rows, distance - radius, rcond=None)[0]
        middle, radius = middle + step[:2], radius + float(step[2])
    return middle, radius
