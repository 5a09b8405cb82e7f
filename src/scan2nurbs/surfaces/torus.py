"""The torus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scan2nurbs.surfaces.shape import Analytic, Floats, Kind, split


@dataclass(frozen=True, eq=False)
class Torus(Analytic):
    """A torus, the tube about a circle.

    Attributes
    ----------
    center : (3,) float64
    axis : (3,) float64
        Unit direction of the axis.
    major : float
        Radius of the circle, > 0; less than `minor` for the outer sheet of a torus that meets itself.
    minor : float
        Radius of the tube, > 0.
    """

    kind: ClassVar[Kind] = "torus"

    center: Floats
    axis: Floats
    major: float
    minor: float

    @property
    def freedom(self) -> int:
        """Seven: centre, axis and two radii."""
        return 7

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) of points (N, 3), positive outside the tube."""
        height, radius, _ = split(points, self.center, self.axis)
        return np.hypot(radius - self.major, height) - self.minor

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3), away from the circle amid the tube."""
        height, radius, away = split(points, self.center, self.axis)
        across = radius - self.major
        length = np.maximum(np.hypot(across, height), 1e-300)[:, None]
        return (across[:, None] * away + height[:, None] * self.axis) / length
