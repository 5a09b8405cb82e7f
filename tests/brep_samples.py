"""Surfaces and loops that the tests of the CAD room share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.overlay import winding
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]


def clamped(n: int, degree: int, low: float = 0.0, high: float = 1.0) -> Floats:
    return np.concatenate([[low] * degree, np.linspace(low, high, n - degree + 1), [high] * degree])


def plate(*, bend: float = 0.1, size: float = 100.0, seed: int = 0, degrees: tuple[int, int] = (3, 3), waves: int = 3) -> BSplineSurface:
    """A smooth height field over a size x 0.8 size rectangle, uniform in u and v."""
    rng = np.random.default_rng(seed)
    knots = clamped(10, degrees[0]), clamped(9, degrees[1])
    # Control points at the Greville abscissae give back u and v exactly.
    u, v = (np.array([k[i + 1 : i + d + 1].mean() for i in range(len(k) - d - 1)]) for k, d in zip(knots, degrees, strict=True))
    u, v = np.meshgrid(u, v, indexing="ij")
    height = sum(
        rng.normal() * np.cos(np.pi * i * u) * np.cos(np.pi * j * v) / (1 + i + j) ** 1.5 for i in range(waves) for j in range(waves)
    )
    points = np.stack([u, 0.8 * v, bend * height], axis=-1) * size
    return BSplineSurface(degrees, knots, points, np.ones(u.shape))


def cylinder(*, radius: float = 10.0, height: float = 40.0, share: float = 1.0) -> BSplineSurface:
    """An exact (rational, quadratic) cylinder over `share` of a turn: 1 is closed in u, 0.5 a half tube. u in [0, share]."""
    quarters = int(4 * share)
    angle = np.arange(2 * quarters + 1) * np.pi / 4
    weights = np.where(np.arange(2 * quarters + 1) % 2, np.sqrt(0.5), 1.0)
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) / weights[:, None] * radius
    if share == 1.0:
        ring[-1] = ring[0]
    points = np.array([[[x, y, 0.0], [x, y, height]] for x, y in ring])
    knots = np.concatenate([[0.0], np.repeat(np.linspace(0, share, quarters + 1), 2), [share]])
    knots = np.concatenate([[0.0], knots[1:-1], [share]])
    return BSplineSurface(
        (2, 1), (knots, np.array([0.0, 0.0, height, height])), points, np.repeat(weights[:, None], 2, axis=1), (share == 1.0, False)
    )


def circle(u: float, v: float, ru: float, rv: float | None = None, n: int = 200) -> Floats:
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.column_stack([u + ru * np.cos(t), v + (ru if rv is None else rv) * np.sin(t)])


def true_area(surface: BSplineSurface, loops: list[Floats], n: int = 200) -> float:
    """The area of the surface inside the first loop and outside the others, by the midpoint rule."""
    steps = (np.arange(n) + 0.5) / n
    (u0, u1), (v0, v1) = surface.domain
    u, v = np.meshgrid(u0 + (u1 - u0) * steps, v0 + (v1 - v0) * steps, indexing="ij")
    uv = np.column_stack([u.ravel(), v.ravel()])
    inside = winding(loops[0], uv) != 0
    for hole in loops[1:]:
        inside &= winding(hole, uv) == 0
    slopes = surface.derivatives(uv[inside])
    return float(np.linalg.norm(np.cross(slopes[:, 1], slopes[:, 2]), axis=1).sum() * (u1 - u0) * (v1 - v0) / n**2)
