"""A B-spline surface as a shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.spatial import KDTree

from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.project import FootPoints, foot_points
from scan2nurbs.surfaces.shape import Floats, Kind

_STARTS_PER_SPAN = 4
_STARTS = 200_000


@dataclass(frozen=True, eq=False)
class SplineShape:
    """A polynomial B-spline surface; it ends at its border.

    Attributes
    ----------
    surface : BSplineSurface
    """

    kind: ClassVar[Kind] = "bspline"

    surface: BSplineSurface

    @property
    def freedom(self) -> int:
        """One a control point: moving them along the surface changes little."""
        return self.surface.weights.size

    def project(self, points: Floats) -> FootPoints:
        """Return the foot points of points (N, 3), found by Newton's method from the nearest of a net of points."""
        uv, tree = self._starts
        return foot_points(self.surface, points, uv[tree.query(points)[1]])

    def distance(self, points: Floats) -> Floats:
        """Return the distances (N,) of points (N, 3), positive on the side of S_u × S_v."""
        feet = self.project(points)
        return np.where(feet.height < 0.0, -feet.distance, feet.distance)

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals S_u × S_v (N, 3) at the feet of points."""
        return self.surface.normals(self.project(points).uv)

    def foot(self, points: Floats) -> Floats:
        """Return the nearest points (N, 3) of the surface."""
        return self.surface.evaluate(self.project(points).uv)

    @cached_property
    def _starts(self) -> tuple[Floats, KDTree]:
        axes = [np.unique(k) for k in self.surface.knots]
        per = _STARTS_PER_SPAN
        while per > 1 and np.prod([per * (len(a) - 1) + 1 for a in axes]) > _STARTS:
            per -= 1
        u, v = (np.interp(np.arange(per * (len(a) - 1) + 1) / per, np.arange(len(a)), a) for a in axes)
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        return uv, KDTree(self.surface.evaluate(uv))
