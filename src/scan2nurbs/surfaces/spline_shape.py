"""A B-spline surface as a shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.spatial import KDTree

from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.project import FootPoints, foot_points
from scan2nurbs.surfaces.shape import Floats, Kind, unit

_STARTS_PER_SPAN = 4
_STARTS = 200_000
_SEARCHES = 24


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
        uv, tree, gaps = self._starts
        near, index = tree.query(points)
        index = np.asarray(index)
        feet = foot_points(self.surface, points, uv[index])
        # Newton's method may end in a corner of the domain that is no nearest point.
        ends = np.array(self.surface.domain)
        corner = ((feet.uv == ends[:, 0]) | (feet.uv == ends[:, 1])).all(axis=1)
        lost = np.flatnonzero((feet.distance > near) | corner)
        if len(lost) == 0:
            return feet
        best = self._search(points[lost], uv[index[lost]], gaps)
        d = self.surface.derivatives(best, 1)
        off = points[lost] - d[:, 0]
        normal = unit(np.cross(d[:, 1], d[:, 2]))
        feet.uv[lost], feet.distance[lost] = best, np.linalg.norm(off, axis=1)
        feet.height[lost] = np.einsum("ni,ni->n", off, normal)
        return feet

    def _search(self, points: Floats, start: Floats, gaps: Floats) -> Floats:
        """Return the parameters of the nearest of ever finer nets about a start."""
        low, high = (np.array(ends) for ends in zip(*self.surface.domain, strict=True))
        net = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 5)], indexing="ij"), axis=-1).reshape(-1, 2)
        best = start
        for k in range(_SEARCHES):
            tried = np.clip(best[:, None] + net * gaps * 0.5**k, low, high)
            off = self.surface.evaluate(tried.reshape(-1, 2)).reshape(len(points), -1, 3) - points[:, None]
            best = tried[np.arange(len(points)), np.argmin((off**2).sum(axis=2), axis=1)]
        return best

    def distance(self, points: Floats) -> Floats:
        """Return the distances (N,) of points (N, 3), positive on the side of S_u × S_v."""
        return _signed(self.project(points))

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals S_u × S_v (N, 3) at the feet of points."""
        return self.surface.normals(self.project(points).uv)

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the distances (N,) and the unit normals (N, 3)."""
        feet = self.project(points)
        return _signed(feet), self.surface.normals(feet.uv)

    def foot(self, points: Floats) -> Floats:
        """Return the nearest points (N, 3) of the surface."""
        return self.surface.evaluate(self.project(points).uv)

    @cached_property
    def _starts(self) -> tuple[Floats, KDTree, Floats]:
        axes = [np.unique(k) for k in self.surface.knots]
        per = _STARTS_PER_SPAN
        while per > 1 and np.prod([per * (len(a) - 1) + 1 for a in axes]) > _STARTS:
            per -= 1
        u, v = (np.interp(np.arange(per * (len(a) - 1) + 1) / per, np.arange(len(a)), a) for a in axes)
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        return uv, KDTree(self.surface.evaluate(uv)), np.array([np.diff(u).max(), np.diff(v).max()])


def _signed(feet: FootPoints) -> Floats:
    return np.where(feet.height < 0.0, -feet.distance, feet.distance)
