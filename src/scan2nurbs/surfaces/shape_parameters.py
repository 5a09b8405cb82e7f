"""The parameters of plane, cylinder, cone, sphere and torus as increments in a frame of their own, and what they mean to people.

The order, which covariances and Jacobians follow; x, y = `perpendicular(axis)`, lengths in the points' unit, angles in radians:

    plane     shift along the direction; tilts of the direction towards x and y, about `point`
    cylinder  shifts along x and y; tilts of the axis towards x and y, about `point`; radius
    cone      shifts along x and y; tilts of the axis towards x and y, about `point`; radius at `point`; half angle
    sphere    shifts of the centre along the coordinate axes; radius
    torus     shifts of the centre along x, y and the axis; tilts of the axis towards x and y; major radius; minor radius
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import ParameterError
from scan2nurbs.kernels.shapes import CONE, CYLINDER, PLANE, SPHERE, TORUS
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape import Floats, Kind, Shape, perpendicular, unit
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

NUMBER = {"plane": PLANE, "cylinder": CYLINDER, "cone": CONE, "sphere": SPHERE, "torus": TORUS}
# Which of the kernel's seven columns are parameters.
COLUMNS: dict[str, NDArray[np.int64]] = {
    "plane": np.array([2, 3, 4]),
    "cylinder": np.array([0, 1, 3, 4, 5]),
    "cone": np.array([0, 1, 3, 4, 5, 6]),
    "sphere": np.array([0, 1, 2, 5]),
    "torus": np.array([0, 1, 2, 3, 4, 5, 6]),
}
Primitive = Plane | Cylinder | Cone | Sphere | Torus


class Pose(NamedTuple):
    """A primitive as the kernels want it."""

    kind: int
    frame: Floats
    a: float
    b: float


def pose(shape: Primitive) -> Pose:
    """Return the pose of a primitive: its frame (origin, x, y, z) as (12,) float64, and its two numbers."""
    if isinstance(shape, Sphere):
        return Pose(SPHERE, np.concatenate([shape.center, np.eye(3).ravel()]), shape.radius, 0.0)
    if isinstance(shape, Plane):
        return Pose(PLANE, _frame(shape.point, shape.direction), 0.0, 0.0)
    if isinstance(shape, Cylinder):
        return Pose(CYLINDER, _frame(shape.point, shape.axis), shape.radius, 0.0)
    if isinstance(shape, Cone):
        return Pose(CONE, _frame(shape.point, shape.axis), shape.radius, shape.half_angle)
    if isinstance(shape, Torus):
        return Pose(TORUS, _frame(shape.center, shape.axis), shape.major, shape.minor)
    raise ParameterError(f"A primitive must be a plane, cylinder, cone, sphere or torus. Got {type(shape).__name__} instead.")


def from_pose(kind: Kind, frame: Floats, a: float, b: float) -> Primitive:
    """Return the primitive of a pose."""
    origin, z = frame[:3].copy(), frame[9:].copy()
    if kind == "plane":
        return Plane(origin, z)
    if kind == "cylinder":
        return Cylinder(origin, z, float(a))
    if kind == "cone":
        return Cone(origin, z, float(a), float(b))
    if kind == "sphere":
        return Sphere(origin, float(a))
    return Torus(origin, z, float(a), float(b))


def moved(shape: Primitive, step: Floats) -> Primitive:
    """Return a primitive whose parameters, in the order above, were changed by a step (freedom,)."""
    kind, frame, a, b = pose(shape)
    full = np.zeros(7)
    full[COLUMNS[shape.kind]] = step
    origin, x, y, z = frame.reshape(4, 3)
    new = frame.copy()
    new[:3] = origin + full[0] * x + full[1] * y + full[2] * z
    if kind != SPHERE:
        new[9:] = unit(z + full[3] * x + full[4] * y)
    return from_pose(shape.kind, new, a + full[5], b + full[6])


def scaled(shape: Primitive, before: Floats, factor: float, after: Floats | None = None) -> Primitive:
    """Return a primitive shifted by `before` (3,), scaled by a factor about the origin, and shifted by `after` (3,)."""
    _, frame, a, b = pose(shape)
    frame = frame.copy()
    frame[:3] = (frame[:3] + before) * factor + (0.0 if after is None else after)
    return from_pose(shape.kind, frame, a * factor, b if shape.kind == "cone" else b * factor)


def lengths(kind: Kind) -> NDArray[np.bool_]:
    """Return which parameters of a kind are lengths; the others are angles."""
    return np.isin(COLUMNS[kind], [0, 1, 2, 5] if kind == "cone" else [0, 1, 2, 5, 6])


def recentred(shape: Primitive, point: Floats) -> Primitive:
    """Return the same surface with its point of reference as near to a given point (3,) as it may be."""
    if isinstance(shape, Plane):
        return Plane(point - shape.direction * float((point - shape.point) @ shape.direction), shape.direction)
    if isinstance(shape, Cylinder):
        return Cylinder(shape.point + shape.axis * float((point - shape.point) @ shape.axis), shape.axis, shape.radius)
    if isinstance(shape, Cone):
        height = float((point - shape.point) @ shape.axis)
        radius = shape.radius + height * np.tan(shape.half_angle)
        if radius > 0.0:
            return Cone(shape.point + shape.axis * height, shape.axis, float(radius), shape.half_angle)
    return shape


def uncertainty(shape: Shape, covariance: Floats | None) -> dict[str, float]:
    """Return standard deviations by name, lengths in the points' unit and angles in degrees.

    `position` is that of the axis at its point or of the centre, `axis` (or `direction`) the larger tilt, `half_angle` the cone's.
    """
    if covariance is None or shape.kind not in COLUMNS:
        return {}
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def largest(block: slice) -> float:
        return float(np.sqrt(max(np.linalg.eigvalsh(covariance[block, block])[-1], 0.0)))

    if shape.kind == "plane":
        return {"offset": float(sigma[0]), "direction": float(np.degrees(largest(slice(1, 3))))}
    if shape.kind == "sphere":
        return {"position": largest(slice(0, 3)), "radius": float(sigma[3])}
    shifts = 3 if shape.kind == "torus" else 2
    out = {"position": largest(slice(0, shifts)), "axis": float(np.degrees(largest(slice(shifts, shifts + 2))))}
    if shape.kind == "torus":
        return out | {"major": float(sigma[5]), "minor": float(sigma[6])}
    out["radius"] = float(sigma[4])
    if shape.kind == "cone":
        out["half_angle"] = float(np.degrees(sigma[5]))
    return out


def _frame(origin: Floats, z: Floats) -> Floats:
    x, y = perpendicular(z)
    return np.concatenate([origin, x, y, z]).astype(np.float64)
