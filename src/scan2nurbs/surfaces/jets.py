"""Numbers and vectors that carry their derivatives: what the equations between shapes are written in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scan2nurbs.surfaces.shape import Floats
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, pose


@dataclass(frozen=True)
class Jet:
    """A value, () or (3,), and its derivatives by k parameters, (k,) or (3, k)."""

    value: Floats
    slope: Floats

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(self.value - other.value, self.slope - other.slope)

    def times(self, factor: Jet) -> Jet:
        """Return the product with a scalar."""
        if self.value.ndim == 0:
            return Jet(self.value * factor.value, self.slope * factor.value + self.value * factor.slope)
        return Jet(self.value * factor.value, self.slope * factor.value + np.outer(self.value, factor.slope))

    def scaled(self, factor: float) -> Jet:
        """Return the product with a constant."""
        return Jet(self.value * factor, self.slope * factor)

    def dot(self, other: Jet) -> Jet:
        """Return the scalar product."""
        return Jet(np.asarray(self.value @ other.value), self.value @ other.slope + other.value @ self.slope)

    def along(self, direction: Floats) -> Jet:
        """Return the component along a constant direction."""
        return Jet(np.asarray(direction @ self.value), direction @ self.slope)

    def cross(self, other: Jet) -> Jet:
        """Return the vector product."""
        a, b = skew(self.value), skew(other.value)
        return Jet(a @ other.value, a @ other.slope - b @ self.slope)

    def length(self) -> Jet:
        """Return the length; without a slope at zero."""
        value = float(np.linalg.norm(self.value))
        return Jet(np.asarray(value), self.value @ self.slope / max(value, 1e-300))

    def sine(self) -> Jet:
        """Return the sine of an angle."""
        return Jet(np.sin(self.value), np.cos(self.value) * self.slope)

    def cosine(self) -> Jet:
        """Return the cosine of an angle."""
        return Jet(np.cos(self.value), -np.sin(self.value) * self.slope)


@dataclass(frozen=True)
class JetShape:
    """A primitive's origin, axis and two numbers as jets over the parameters of a pair of primitives."""

    kind: str
    origin: Jet
    axis: Jet
    a: Jet
    b: Jet
    x: Floats
    y: Floats


def skew(v: Floats) -> Floats:
    """Return the matrix (3, 3) of v × ·."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@dataclass(frozen=True)
class Base:
    """A primitive's frame and numbers, and their derivatives by its own parameters: of origin (rows 0-2), axis (3-5), a and b (6, 7)."""

    kind: str
    frame: Floats
    numbers: tuple[float, float]
    slopes: Floats


def jet_base(shape: Primitive) -> Base:
    """Return what the jets of a primitive are made from, for many pairs."""
    _, frame, a, b = pose(shape)
    _, x, y, _ = frame.reshape(4, 3)
    full = np.zeros((8, 7))
    full[:3] = np.stack([*frame[3:].reshape(3, 3), *np.zeros((4, 3))], axis=1)
    full[3:6, 3], full[3:6, 4] = x, y
    full[6, 5] = full[7, 6] = 1.0
    return Base(shape.kind, frame.reshape(4, 3), (a, b), full[:, COLUMNS[shape.kind]])


def jet_pair(first: Base | Primitive, second: Base | Primitive) -> tuple[JetShape, JetShape]:
    """Return two primitives over their joint parameters, those of the first before those of the second."""
    s, t = (p if isinstance(p, Base) else jet_base(p) for p in (first, second))
    n, m = s.slopes.shape[1], t.slopes.shape[1]
    return _jet_shape(s, 0, n + m), _jet_shape(t, n, n + m)


def _jet_shape(base: Base, start: int, total: int) -> JetShape:
    slopes = np.zeros((8, total))
    slopes[:, start : start + base.slopes.shape[1]] = base.slopes
    origin, x, y, z = base.frame
    a, b = (np.asarray(v) for v in base.numbers)
    return JetShape(base.kind, Jet(origin, slopes[:3]), Jet(z, slopes[3:6]), Jet(a, slopes[6]), Jet(b, slopes[7]), x, y)
