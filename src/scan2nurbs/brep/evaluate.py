"""Exact points and derivatives of CAD surfaces at many parameters at once, without a call into the CAD kernel for each."""

# pyright: reportAttributeAccessIssue=false
from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.occ import from_surface
from scan2nurbs.errors import ParameterError

Floats: TypeAlias = NDArray[np.float64]
Evaluator: TypeAlias = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]
"""(u (N,), v (N,)) to the points S, and the derivatives S_u and S_v there, (N, 3) each."""


def evaluator(adaptor: Any) -> Evaluator:
    """Return the evaluator of a ``BRepAdaptor_Surface``.

    Planes, cylinders, cones, spheres, tori, Bézier and B-spline surfaces are evaluated with numpy; any other kind (offset surfaces,
    surfaces of revolution or extrusion of a free curve) asks the CAD kernel point by point.
    """
    make = _MAKERS.get(adaptor.GetType().name.removeprefix("GeomAbs_"))
    return _pointwise(adaptor) if make is None else make(adaptor)


def _frame(position: Any) -> Floats:
    """Origin, X, Y and Z direction of an axis system, (4, 3); it may be left-handed."""
    parts = (position.Location(), position.XDirection(), position.YDirection(), position.Direction())
    return np.array([(p.X(), p.Y(), p.Z()) for p in parts])


def _plane(adaptor: Any) -> Evaluator:
    origin, x, y, _ = _frame(adaptor.Plane().Position())

    def evaluate(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        points = origin + u[:, None] * x + v[:, None] * y
        return points, np.broadcast_to(x, points.shape), np.broadcast_to(y, points.shape)

    return evaluate


def _cylinder(adaptor: Any) -> Evaluator:
    shape = adaptor.Cylinder()
    radius = shape.Radius()
    return _revolved(_frame(shape.Position()), lambda v: (np.full_like(v, radius), np.zeros_like(v), v, np.ones_like(v)))


def _cone(adaptor: Any) -> Evaluator:
    shape = adaptor.Cone()
    radius, sine, cosine = shape.RefRadius(), np.sin(shape.SemiAngle()), np.cos(shape.SemiAngle())
    return _revolved(_frame(shape.Position()), lambda v: (radius + v * sine, np.full_like(v, sine), v * cosine, np.full_like(v, cosine)))


def _sphere(adaptor: Any) -> Evaluator:
    return _rounded(_frame(adaptor.Sphere().Position()), 0.0, adaptor.Sphere().Radius())


def _torus(adaptor: Any) -> Evaluator:
    shape = adaptor.Torus()
    return _rounded(_frame(shape.Position()), shape.MajorRadius(), shape.MinorRadius())


def _rounded(frame: Floats, major: float, minor: float) -> Evaluator:
    """Evaluate a torus; a sphere is one of major radius zero."""
    return _revolved(frame, lambda v: (major + minor * np.cos(v), -minor * np.sin(v), minor * np.sin(v), minor * np.cos(v)))


def _revolved(frame: Floats, profile: Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]) -> Evaluator:
    """Revolve a profile; it gives radius, its derivative, height and its derivative at v."""
    origin, x, y, z = frame

    def evaluate(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        radius, d_radius, height, d_height = profile(v)
        outward = np.cos(u)[:, None] * x + np.sin(u)[:, None] * y
        along = np.cos(u)[:, None] * y - np.sin(u)[:, None] * x
        points = origin + radius[:, None] * outward + height[:, None] * z
        return points, radius[:, None] * along, d_radius[:, None] * outward + d_height[:, None] * z

    return evaluate


def _pointwise(adaptor: Any) -> Evaluator:
    def evaluate(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        from OCP.gp import gp_Pnt, gp_Vec

        point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
        out = np.empty((3, len(u), 3))
        for i in range(len(u)):
            adaptor.D1(u[i], v[i], point, along_u, along_v)
            for row, value in enumerate((point, along_u, along_v)):
                out[row, i] = value.X(), value.Y(), value.Z()
        return out[0], out[1], out[2]

    return evaluate


def _bezier(adaptor: Any) -> Evaluator:
    from OCP.GeomConvert import GeomConvert

    return _tensor_product(GeomConvert.SurfaceToBSplineSurface_s(adaptor.Bezier()), adaptor)


def _bspline(adaptor: Any) -> Evaluator:
    return _tensor_product(adaptor.BSpline(), adaptor)


def _tensor_product(surface: Any, adaptor: Any) -> Evaluator:
    u_first, u_last, v_first, v_last = surface.Bounds()
    periods = (surface.UPeriod() if surface.IsUPeriodic() else 0.0, surface.VPeriod() if surface.IsVPeriodic() else 0.0)
    try:
        arrays = from_surface(_clamped(surface))
    except ParameterError:  # e.g. of a degree above what the kernels take
        return _pointwise(adaptor)
    low, high = np.array([u_first, v_first]), np.array([u_last, v_last])

    def evaluate(u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        uv = np.column_stack([u, v])
        for column, period in enumerate(periods):
            if period:
                uv[:, column] = low[column] + (uv[:, column] - low[column]) % period
        # Faces may reach a tolerance beyond the surface they lie on.
        found = arrays.derivatives(np.clip(uv, low, high))
        return found[:, 0], found[:, 1], found[:, 2]

    return evaluate


def _clamped(surface: Any) -> Any:
    """Return the surface with its periods opened and its knot vectors clamped at the ends of its domain."""
    if not (surface.IsUPeriodic() or surface.IsVPeriodic()):
        return surface
    bounds = surface.Bounds()
    opened = surface.Copy()
    opened.SetUNotPeriodic()
    opened.SetVNotPeriodic()
    opened.Segment(*bounds)  # opening a period leaves knots beyond the domain
    return opened


_MAKERS: dict[str, Callable[[Any], Evaluator]] = {
    "Plane": _plane,
    "Cylinder": _cylinder,
    "Cone": _cone,
    "Sphere": _sphere,
    "Torus": _torus,
    "BezierSurface": _bezier,
    "BSplineSurface": _bspline,
}
