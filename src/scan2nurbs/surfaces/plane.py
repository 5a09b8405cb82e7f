"""The plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.shape import Analytic, Floats, Kind


@dataclass(frozen=True, eq=False)
class Plane(Analytic):
    """A plane.

    Attributes
    ----------
    point : (3,) float64
        A point of the plane.
    direction : (3,) float64
        Its unit normal; the distance is positive on the side that it points to.
    """

    kind: ClassVar[Kind] = "plane"

    point: Floats
    direction: Floats

    @property
    def freedom(self) -> int:
        """Three: two angles and an offset."""
        return 3

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3)."""
        return (points - self.point) @ self.direction

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3)."""
        return np.broadcast_to(self.direction, points.shape).copy()
