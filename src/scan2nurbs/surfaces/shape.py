"""What every surface of a face can do, whatever its shape."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Kind = Literal["plane", "cylinder", "cone", "sphere", "torus", "extrusion", "revolution", "bspline"]
KINDS: tuple[Kind, ...] = ("plane", "cylinder", "cone", "sphere", "torus", "extrusion", "revolution", "bspline")


@runtime_checkable
class Shape(Protocol):
    """An unbounded surface: a signed distance field and the number of parameters that it takes to say where it lies.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    freedom : int
        Independent parameters of the surface.

    Notes
    -----
    The distance is that to the nearest point of the surface, so the foot of a point p is p − d(p)·n(p), with n the gradient of d.
    """

    kind: ClassVar[Kind]

    @property
    def freedom(self) -> int:
        """Independent parameters."""
        ...

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3), in the points' unit."""
        ...

    def normal(self, points: Floats) -> Floats:
        """Return the unit gradients (N, 3) of the distance at points (N, 3): the surface's normals at their feet."""
        ...

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return distances and normals; of surfaces on which feet are searched for in little more time than one of them takes."""
        ...

    def foot(self, points: Floats) -> Floats:
        """Return the nearest points (N, 3) of the surface."""
        ...


class Analytic:
    """Base of the shapes whose distance has a formula."""

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3)."""
        raise NotImplementedError

    def normal(self, points: Floats) -> Floats:
        """Return the unit gradients (N, 3) of the distance."""
        raise NotImplementedError

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the signed distances (N,) and the unit gradients (N, 3)."""
        return self.distance(points), self.normal(points)

    def foot(self, points: Floats) -> Floats:
        """Return the nearest points (N, 3) of the surface."""
        distance, normal = self.distance_and_normal(points)
        return points - distance[:, None] * normal


def inverse(matrix: Floats) -> Floats:
    """Return the inverse of a matrix."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def unit(vector: ArrayLike) -> Floats:
    """Return a vector, or each row of an array, divided by its length; zero vectors stay zero."""
    v = np.asarray(vector, np.float64)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, length, out=np.zeros_like(v), where=length > 0)


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of the rows of two arrays (N, 3); NumPy's own takes several times as long for few rows."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    return np.column_stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def perpendicular(axis: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors that make a right-handed frame with a unit vector: x × y = axis."""
    # By hand: NumPy's cross product of two single vectors takes longer than a fit's step.
    a, b, c = (float(v) for v in axis)
    size = (abs(a), abs(b), abs(c))
    least = size.index(min(size))
    x = ((0.0, -c, b), (c, 0.0, -a), (-b, a, 0.0))[least]
    length = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    p, q, r = x[0] / length, x[1] / length, x[2] / length
    return np.array([p, q, r]), np.array([b * r - c * q, c * p - a * r, a * q - b * p])


def split(points: Floats, origin: Floats, axis: Floats) -> tuple[Floats, Floats, Floats]:
    """Return heights (N,) along an axis, distances (N,) from it and unit directions (N, 3) away from it; any direction on the axis."""
    offset = points - origin
    height = offset @ axis
    radial = offset - height[:, None] * axis
    distance = np.linalg.norm(radial, axis=1)
    x, _ = perpendicular(axis)
    away = np.where(distance[:, None] > 0, radial / np.maximum(distance, 1e-300)[:, None], x)
    return height, distance, away
