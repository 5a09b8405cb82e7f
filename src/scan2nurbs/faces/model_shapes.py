"""Models of kernels as shapes: their distances and normals for many points at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.primitives import CYLINDER, PLANE, SPHERE, TORUS, distance_of
from scan2nurbs.kernels.runner import kernel
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape import Shape
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus


def shape_of(model: NDArray[np.float64], h: float) -> Shape:
    """Return the shape of a model that is no patch, in the cloud's unit."""
    kind, point, axis = int(model[0]), model[1:4] * h, model[4:7].copy()
    if kind == PLANE:
        return Plane(point=point, direction=axis)
    if kind == SPHERE:
        return Sphere(center=point, radius=float(model[7]) * h)
    if kind == CYLINDER:
        return Cylinder(point=point, axis=axis, radius=float(model[7]) * h)
    if kind == TORUS:
        return Torus(center=point, axis=axis, major=float(model[7]) * h, minor=float(model[8]) * h)
    angle, radius = float(model[8]), float(model[7]) * h
    if radius < 0.0:
        radius, angle = -radius, -angle
    return Cone(point=point, axis=axis if angle >= 0.0 else -axis, radius=radius, half_angle=abs(angle))


def signed_distances(model: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed distances (N,) of points (N, 3) in units of h from a model."""
    return field(model, points)[:, 0]


def unit_normals(model: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gradients (N, 3) of a model's distance at points (N, 3) in units of h."""
    return field(model, points)[:, 1:]


def field(model: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return signed distances and gradients (N, 4) of points (N, 3) in units of h."""
    out = np.empty((len(points), 4))
    _distances(model, np.ascontiguousarray(points), out)
    return out


@kernel
def _distances(m, points, out):
    for i in range(len(points)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = distance_of(m, points[i, 0], points[i, 1], points[i, 2])
