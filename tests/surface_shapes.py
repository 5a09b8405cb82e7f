"""Analytic surfaces sampled like a scan, with what a fit is to be measured against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from scan2nurbs.surfaces.fit import SurfaceFit


@dataclass(frozen=True)
class Shape:
    """A surface over [0, 1]² of roughly `size`, cut to where `keep` holds."""

    at: Callable[[np.ndarray, np.ndarray], np.ndarray]
    size: tuple[float, float]
    keep: Callable[[np.ndarray, np.ndarray], np.ndarray] = lambda u, v: np.ones(len(u), bool)

    def scan(self, n: int, noise: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, float]:
        """Noisy points, the points without noise, and the standard deviation; `noise` in spacings."""
        rng = np.random.default_rng(seed)
        h = np.sqrt(self.size[0] * self.size[1] / n)
        counts = [max(2, round(s / h)) for s in self.size]
        grid = np.stack(np.meshgrid(*(np.arange(c) + 0.5 for c in counts), indexing="ij"), -1).reshape(-1, 2)
        u, v = ((grid + rng.uniform(-0.3, 0.3, grid.shape)) / counts).T
        keep = self.keep(u, v)
        u, v = u[keep], v[keep]
        e = 1e-5
        normal = np.cross(self.at(u + e, v) - self.at(u - e, v), self.at(u, v + e) - self.at(u, v - e))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        points = self.at(u, v)
        k = min(12, len(points) - 1)
        sigma = noise * np.median(cKDTree(points).query(points, k=k + 1)[0][:, k]) * np.sqrt(np.pi / k)
        return points + rng.normal(0, sigma, (len(points), 1)) * normal, points, sigma


def stack(*coordinates: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*coordinates), axis=-1).astype(float)


def tube(degrees: float, radius: float, length: float) -> Shape:
    turn = np.radians(degrees)
    return Shape(
        lambda u, v: stack(radius * np.cos(turn * u), length * v, radius * np.sin(turn * u)),
        (turn * radius, length),
    )


def pipe(turns: float) -> Shape:
    """A pipe of radius 12 bent around a circle of radius 40 by so many degrees."""
    turn = np.radians(turns)

    def at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        r = 40 + 12 * np.cos(2 * np.pi * u)
        return stack(r * np.cos(turn * v), r * np.sin(turn * v), 12 * np.sin(2 * np.pi * u))

    return Shape(at, (2 * np.pi * 12, turn * 40))


def _blade(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A sheet folded around a leading edge of radius 6, cambered and twisted."""
    s, r = (u - 0.5) * 150, 6.0
    nose = np.abs(s) < np.pi * r / 2
    x = np.where(nose, -r * np.cos(s / r), np.abs(s) - np.pi * r / 2)
    y = np.where(nose, r * np.sin(s / r), np.sign(s) * r) + 0.004 * (x + r) ** 2
    a = 0.5 * (v - 0.5)
    return stack(x * np.cos(a) - y * np.sin(a), x * np.sin(a) + y * np.cos(a), 90 * v)


def _hemisphere(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    x, y = 2 * u - 1, 2 * v - 1
    r = np.hypot(x, y) + 1e-12
    return 32 * stack(np.sin(r * np.pi / 2) * x / r, np.sin(r * np.pi / 2) * y / r, np.cos(r * np.pi / 2))


def _cone(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    r, t = 30 + 20 * v, 2 * np.pi * u
    return stack(r * np.cos(t), r * np.sin(t), 34.6 * v)


def _disc(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return (u - 0.5) ** 2 + (v - 0.5) ** 2 < 0.24


def _ring(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return _disc(u, v) & ((u - 0.5) ** 2 + (v - 0.5) ** 2 > 0.05)


def _holes(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return ((u - 0.3) ** 2 + (v - 0.5) ** 2 > 0.02) & ((u - 0.7) ** 2 + (v - 0.4) ** 2 > 0.03) & (v < 0.95 + 0.05 * np.sin(40 * u))


SHAPES = {
    "convex": Shape(lambda u, v: stack(100 * u, 70 * v, 20 * np.cos(np.pi * (u - 0.5)) * np.cos(np.pi * (v - 0.5))), (100, 70)),
    "concave": Shape(
        lambda u, v: stack(90 * u, 90 * v, 40 * ((u - 0.5) ** 2 + (v - 0.5) ** 2) + 6 * np.sin(5 * u + 3 * v)), (90, 90), _disc
    ),
    "ring": Shape(lambda u, v: stack(100 * u, 100 * v, 8 * np.sin(4 * u) * np.cos(3 * v)), (100, 100), _ring),
    "conical ring": Shape(_cone, (2 * np.pi * 40, 40)),
    "half tube": tube(180, 30, 80),
    "tube of 300 degrees": tube(300, 20, 80),
    "closed tube": tube(360, 20, 60),
    "saddle": Shape(lambda u, v: stack(90 * u, 90 * v, 60 * ((u - 0.5) ** 2 - (v - 0.5) ** 2)), (90, 90)),
    "blade": Shape(_blade, (150, 90)),
    "hemisphere": Shape(_hemisphere, (100, 100), lambda u, v: (u - 0.5) ** 2 + (v - 0.5) ** 2 < 0.25),
    "ribbon": Shape(lambda u, v: stack(150 * np.cos(5 * u), 150 * np.sin(5 * u), 20 * v + 20 * np.sin(7 * u)), (1000, 20)),
    "holes": Shape(lambda u, v: stack(100 * u, 80 * v, 8 * np.sin(6 * u) * np.cos(5 * v)), (100, 80), _holes),
}


def distance_to(fit: SurfaceFit, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) of points from a fitted surface, by Newton's method in NumPy from the nearest foot point."""
    surface, inside = fit.surface, fit.uv[fit.inliers]
    uv = inside[cKDTree(surface.evaluate(inside)).query(points)[1]]
    for _ in range(8):
        d = surface.derivatives(uv)
        r = points - d[:, 0]
        a, b, c = (np.einsum("ni,ni->n", d[:, i], d[:, j]) for i, j in ((1, 1), (1, 2), (2, 2)))
        gu, gv = np.einsum("ni,ni->n", r, d[:, 1]), np.einsum("ni,ni->n", r, d[:, 2])
        step = np.stack([c * gu - b * gv, a * gv - b * gu], 1) / (a * c - b * b)[:, None]
        moved = uv + np.clip(step, -0.02, 0.02)
        uv = np.stack([np.mod(moved[:, k], 1.0) if surface.closed[k] else np.clip(moved[:, k], 0, 1) for k in (0, 1)], 1)
    return np.einsum("ni,ni->n", points - surface.evaluate(uv), surface.normals(uv))
