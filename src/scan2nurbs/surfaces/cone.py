"""The circular cone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.shape import Analytic, Floats, Kind, split


@dataclass(frozen=True, eq=False)
class Cone(Analytic):
    """One nappe of a circular cone.

    Attributes
    ----------
    point : (3,) float64
        A point of the axis, amid the data: the centre of the circle of radius `radius`.
    axis : (3,) float64
        Unit direction of the axis; the cone widens along it.
    radius : float
        Radius at `point`, > 0.
    half_angle : float
        Angle between axis and surface, in radians, in (0, π/2).
    """

    kind: ClassVar[Kind] = "cone"

    point: Floats
    axis: Floats
    radius: float
    half_angle: float

    @property
    def freedom(self) -> int:
        """Six: four of the axis, the angle, and the apex along the axis."""
        return 6

    @property
    def apex(self) -> Floats:
        """The apex (3,)."""
        return self.point - self.axis * (self.radius / np.tan(self.half_angle))

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3), positive outside."""
        height, radius, _ = split(points, self.apex, self.axis)
        sine, cosine = np.sin(self.half_angle), np.cos(self.half_angle)
        along = height * cosine + radius * sine
        return np.where(along > 0, radius * cosine - height * sine, np.hypot(height, radius))

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3), away from the axis."""
        height, radius, away = split(points, self.apex, self.axis)
        sine, cosine = np.sin(self.half_angle), np.cos(self.half_angle)
        along = height * cosine + radius * sine
        side = away * cosine - self.axis * sine
        far = (points - self.apex) / np.maximum(np.hypot(height, radius), 1e-300)[:, None]
        return np.where((along > 0)[:, None], side, far)
