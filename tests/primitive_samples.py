"""Patches of primitives with noise, for tests of fits: a primitive of each kind, and points on it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape_parameters import Primitive, from_pose, pose
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

ZERO, Z = np.zeros(3), np.array([0.0, 0.0, 1.0])
PRIMITIVES: dict[str, Primitive] = {
    "plane": Plane(ZERO, Z),
    "cylinder": Cylinder(ZERO, Z, 5.0),
    "cone": Cone(ZERO, Z, 10.0, 0.4),
    "sphere": Sphere(ZERO, 6.0),
    "torus": Torus(ZERO, Z, 20.0, 5.0),
}


def patch(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Points (n, 3) on a part of the primitive of a kind, without noise."""
    u, v = rng.random((2, n))
    if kind == "plane":
        return np.c_[40 * u, 20 * v, 0 * u]
    if kind == "cylinder":
        return np.c_[5 * np.cos(1.6 * u), 5 * np.sin(1.6 * u), 60 * v - 30]
    if kind == "cone":
        r = 10 + 30 * v * np.tan(0.4)
        return np.c_[r * np.cos(2 * u), r * np.sin(2 * u), 30 * v]
    if kind == "sphere":
        a, b = 1.6 * u, 1.6 * v
        return 6 * np.c_[np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)]
    a, b = 2.4 * u, 1.6 * v
    return np.c_[(20 + 5 * np.cos(b)) * np.cos(a), (20 + 5 * np.cos(b)) * np.sin(a), 5 * np.sin(b)]


def placed(shape: Primitive, turn: Rotation, shift: np.ndarray, size: float) -> Primitive:
    """The primitive after a similarity."""
    _, frame, a, b = pose(shape)
    frame = np.concatenate([size * turn.apply(frame[:3]) + shift, turn.apply(frame[3:].reshape(3, 3)).ravel()])
    return from_pose(shape.kind, frame, size * a, b if shape.kind == "cone" else size * b)
