"""Starting values of plane, cylinder, cone, sphere and torus: from normals as unsigned lines, and from the curvature of the whole patch.

Points must be of the order of one (centred and scaled by their extent); so are the results.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.spatial import KDTree

from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane
from scan2nurbs.surfaces.shape import Floats, Kind, perpendicular, split, unit
from scan2nurbs.surfaces.shape_parameters import Primitive
from scan2nurbs.surfaces.sphere import Sphere
from scan2nurbs.surfaces.torus import Torus

_NEIGHBOURS = 24
_FARTHEST = 1e6


def starting_values(kind: Kind, points: Floats, sample: NDArray[np.int64], normals: Floats | None) -> Iterator[list[Primitive]]:
    """Yield groups of primitives to start a fit from, those of the cheapest ideas first.

    Parameters
    ----------
    kind : str
    points : (N, 3) float64
    sample : (M,) int64
        Numbers of the points to look at.
    normals : (N, 3) float64, optional
        Unit normals of either sign; estimated from the points where missing.
    """
    few = points[sample]
    if kind == "plane":
        yield [_plane(few)]
        return
    yield _sane([*of_curvature(kind, *principal(few)), _sphere_algebraic(few) if kind == "sphere" else None])
    n = own_normals(points, sample) if normals is None else normals[sample]
    good = np.isfinite(n).all(axis=1)
    on, n = few[good], n[good]
    if len(on) > 5:
        about = [_about_axis(kind, few, on, n, *axis) for axis in _axes(kind, on, n)]
        yield _sane([*about, _sphere_of_lines(on, n) if kind == "sphere" else None])


def own_normals(points: Floats, at: NDArray[np.int64] | None = None, neighbours: int = _NEIGHBOURS) -> Floats:
    """Return the normals (M, 3) of least-squares planes through the nearest neighbours of points (of those numbered `at`)."""
    k = min(neighbours, max(len(points) // 3, 4), len(points))
    _, index = KDTree(points).query(points if at is None else points[at], k=k)
    near = points[index]
    near = near - near.mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))[1][:, :, 0]


def _sane(shapes: Sequence[Primitive | None]) -> list[Primitive]:
    kept = []
    for shape in shapes:
        if shape is not None:
            numbers = np.concatenate([np.ravel(v) for v in vars(shape).values()])
            if np.isfinite(numbers).all() and np.abs(numbers).max() < _FARTHEST:
                kept.append(shape)
    return kept


def _plane(points: Floats) -> Plane:
    middle = points.mean(axis=0)
    offset = points - middle
    return Plane(middle, np.linalg.eigh(offset.T @ offset)[1][:, 0])


def _sphere_algebraic(points: Floats) -> Sphere | None:
    """Solve |p|² = 2 c·p + (r² − c²), linear in c and the bracket."""
    system = np.c_[2.0 * points, np.ones(len(points))]
    solution = np.linalg.lstsq(system, np.einsum("ni,ni->n", points, points), rcond=None)[0]
    square = solution[3] + solution[:3] @ solution[:3]
    return Sphere(solution[:3], float(np.sqrt(square))) if square > 0.0 else None


def _sphere_of_lines(points: Floats, normals: Floats) -> Sphere | None:
    """Find the point nearest to all normal lines."""
    across = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    matrix = across.sum(axis=0)
    if np.linalg.cond(matrix) > 1e12:
        return None
    center = np.linalg.solve(matrix, np.einsum("nij,nj->i", across, points))
    return Sphere(center, float(np.median(np.linalg.norm(points - center, axis=1))))


def _axes(kind: Kind, points: Floats, normals: Floats) -> list[tuple[Floats, Floats]]:
    """Return axes, as point and direction, that the normals ask for."""
    if kind == "sphere":
        return []
    axes = []
    if kind in ("cylinder", "cone"):
        # A cylinder's normals are perpendicular to its axis.
        axes += [(None, np.linalg.eigh(normals.T @ normals)[1][:, 0])]
    if kind == "cone":
        # All tangent planes meet in the apex, whatever the signs of the normals.
        apex = np.linalg.lstsq(normals, np.einsum("ni,ni->n", normals, points), rcond=1e-6)[0]
        ray = unit(points - apex)
        # Rays from the apex make one angle with the axis: their tips lie in a plane across it.
        axes += [(apex, np.linalg.eigh(np.cov(ray.T))[1][:, 0])]
    axes = [(_axis_point(points, normals, a) if p is None else p, a) for p, a in axes]
    if kind in ("torus", "cone"):
        axes += line_complex_axes(points, normals)
    return axes


def _axis_point(points: Floats, normals: Floats, axis: Floats) -> Floats:
    """Return the point nearest to all normal lines when looking along the axis."""
    x, y = perpendicular(axis)
    flat, n = np.c_[points @ x, points @ y], unit(np.c_[normals @ x, normals @ y])
    across = np.eye(2) - n[:, :, None] * n[:, None, :]
    matrix = across.sum(axis=0) + 1e-12 * len(points) * np.eye(2)
    c = np.linalg.solve(matrix, np.einsum("nij,nj->i", across, flat))
    return c[0] * x + c[1] * y


def line_complex_axes(points: Floats, normals: Floats) -> list[tuple[Floats, Floats]]:
    """Return axes that all normal lines (nearly) meet, of the best linear complexes of the normals.

    References
    ----------
    H. Pottmann, J. Wallner, Computational Line Geometry, section 4.3: minimise Σ (c̄·n + c·(p × n))² under |c| = 1. The rotations that
    leave a surface as it is are such complexes with c·c̄ = 0.
    """
    moment = np.cross(points, normals)
    a = moment.T @ moment
    b = moment.T @ normals
    d = normals.T @ normals
    # c̄ = −D⁻¹ Bᵀ c leaves a 3 x 3 problem in c.
    back = np.linalg.solve(d + 1e-9 * np.trace(d) * np.eye(3), b.T)
    values, vectors = np.linalg.eigh(a - b @ back)
    axes = []
    for k in range(2 if values[1] < 4.0 * values[0] + 1e-12 else 1):
        c = vectors[:, k]
        bar = -back @ c
        axes.append((np.cross(c, bar - c * float(c @ bar)), c))
    return axes


def _about_axis(kind: Kind, points: Floats, on: Floats, normals: Floats, origin: Floats, axis: Floats) -> Primitive | None:
    """Return the primitive with a given axis."""
    axis = unit(axis)
    origin = origin + axis * float((points.mean(axis=0) - origin) @ axis)
    height, radius, away = split(on, origin, axis)
    if kind == "cylinder":
        return Cylinder(origin, axis, float(np.median(radius)))
    if kind == "cone":
        if not np.ptp(height) > 0.0:  # NaN where the points lie in a line
            return None
        slope, at_origin = np.polyfit(height, radius, 1)
        if slope < 0.0:
            axis, slope = -axis, -slope
        at_origin = max(float(at_origin), 1e-3 * float(radius.max()))
        return Cone(origin, axis, at_origin, float(np.clip(np.arctan(slope), 1e-3, 1.565)))
    # The profile's circle, algebraically.
    system = np.c_[2.0 * radius, 2.0 * height, np.ones(len(on))]
    solution = np.linalg.lstsq(system, radius**2 + height**2, rcond=None)[0]
    square = solution[2] + solution[0] ** 2 + solution[1] ** 2
    if not square > 0.0 or solution[0] <= 0.0:
        # Nearest to the profile's normals instead.
        n = unit(np.c_[np.einsum("ni,ni->n", normals, away), normals @ axis])
        across = np.eye(2) - n[:, :, None] * n[:, None, :]
        solution = np.linalg.lstsq(across.sum(axis=0), np.einsum("nij,nj->i", across, np.c_[radius, height]), rcond=1e-9)[0]
        square = float(np.median((radius - solution[0]) ** 2 + (height - solution[1]) ** 2))
        if solution[0] <= 0.0:
            return None
    return Torus(origin + solution[1] * axis, axis, float(solution[0]), float(np.sqrt(square)))


def principal(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the vertex (3,) of the patch as a quadric over its plane, its frame (3, 3) and its curvatures (2,), the larger last.

    Rows of the frame are the directions of the curvatures and the normal, towards which positive curvatures bend.
    """
    plane = _plane(points)
    x, y = perpendicular(plane.direction)
    offset = points - plane.point
    u, v, w = offset @ x, offset @ y, offset @ plane.direction
    system = np.c_[0.5 * u * u, u * v, 0.5 * v * v, u, v, np.ones_like(u)]
    solution = np.linalg.lstsq(system, w, rcond=None)[0]
    off = np.abs(w - system @ solution)
    weight = 1.0 / (1.0 + (off / (3.0 * np.median(off) + 1e-12)) ** 2)
    a, b, c, gx, gy, z = np.linalg.lstsq(system * weight[:, None], w * weight, rcond=None)[0]
    normal = unit(plane.direction - gx * x - gy * y)
    tall = np.sqrt(1.0 + gx * gx + gy * gy)
    first = np.array([[1 + gx * gx, gx * gy], [gx * gy, 1 + gy * gy]])
    second = np.array([[a, b], [b, c]]) / tall
    values, vectors = eigh(second, first)
    order = np.argsort(np.abs(values))
    values, vectors = values[order], vectors[:, order]
    bend = unit(vectors[0, 1] * (x + gx * plane.direction) + vectors[1, 1] * (y + gy * plane.direction))
    along = np.cross(normal, bend)
    return plane.point + z * plane.direction, np.stack([along, bend, normal]), values


def of_curvature(kind: Kind, vertex: Floats, frame: Floats, bends: Floats) -> list[Primitive | None]:
    """Return primitives with the patch's normal and curvatures in the middle of it."""
    along, across, normal = frame
    k_small, k_large = (float(k) if abs(k) > 1e-3 else (1e-3 if k >= 0 else -1e-3) for k in bends)
    sign, radius = float(np.sign(k_large)), 1.0 / abs(k_large)
    center = vertex + sign * radius * normal
    if kind == "sphere":
        if k_small * k_large < 0.0:  # a saddle
            return []
        mean = 0.5 * (k_small + k_large)
        return [Sphere(vertex + normal / mean, 1.0 / abs(mean))]
    if kind == "cylinder":
        return [Cylinder(center, along, radius)]
    if kind == "cone":
        return [Cone(center, along * s, radius, t) for s in (1.0, -1.0) for t in (0.02, 0.3)]
    # The axis lies across the strip, on the normal, as far as the other curvature says. Either curvature may be the tube's.
    tori: list[Primitive | None] = []
    for tube, turn, direction in ((k_large, k_small, across), (k_small, k_large, along)):
        tori.append(Torus(vertex + normal / turn, direction, abs(1.0 / turn - 1.0 / tube), 1.0 / abs(tube)))
    return tori
