"""Surfaces of faces as the CAD kernel knows them: their parameters, periods and poles, and its objects."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.occ import kernel_errors, to_surface
from scan2nurbs.brep.seam import roll
from scan2nurbs.brep.sheets import Guide, guide_along
from scan2nurbs.brep.wide import WideSpline
from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.shape import Shape, perpendicular, unit

Floats = NDArray[np.float64]

TURN = 2.0 * np.pi


class Chart(Protocol):
    """A surface with parameters (u, v), those of the kernel's object.

    Attributes
    ----------
    period : (float or None, float or None)
        In u and v, where the surface closes on itself.
    poles : (float or None, float or None)
        The lowest and the highest v, where the surface has shrunk to a point there.
    start : (float, float)
        Where the periods begin.
    """

    @property
    def period(self) -> tuple[float | None, float | None]: ...  # noqa: D102
    @property
    def poles(self) -> tuple[float | None, float | None]: ...  # noqa: D102
    @property
    def start(self) -> tuple[float, float]: ...  # noqa: D102

    def uv(self, points: Floats) -> Floats:
        """Return the parameters (N, 2) of the feet of points (N, 3); periodic ones in one period from `start`."""
        ...

    def point(self, uv: Floats) -> Floats:
        """Return the points (N, 3) at parameters (N, 2)."""
        ...

    def turned(self, at: float, axis: int) -> tuple[Chart, float]:
        """Return the same surface with its seam where u (0) or v (1) has a value now, if it can be moved, and the value there."""
        ...

    def geometry(self) -> Any:
        """Return the kernel's ``Geom_Surface``, in its own lengths."""
        ...


@dataclass(frozen=True)
class AxisChart:
    """Plane, cylinder, cone, sphere or torus about an axis system.

    Attributes
    ----------
    kind : str
    origin, x, z : (3,) float64
        Of the axis system; y = z × x.
    sizes : tuple of float
        Radius; radius and half angle; or both radii.
    scale : float
        Kernel lengths over the model's.
    """

    kind: str
    origin: Floats
    x: Floats
    z: Floats
    sizes: tuple[float, ...]
    scale: float

    @property
    def y(self) -> Floats:
        """Second axis."""
        return np.cross(self.z, self.x)

    @property
    def start(self) -> tuple[float, float]:
        """Where the periods begin."""
        return 0.0, 0.0

    @property
    def period(self) -> tuple[float | None, float | None]:
        """Full turns."""
        return (None if self.kind == "plane" else TURN), (TURN if self.kind == "torus" else None)

    @property
    def poles(self) -> tuple[float | None, float | None]:
        """Both ends of a sphere, the apex of a cone."""
        if self.kind == "sphere":
            return -0.5 * np.pi, 0.5 * np.pi
        if self.kind == "cone":
            return -self.sizes[0] * self.scale / np.sin(self.sizes[1]), None
        return None, None

    def uv(self, points: Floats) -> Floats:
        """Return the parameters (N, 2) of the feet of points."""
        local = (points - self.origin) @ np.column_stack([self.x, self.y, self.z])
        if self.kind == "plane":
            return local[:, :2] * self.scale
        u = np.arctan2(local[:, 1], local[:, 0]) % TURN
        radius, height = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
        if self.kind == "cylinder":
            v = height * self.scale
        elif self.kind == "cone":
            v = (height * np.cos(self.sizes[1]) + (radius - self.sizes[0]) * np.sin(self.sizes[1])) * self.scale
        elif self.kind == "sphere":
            v = np.arctan2(height, radius)
        else:
            v = np.arctan2(height, radius - self.sizes[0]) % TURN
        return np.column_stack([u, v])

    def point(self, uv: Floats) -> Floats:
        """Return the points (N, 3) at parameters (N, 2)."""
        u, v = uv.T
        if self.kind == "plane":
            return self.origin + (u[:, None] * self.x + v[:, None] * self.y) / self.scale
        if self.kind == "cylinder":
            radius, height = np.full(len(v), self.sizes[0]), v / self.scale
        elif self.kind == "cone":
            radius, height = self.sizes[0] + v / self.scale * np.sin(self.sizes[1]), v / self.scale * np.cos(self.sizes[1])
        elif self.kind == "sphere":
            radius, height = self.sizes[0] * np.cos(v), self.sizes[0] * np.sin(v)
        else:
            radius, height = self.sizes[0] + self.sizes[1] * np.cos(v), self.sizes[1] * np.sin(v)
        away = np.cos(u)[:, None] * self.x + np.sin(u)[:, None] * self.y
        return self.origin + radius[:, None] * away + height[:, None] * self.z

    def turned(self, at: float, axis: int) -> tuple[AxisChart, float]:
        """Return the same surface with its seam in u where it has a value now; that of a torus in v stays."""
        if axis == 1:
            return self, at
        return replace(self, x=unit(np.cos(at) * self.x + np.sin(at) * self.y)), 0.0

    def geometry(self) -> Any:
        """Return the kernel's surface."""
        from OCP.Geom import Geom_ConicalSurface, Geom_CylindricalSurface, Geom_Plane, Geom_SphericalSurface, Geom_ToroidalSurface
        from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

        frame = gp_Ax3(gp_Pnt(*(self.origin * self.scale).tolist()), gp_Dir(*self.z.tolist()), gp_Dir(*self.x.tolist()))
        first = self.sizes[0] * self.scale if self.sizes else 0.0
        with kernel_errors(f"make a {self.kind}"):
            match self.kind:
                case "plane":
                    return Geom_Plane(frame)
                case "cylinder":
                    return Geom_CylindricalSurface(frame, first)
                case "cone":
                    return Geom_ConicalSurface(frame, self.sizes[1], first)
                case "sphere":
                    return Geom_SphericalSurface(frame, first)
                case _:
                    return Geom_ToroidalSurface(frame, first, self.sizes[1] * self.scale)


@dataclass(frozen=True)
class SplineChart:
    """A B-spline surface; its parameters are its own.

    Attributes
    ----------
    surface : BSplineSurface
        Reaches as far as the face does.
    scale : float
        Kernel lengths over the model's.
    guide : Guide, optional
        The sheet of the surface on which feet are found.
    """

    surface: BSplineSurface
    scale: float
    guide: Guide | None = None
    _wide: WideSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Prepare the feet."""
        object.__setattr__(self, "_wide", WideSpline(self.surface))

    @property
    def start(self) -> tuple[float, float]:
        """First parameters of the domain."""
        return self.surface.domain[0][0], self.surface.domain[1][0]

    @property
    def period(self) -> tuple[float | None, float | None]:
        """Lengths of the domain where the surface is closed."""
        (u0, u1), (v0, v1) = self.surface.domain
        return (u1 - u0 if self.surface.closed[0] else None), (v1 - v0 if self.surface.closed[1] else None)

    @property
    def poles(self) -> tuple[float | None, float | None]:
        """Where all control points of the first or the last row in v are one."""
        control = self.surface.control_points
        size = 1e-9 * float(np.ptp(control.reshape(-1, 3), axis=0).max())
        low, high = (bool(np.ptp(control[:, end], axis=0).max() <= size) for end in (0, -1))
        v = self.surface.domain[1]
        return (v[0] if low else None), (v[1] if high else None)

    def uv(self, points: Floats) -> Floats:
        """Return the parameters (N, 2) of the feet of points."""
        uv = self._wide.parameters(points)
        return uv if self.guide is None else self.guide.led(self.surface, points, uv)

    def guided(self, loops: Sequence[Floats], h: float) -> SplineChart:
        """Return the same surface with feet on one sheet of it, given points along each of the loops of a face."""
        if any(self.surface.closed) or not len(loops):
            return self
        return replace(self, guide=guide_along(self.surface, loops, [self._wide.parameters(loop) for loop in loops], h))

    def point(self, uv: Floats) -> Floats:
        """Return the points (N, 3) at parameters (N, 2), those beyond the domain drawn to its border."""
        inside = uv.copy()
        for axis, (period, (low, high)) in enumerate(zip(self.period, self.surface.domain, strict=True)):
            if period:
                beyond = (inside[:, axis] < low) | (inside[:, axis] > high)
                inside[beyond, axis] = low + (inside[beyond, axis] - low) % period
            inside[:, axis] = np.clip(inside[:, axis], low, high)
        return self.surface.evaluate(inside)

    def turned(self, at: float, axis: int) -> tuple[SplineChart, float]:
        """Return the same surface with its seam elsewhere."""
        low = self.surface.domain[axis][0]
        if not self.surface.closed[axis] or at == low:
            return self, low
        rolled = replace(self, surface=roll(self.surface, axis, at))
        return rolled, rolled.surface.domain[axis][0]

    def geometry(self) -> Any:
        """Return the kernel's surface."""
        return to_surface(self.surface, scale=self.scale)


def chart_of(shape: Shape, scale: float, *, towards: Floats | None = None) -> Chart:
    """Return a surface with the kernel's parameters.

    Parameters
    ----------
    shape : Shape
        Of a face.
    scale : float
        Kernel lengths over the model's.
    towards : (3,) float64, optional
        For a sphere, the direction of its axis; any other by default.
    """
    s: Any = shape
    if s.kind == "plane":
        return AxisChart("plane", s.point, perpendicular(s.direction)[0], s.direction, (), scale)
    if s.kind == "cylinder":
        return AxisChart("cylinder", s.point, perpendicular(s.axis)[0], s.axis, (s.radius,), scale)
    if s.kind == "cone":
        return AxisChart("cone", s.point, perpendicular(s.axis)[0], s.axis, (s.radius, s.half_angle), scale)
    if s.kind == "sphere":
        axis = np.array([0.0, 0.0, 1.0]) if towards is None else towards
        return AxisChart("sphere", s.center, perpendicular(axis)[0], axis, (s.radius,), scale)
    if s.kind == "torus":
        return AxisChart("torus", s.center, perpendicular(s.axis)[0], s.axis, (s.major, s.minor), scale)
    if not isinstance(getattr(s, "surface", None), BSplineSurface):
        raise NoResultError(f"A {s.kind} without a border cannot be made.")
    return SplineChart(s.surface, scale)
