"""Fit extruded and revolved surfaces: a direction or axis from the normals, the profile, and both in turns."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.extrusion import Extrusion
from scan2nurbs.surfaces.profile import PlanarCurve, fit_profile
from scan2nurbs.surfaces.revolution import Revolution
from scan2nurbs.surfaces.shape import Floats, perpendicular, split, unit
from scan2nurbs.surfaces.shape_start import line_complex_axes, own_normals

_SAMPLE = 4000
_ROUNDS = 4
_CUT = 4.0


def fit_extrusion(points: Floats, noise: float, normals: Floats | None = None) -> Extrusion:
    """Fit an extruded surface to points (N, 3).

    Raises
    ------
    NoResultError
        If the points are flat, or their profile is no single curve.
    """
    few, n = _sample(points, normals)
    values, vectors = np.linalg.eigh(n.T @ n / max(len(n), 1))
    if values[1] < 4.0 * values[0] or values[1] < 1e-4:
        raise NoResultError("The normals have no one direction across them; the points are no extruded surface.")
    direction, point = vectors[:, 0], few.mean(axis=0)
    for _ in range(_ROUNDS):
        shape = Extrusion(point, direction, fit_profile(_flat(few, point, direction), noise))
        x, y = perpendicular(direction)
        step = _step(shape, shape.profile, shape.flat(few), few, (x, y, direction), noise, shifts=False)
        direction = unit(direction + step[0] * x + step[1] * y)
        if np.abs(step).max() < 1e-6:
            break
    return Extrusion(point, direction, fit_profile(_flat(few, point, direction), noise))


def fit_revolution(points: Floats, noise: float, normals: Floats | None = None) -> Revolution:
    """Fit a surface of revolution to points (N, 3).

    Raises
    ------
    NoResultError
        If the normals meet no axis, or the meridian is no single curve.
    """
    few, n = _sample(points, normals)
    middle, extent = few.mean(axis=0), float(np.ptp(few, axis=0).max())
    origin, axis = line_complex_axes((few - middle) / extent, n)[0]
    axis = unit(axis)
    point = middle + extent * (origin - axis * float(origin @ axis))
    for _ in range(_ROUNDS):
        if np.abs(point - middle).max() > 100.0 * extent:
            raise NoResultError("The axis of the normals is far away; the points are no surface of revolution.")
        shape = Revolution(point, axis, fit_profile(_meridian(few, point, axis), noise))
        x, y = perpendicular(axis)
        step = _step(shape, shape.meridian, shape.flat(few), few, (x, y, axis), noise, shifts=True)
        point = point + step[0] * x + step[1] * y
        axis = unit(axis + step[2] * x + step[3] * y)
        if np.abs(step[2:]).max() < 1e-6:
            break
    return Revolution(point, axis, fit_profile(_meridian(few, point, axis), noise))


def _sample(points: Floats, normals: Floats | None) -> tuple[Floats, Floats]:
    if len(points) < 30:
        raise NoResultError(f"{len(points)} points are too few for a profile.")
    index = np.arange(0, len(points), -(-len(points) // _SAMPLE))
    n = own_normals(points, index) if normals is None else normals[index]
    good = np.isfinite(n).all(axis=1)
    return points[index][good], n[good]


def _flat(points: Floats, point: Floats, direction: Floats) -> Floats:
    return (points - point) @ np.stack(perpendicular(direction), axis=1)


def _meridian(points: Floats, point: Floats, axis: Floats) -> Floats:
    height, radius, _ = split(points, point, axis)
    return np.stack([radius, height], axis=1)


def _step(
    shape: Extrusion | Revolution,
    curve: PlanarCurve,
    flat: Floats,
    points: Floats,
    frame: tuple[Floats, Floats, Floats],
    noise: float,
    *,
    shifts: bool,
) -> Floats:
    """Return the Gauss-Newton step of the axis (shifts along x and y where asked, tilts towards x and y), the profile free to follow."""
    x, y, z = frame
    d, normal = shape.distance_and_normal(points)
    offset = points - shape.point
    u, v, w = offset @ x, offset @ y, offset @ z
    nx, ny, nz = normal @ x, normal @ y, normal @ z
    columns = [u * nz - w * nx, v * nz - w * ny]
    if shifts:
        columns = [-nx, -ny, *columns]
    t = curve.project(flat)
    low, high = curve.domain
    profile = BSpline.design_matrix(np.clip(t, low, np.nextafter(high, low)), curve.knots, 3).toarray()
    on = np.abs(d) <= _CUT * max(noise, 1.4826 * float(np.median(np.abs(d))))
    system = np.column_stack([*columns, profile])[on]
    return np.asarray(np.linalg.lstsq(system, -d[on], rcond=1e-9)[0][: len(columns)], dtype=np.float64)
