"""The surface of revolution: a planar curve turned about an axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.profile import PlanarCurve
from scan2nurbs.surfaces.shape import Analytic, Floats, Kind, split


@dataclass(frozen=True, eq=False)
class Revolution(Analytic):
    """A surface of revolution.

    Attributes
    ----------
    point : (3,) float64
        A point of the axis, amid the data; height zero of the meridian.
    axis : (3,) float64
        Unit direction of the axis.
    meridian : PlanarCurve
        Over (distance from the axis, height along it); straight on beyond its ends.
    """

    kind: ClassVar[Kind] = "revolution"

    point: Floats
    axis: Floats
    meridian: PlanarCurve

    @property
    def freedom(self) -> int:
        """Four of the axis, and those of the meridian."""
        return 4 + self.meridian.freedom

    def flat(self, points: Floats) -> Floats:
        """Return the meridian's coordinates (N, 2), distance from the axis and height, of points (N, 3)."""
        height, radius, _ = split(points, self.point, self.axis)
        return np.stack([radius, height], axis=1)

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3)."""
        return self.meridian.distance(self.flat(points))[0]

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3)."""
        return self.distance_and_normal(points)[1]

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the signed distances (N,) and the unit normals (N, 3)."""
        height, radius, away = split(points, self.point, self.axis)
        distance, across = self.meridian.distance(np.stack([radius, height], axis=1))
        return distance, across[:, :1] * away + across[:, 1:] * self.axis
