"""Where borders and vertices lie: on the surfaces of all faces that meet there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.surfaces.shape import Floats, Shape

CROSSING = 0.2
"""Sine of the least angle (12 degrees) at which two surfaces say themselves where they meet."""
STEP = 1.5
"""Farthest move of one step, in h."""


def pull(
    points: Floats, faces: NDArray[np.int32], shapes: Sequence[Shape], h: float, *, steps: int = 4, crossing: float = CROSSING
) -> Floats:
    """Move each place onto all surfaces that meet there.

    Parameters
    ----------
    points : (N, 3) float64
    faces : (N, K) int32
        Shapes that meet at each place, −1 for none.
    shapes : sequence of Shape
    h : float
        Spacing of the points.
    steps : int
        Newton steps.
    crossing : float
        Singular value of the normals below which they are taken for tangent.

    Returns
    -------
    (N, 3) float64

    Notes
    -----
    Gauss and Newton's shortest step to where all distances vanish, with the directions left out along which the surfaces are nearly
    tangent: there a place stays as it is, amid the surfaces.
    """
    points = points.copy()
    for _ in range(steps):
        distance, normal = measure(points, faces, shapes)
        move = _shortest(distance, normal, crossing)
        length = np.linalg.norm(move, axis=1)
        points -= move * np.minimum(1.0, STEP * h / np.maximum(length, 1e-300))[:, None]
    return points


def measure(points: Floats, faces: NDArray[np.int32], shapes: Sequence[Shape]) -> tuple[Floats, Floats]:
    """Return distances (N, K) of points (N, 3) to shapes (N, K) and the unit normals (N, K, 3); 0 where there is no shape."""
    distance = np.zeros(faces.shape)
    normal = np.zeros((*faces.shape, 3))
    rows, columns = np.nonzero(faces >= 0)
    wanted = faces[rows, columns]
    order = np.argsort(wanted, kind="stable")
    rows, columns, wanted = rows[order], columns[order], wanted[order]
    for a, b in pairwise(np.flatnonzero(np.r_[True, wanted[1:] != wanted[:-1], True]) if len(wanted) else []):
        r, c = rows[a:b], columns[a:b]
        shape = shapes[int(wanted[a])]
        distance[r, c], normal[r, c] = shape.distance_and_normal(points[r])
    bad = ~(np.isfinite(distance) & np.isfinite(normal).all(axis=2))
    distance[bad], normal[bad] = 0.0, 0.0
    return distance, normal


def _shortest(distance: Floats, normal: Floats, crossing: float) -> Floats:
    """Return the least moves (N, 3) that take away distances (N, K), by the pseudo-inverse of the normals (N, K, 3)."""
    u, s, v = np.linalg.svd(normal, full_matrices=False)
    # Two unit vectors at an angle a have the singular values √2 cos(a/2), √2 sin(a/2).
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > crossing / np.sqrt(2.0))
    return np.einsum("nks,nk,ns,nsj->nj", u, distance, inverse, v)


def smooth(line: Floats, *, closed: bool, rounds: int) -> Floats:
    """Even out a polyline (K, 3) by averaging each point with its neighbours; the ends stay where they are unless it is closed."""
    if len(line) < 3:
        return line
    line = line.copy()
    for _ in range(rounds):
        if closed:
            ring = line[:-1]
            ring = 0.5 * ring + 0.25 * (np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0))
            line = np.concatenate([ring, ring[:1]])
        else:
            line[1:-1] = 0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:])
    return line
