"""Extruded and revolved surfaces as B-spline surfaces that reach as far as their faces."""

from __future__ import annotations

from typing import Any

import numpy as np

from scan2nurbs.brep.curve import Curve
from scan2nurbs.brep.space import interpolate
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.shape import Floats, perpendicular

_MARGIN = 2.0
_PER_SPAN = 4
_TURNS = 48
_AXIS = 1.5


def extruded(shape: Any, points: Floats, h: float) -> BSplineSurface:
    """Return an extrusion as a surface: u along the profile, v along the direction, both 2 h beyond the border points.

    Parameters
    ----------
    shape : Extrusion
    points : (N, 3) float64
        Of the face's borders.
    h : float
    """
    flat = shape.flat(points)
    height = (points - shape.point) @ shape.direction
    profile = _reaching(shape.profile, flat, _MARGIN * h)
    low, high = float(height.min()) - _MARGIN * h, float(height.max()) + _MARGIN * h
    n = len(profile.control_points)
    control = np.stack([shape.lift(profile.control_points, np.full(n, z)) for z in (low, high)], axis=1)
    knots = (profile.knots, np.array([low, low, high, high]))
    return BSplineSurface((profile.degree, 1), knots, np.ascontiguousarray(control), np.ones((n, 2)), (bool(shape.profile.closed), False))


def revolved(shape: Any, points: Floats, h: float) -> BSplineSurface:
    """Return a revolution as a surface: u around the axis, v along the meridian, 2 h beyond the border points.

    Notes
    -----
    The circles are cubic splines of 48 spans, true to a millionth of their radius. A meridian that comes as near to the axis as a point
    of the scan could tell ends on it, in a pole.
    """
    meridian = _reaching(shape.meridian, shape.flat(points), _MARGIN * h)
    angle = np.linspace(0.0, 2.0 * np.pi, _TURNS + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    ring[-1] = ring[0]
    circle = interpolate(ring, True).spline
    assert circle is not None
    radius, height = meridian.control_points.T.copy()
    if not shape.meridian.closed:
        for end in (0, -1):
            radius[end] = 0.0 if radius[end] < _AXIS * h else radius[end]
    radius = np.maximum(radius, 0.0)
    x, y = perpendicular(shape.axis)
    away = circle.control_points[:, :1] * x + circle.control_points[:, 1:] * y
    control = shape.point + radius[None, :, None] * away[:, None] + height[None, :, None] * shape.axis
    size = control.shape[:2]
    closed = (True, bool(shape.meridian.closed))
    return BSplineSurface((circle.degree, meridian.degree), (circle.knots, meridian.knots), control, np.ones(size), closed)


def _reaching(curve: Any, flat: Floats, margin: float) -> Curve:
    """Return a profile as a clamped spline that reaches beyond all feet of planar points; straight on beyond its own ends."""
    low, high = curve.domain
    spans = max(4, len(np.unique(curve.knots)) - 1)
    if not curve.closed:
        feet = curve.project(flat)
        speed = np.linalg.norm(curve.at(np.array([low, high]))[1], axis=1)
        low, high = min(low, float(feet.min())) - margin / speed[0], max(high, float(feet.max())) + margin / speed[1]
    t = np.linspace(low, high, _PER_SPAN * spans + 1)
    points = curve.at(t)[0]
    if curve.closed:
        points[-1] = points[0]
    made = interpolate(points, bool(curve.closed)).spline
    assert made is not None
    return made
