"""The extruded surface: a planar curve moved along a direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.profile import PlanarCurve
from scan2nurbs.surfaces.shape import Analytic, Floats, Kind, perpendicular


@dataclass(frozen=True, eq=False)
class Extrusion(Analytic):
    """A general cylinder.

    Attributes
    ----------
    point : (3,) float64
        Where the profile's origin is, amid the data.
    direction : (3,) float64
        Unit direction of the rulings.
    profile : PlanarCurve
        In the plane across the direction, over x, y = `perpendicular(direction)`; straight on beyond its ends.
    """

    kind: ClassVar[Kind] = "extrusion"

    point: Floats
    direction: Floats
    profile: PlanarCurve

    @property
    def freedom(self) -> int:
        """Two of the direction, and those of the profile."""
        return 2 + self.profile.freedom

    def flat(self, points: Floats) -> Floats:
        """Return the profile's coordinates (N, 2) of points (N, 3)."""
        return (points - self.point) @ np.stack(perpendicular(self.direction), axis=1)

    def lift(self, flat: Floats, height: Floats) -> Floats:
        """Return the points (N, 3) at profile coordinates (N, 2) and heights (N,) along the direction."""
        return self.point + flat @ np.stack(perpendicular(self.direction)) + height[:, None] * self.direction

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3)."""
        return self.profile.distance(self.flat(points))[0]

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3)."""
        return self.distance_and_normal(points)[1]

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the signed distances (N,) and the unit normals (N, 3)."""
        distance, normal = self.profile.distance(self.flat(points))
        return distance, normal @ np.stack(perpendicular(self.direction))
