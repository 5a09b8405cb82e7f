"""B-spline surfaces of faces, extended to where their borders lie, as shapes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from scipy.spatial import KDTree

from scan2nurbs.brep.swept import extruded, revolved
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.extend import extend
from scan2nurbs.surfaces.project import foot_points
from scan2nurbs.surfaces.shape import Floats, Kind, cross, unit

_SEEDS = 24
_BEYOND = 0.2
_MARGIN = 2.0
_FARTHEST = 10.0
"""How far from its points, in h, a border of a face is looked for."""


@dataclass(frozen=True, eq=False)
class WideSpline:
    """A B-spline surface with the parameters of its feet.

    Attributes
    ----------
    surface : BSplineSurface
        Polynomial.
    """

    kind: ClassVar[Kind] = "bspline"

    surface: BSplineSurface
    _tree: KDTree = field(init=False, repr=False)
    _seeds: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Lay out the seeds from which feet are found."""
        (u0, u1), (v0, v1) = self.surface.domain
        count = [max(_SEEDS, 3 * n) for n in self.surface.spans]
        u, v = np.meshgrid(np.linspace(u0, u1, count[0]), np.linspace(v0, v1, count[1]), indexing="ij")
        seeds = np.column_stack([u.ravel(), v.ravel()])
        object.__setattr__(self, "_seeds", seeds)
        object.__setattr__(self, "_tree", KDTree(self.surface.evaluate(seeds)))

    @property
    def freedom(self) -> int:
        """Coordinates of the control points."""
        return int(self.surface.control_points.size)

    def parameters(self, points: Floats) -> Floats:
        """Return the parameters (N, 2) of the feet of points (N, 3)."""
        return foot_points(self.surface, points, self._seeds[self._tree.query(points)[1]], steps=30).uv

    def distance(self, points: Floats) -> Floats:
        """Return the signed distances (N,) along the normals."""
        return self.distance_and_normal(points)[0]

    def normal(self, points: Floats) -> Floats:
        """Return the unit normals (N, 3) at the feet."""
        return self.distance_and_normal(points)[1]

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the signed distances (N,) along the normals, and the unit normals (N, 3) at the feet."""
        feet, along_u, along_v = np.moveaxis(self.surface.derivatives(self.parameters(points)), 1, 0)
        normal = unit(cross(along_u, along_v))
        normal[~normal.any(axis=1)] = [0.0, 0.0, 1.0]
        return np.einsum("nk,nk->n", points - feet, normal), normal

    def foot(self, points: Floats) -> Floats:
        """Return the nearest points (N, 3) of the surface."""
        return self.surface.evaluate(self.parameters(points))


def widened(shape: Any, points: Floats, h: float) -> Any:
    """Return the surface of a face, a B-spline extended so far that border points have their feet within it.

    Parameters
    ----------
    shape : Shape
        Swept surfaces become B-splines; others than polynomial B-spline surfaces are returned as they are.
    points : (N, 3) float64
        Of the face's borders.
    h : float
        Spacing of the cloud; the surface reaches two of it beyond the points.
    """
    if shape.kind in ("extrusion", "revolution") and len(points):
        return WideSpline((extruded if shape.kind == "extrusion" else revolved)(shape, points, h))
    surface = getattr(shape, "surface", None)
    if shape.kind in ("plane", "cylinder", "cone", "sphere", "torus") or not isinstance(surface, BSplineSurface):
        return shape
    if not len(points) or np.ptp(surface.weights) > 0:
        return WideSpline(surface)
    low, high = np.array(surface.domain).T
    # No farther than borders may lie: a tube that is extended by much of its length comes back to itself.
    middle = surface.derivatives(np.stack(np.meshgrid(*np.linspace(low, high, 9).T, indexing="ij"), axis=-1).reshape(-1, 2))
    beyond = np.minimum(
        _BEYOND * (high - low), _FARTHEST * h / np.maximum(np.median(np.linalg.norm(middle[:, 1:], axis=2), axis=0), 1e-300)
    )
    wide = WideSpline(extend(surface, low - beyond, high + beyond))
    uv = wide.parameters(points)
    slopes = np.linalg.norm(surface.derivatives(np.clip(uv, low, high))[:, 1:], axis=2)
    margin = _MARGIN * h / np.maximum(np.median(slopes, axis=0), 1e-300)
    return WideSpline(extend(surface, np.minimum(low, uv.min(axis=0) - margin), np.maximum(high, uv.max(axis=0) + margin)))
