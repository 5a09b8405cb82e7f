"""The circular cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scan2nurbs.surfaces.shape import Analytic, Floats, Kind, split


@dataclass(frozen=True, eq=False)
class Cylinder(Analytic):
    """A circular cylinder.

    Attributes
    ----------
    point : (3,) float64
        A point of the axis, amid the data.
    axis : (3,) float64
        Unit direction of the axis.
    radius : float
    """

    kind: ClassVar[Kind] = "cylinder"

    point: Floats
    axis: Floats
    radius: float

    @property
    def freedom(self) -> int:
        """Five: four of the axis, and the radius."""
        return 5

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3), positive outside."""
        return split(points, self.point, self.axis)[1] - self.radius

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3), away from the axis."""
        return split(points, self.point, self.axis)[2]
