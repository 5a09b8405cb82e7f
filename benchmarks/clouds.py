"""Clouds of any size on the surface of one blocky part: what the speed of every library is measured on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Corner and two edges of every face, in millimetres: two steps on a plate, with plane faces that meet at right angles.
_X, _Y, _Z = np.eye(3)
FACES = [
    (0 * _X, 120 * _X, 80 * _Y),
    (0 * _X, 120 * _X, 20 * _Z),
    (80 * _Y, 120 * _X, 20 * _Z),
    (0 * _X, 80 * _Y, 20 * _Z),
    (120 * _X, 80 * _Y, 20 * _Z),
    (20 * _Z, 40 * _X, 80 * _Y),
    (40 * _X + 20 * _Z, 80 * _Y, 30 * _Z),
    (40 * _X + 50 * _Z, 40 * _X, 80 * _Y),
    (40 * _X + 20 * _Z, 40 * _X, 30 * _Z),
    (40 * _X + 80 * _Y + 20 * _Z, 40 * _X, 30 * _Z),
    (80 * _X + 35 * _Z, 80 * _Y, 15 * _Z),
    (80 * _X + 35 * _Z, 40 * _X, 80 * _Y),
    (80 * _X + 20 * _Z, 40 * _X, 15 * _Z),
    (80 * _X + 80 * _Y + 20 * _Z, 40 * _X, 15 * _Z),
    (120 * _X + 20 * _Z, 80 * _Y, 15 * _Z),
]
AREA = sum(float(np.linalg.norm(np.cross(a, b))) for _, a, b in FACES)
JITTER, NOISE = 0.2, 0.05
"""Both in spacings: of grid points along the face, and of all points across it."""


def random_cloud(n: int, seed: int = 0) -> NDArray[np.float64]:
    """Sample n points evenly at random, in no order."""
    rng = np.random.default_rng(seed)
    areas = np.array([np.linalg.norm(np.cross(a, b)) for _, a, b in FACES])
    share = rng.multinomial(n, areas / areas.sum())
    parts = [_place(face, rng.random((m, 2)), rng, np.sqrt(AREA / n)) for face, m in zip(FACES, share, strict=True)]
    return rng.permutation(np.concatenate(parts))


def grid_cloud(n: int, seed: int = 0) -> NDArray[np.float64]:
    """Sample about n points on a jittered square grid, like a scanner's, in no order."""
    rng = np.random.default_rng(seed)
    h = np.sqrt(AREA / n)
    parts = []
    for face in FACES:
        steps = [max(round(np.linalg.norm(edge) / h), 1) for edge in face[1:]]
        grid = np.stack(np.meshgrid(*(np.arange(k) + 0.5 for k in steps), indexing="ij"), axis=-1).reshape(-1, 2)
        parts.append(_place(face, (grid + JITTER * rng.normal(size=grid.shape)) / steps, rng, h))
    return rng.permutation(np.concatenate(parts))


def _place(face, uv, rng, h: float) -> NDArray[np.float64]:
    corner, a, b = face
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    return corner + uv[:, :1] * a + uv[:, 1:] * b + NOISE * h * rng.normal(size=(len(uv), 1)) * normal
