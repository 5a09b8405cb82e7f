"""Equations that hold between two primitives: parallel, perpendicular, coaxial, coplanar, equal radius, and the ways to be tangent.

An equation's value is an angle in radians or a length; both are of order one where the part has been scaled by its extent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from scan2nurbs.surfaces.jets import Jet, JetShape, jet_pair
from scan2nurbs.surfaces.shape import KINDS, Floats
from scan2nurbs.surfaces.shape_parameters import Primitive

ANGLE, LENGTH = 0, 1
Equation = tuple[Jet, int]
Equations = Callable[[JetShape, JetShape], list[Equation]]


class Values(NamedTuple):
    """Values (m,) of m equations, their derivatives (m, k) by the parameters of both shapes, and whether each is an angle or a length."""

    value: Floats
    slope: Floats
    unit: tuple[int, ...]


def evaluate(equations: Equations, first: Primitive, second: Primitive) -> Values:
    """Evaluate equations between two primitives."""
    rows = equations(*jet_pair(first, second))
    return Values(np.array([float(j.value) for j, _ in rows]), np.array([j.slope for j, _ in rows]), tuple(unit for _, unit in rows))


def parallel(s: JetShape, t: JetShape) -> list[Equation]:
    """Make directions parallel, either way."""
    turn = s.axis.cross(t.axis)
    return [(turn.along(s.x), ANGLE), (turn.along(s.y), ANGLE)]


def perpendicular(s: JetShape, t: JetShape) -> list[Equation]:
    """Make directions perpendicular."""
    return [(s.axis.dot(t.axis), ANGLE)]


def on_axis(s: JetShape, t: JetShape) -> list[Equation]:
    """Put the origin of the second (a centre) on the axis of the first."""
    offset = t.origin - s.origin
    away = offset - s.axis.times(offset.dot(s.axis))
    return [(away.along(s.x), LENGTH), (away.along(s.y), LENGTH)]


def coaxial(s: JetShape, t: JetShape) -> list[Equation]:
    """Make two axes one line."""
    return parallel(s, t) + on_axis(s, t)


def coplanar(s: JetShape, t: JetShape) -> list[Equation]:
    """Make two planes one."""
    return [*parallel(s, t), (s.axis.dot(t.origin - s.origin), LENGTH)]


def equal_radius(s: JetShape, t: JetShape) -> list[Equation]:
    """Make radii equal, of tori those of the tubes."""
    return [(_tube(s) - _tube(t), LENGTH)]


def tangencies(first: Primitive, second: Primitive) -> list[Equations]:
    """Return the ways in which two primitives, the first of the kind that comes earlier in `KINDS`, may meet smoothly along a curve."""
    if KINDS.index(first.kind) > KINDS.index(second.kind):
        return []
    ways = _TANGENCIES.get((first.kind, second.kind), [])
    return [_signed(way, sign) for way in ways for sign in ((1.0,) if way in _ONE_WAY else (1.0, -1.0))]


def _signed(way: Callable[[JetShape, JetShape, float], list[Equation]], sign: float) -> Equations:
    return lambda s, t: way(s, t, sign)


def _tube(s: JetShape) -> Jet:
    return s.b if s.kind == "torus" else s.a


def _plane_round(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Lay a cylinder, sphere or torus on a plane, a torus along a circle."""
    touch = (s.axis.dot(t.origin - s.origin) - _tube(t).scaled(sign), LENGTH)
    return [*{"cylinder": perpendicular, "torus": parallel}.get(t.kind, _nothing)(s, t), touch]


def _nothing(_s: JetShape, _t: JetShape) -> list[Equation]:
    return []


def _plane_cone(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Put the apex on the plane, which leans from the axis by the half angle; times the sine, as flat cones have far apices."""
    sine = t.b.sine()
    offset = (t.origin - s.origin).times(sine) - t.axis.times(t.a.times(t.b.cosine()))
    return [(s.axis.dot(t.axis) - sine.scaled(sign), ANGLE), (s.axis.dot(offset), LENGTH)]


def _away(s: JetShape, t: JetShape) -> Jet:
    """Return the distance of the origin of t from the axis of s."""
    offset = t.origin - s.origin
    return (offset - s.axis.times(offset.dot(s.axis))).length()


def _cylinders(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Let two cylinders touch along a line, from outside (+) or inside (−)."""
    apart = s.a + t.a if sign > 0 else (s.a - t.a if s.a.value > t.a.value else t.a - s.a)
    return [*parallel(s, t), (_away(s, t) - apart, LENGTH)]


def _cylinder_sphere(s: JetShape, t: JetShape, _sign: float) -> list[Equation]:
    """End a cylinder by a ball."""
    return [*on_axis(s, t), (s.a - t.a, LENGTH)]


def _cylinder_torus_about(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Let a torus about the cylinder's axis touch it along a circle."""
    return [*coaxial(s, t), (t.a + t.b.scaled(sign) - s.a, LENGTH)]


def _cylinder_torus_bend(s: JetShape, t: JetShape, _sign: float) -> list[Equation]:
    """Let a cylinder run on into the bent tube of a torus."""
    return [
        (s.axis.dot(t.axis), ANGLE),
        (t.axis.dot(s.origin - t.origin), LENGTH),
        (_away(s, t) - t.a, LENGTH),
        (s.a - t.b, LENGTH),
    ]


def _cone_round(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Let a sphere in a cone, or a torus about its axis, touch it along a circle."""
    height = s.axis.dot(t.origin - s.origin)
    out = s.a.scaled(-1.0) if t.kind == "sphere" else t.a - s.a
    touch = (out.times(s.b.cosine()) - height.times(s.b.sine()) - _tube(t).scaled(sign), LENGTH)
    return [*(on_axis if t.kind == "sphere" else coaxial)(s, t), touch]


def _sphere_torus_bend(s: JetShape, t: JetShape, _sign: float) -> list[Equation]:
    """End the tube of a torus by a ball."""
    offset = s.origin - t.origin
    return [(t.axis.dot(offset), LENGTH), (offset.length() - t.a, LENGTH), (s.a - t.b, LENGTH)]


def _sphere_torus_about(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Let a torus touch a sphere on its axis along a circle."""
    offset = s.origin - t.origin
    apart = (offset.dot(offset) + t.a.times(t.a)).value ** 0.5
    square = offset.dot(offset) + t.a.times(t.a)
    distance = Jet(np.asarray(apart), square.slope / max(2.0 * float(apart), 1e-300))
    radii = s.a + t.b if sign > 0 else (s.a - t.b if s.a.value > t.b.value else t.b - s.a)
    return [*on_axis(t, s), (distance - radii, LENGTH)]


def _tori_about(s: JetShape, t: JetShape, sign: float) -> list[Equation]:
    """Let two tori about one axis touch along a circle, from outside (+) or inside (−)."""
    height, wide = s.axis.dot(t.origin - s.origin), t.a - s.a
    square = height.times(height) + wide.times(wide)
    apart = max(float(square.value) ** 0.5, 1e-300)
    radii = s.b + t.b if sign > 0 else (s.b - t.b if s.b.value > t.b.value else t.b - s.b)
    return [*coaxial(s, t), (Jet(np.asarray(apart), square.slope / (2.0 * apart)) - radii, LENGTH)]


_TANGENCIES: dict[tuple[str, str], list[Callable[[JetShape, JetShape, float], list[Equation]]]] = {
    ("plane", "cylinder"): [_plane_round],
    ("plane", "cone"): [_plane_cone],
    ("plane", "sphere"): [_plane_round],
    ("plane", "torus"): [_plane_round],
    ("cylinder", "cylinder"): [_cylinders],
    ("cylinder", "sphere"): [_cylinder_sphere],
    ("cylinder", "torus"): [_cylinder_torus_about, _cylinder_torus_bend],
    ("cone", "sphere"): [_cone_round],
    ("cone", "torus"): [_cone_round],
    ("sphere", "torus"): [_sphere_torus_bend, _sphere_torus_about],
    ("torus", "torus"): [_tori_about],
}
_ONE_WAY = (_cylinder_sphere, _cylinder_torus_bend, _sphere_torus_bend)
