"""The sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.shape import Analytic, Floats, Kind


@dataclass(frozen=True, eq=False)
class Sphere(Analytic):
    """A sphere.

    Attributes
    ----------
    center : (3,) float64
    radius : float
    """

    kind: ClassVar[Kind] = "sphere"

    center: Floats
    radius: float

    @property
    def freedom(self) -> int:
        """Four: the centre and the radius."""
        return 4

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3), positive outside."""
        return np.linalg.norm(points - self.center, axis=1) - self.radius

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3), away from the centre; any direction in the centre itself."""
        offset = points - self.center
        length = np.linalg.norm(offset, axis=1, keepdims=True)
        return np.where(length > 0, offset / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
