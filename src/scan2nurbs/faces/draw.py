"""Draw a traced complex: the places of its vertices and the polylines of its borders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.place import measure, pull, smooth
from scan2nurbs.faces.trace import Closed, Traced
from scan2nurbs.surfaces.shape import Floats, Shape

FAR = 3.0
"""Farthest, in h, that the surfaces may draw a place away from where the mesh has it."""
ROUNDS = 3


@dataclass(frozen=True)
class Drawn:
    """Places of a traced complex.

    Attributes
    ----------
    vertices : (V, 3) float64
    lines : list of (K, 3) float64
        Polyline of each border with its ends.
    faces : list of tuple of int
        Regions that meet at each vertex, ascending, −1 where the scan ends.
    """

    vertices: Floats
    lines: list[Floats]
    faces: list[tuple[int, ...]]


def draw(mesh: Closed, traced: Traced, points: Floats, region: NDArray[np.int32], shapes: Sequence[Shape], h: float) -> Drawn:
    """Draw the borders and vertices of a complex onto the surfaces.

    Parameters
    ----------
    mesh, traced : Closed, Traced
        The mesh and the complex of its regions.
    points : (V, 3) float64
        Vertices of the mesh.
    region : (V,) int32
        Region of each.
    shapes : sequence of Shape
        Surface of each region.
    h : float
        Spacing of the points.
    """
    every = np.concatenate([points, np.full((mesh.n_holes, 3), np.nan)])
    of = np.concatenate([region, np.full(mesh.n_holes, -1, np.int32)])
    corner = mesh.triangles[traced.corners]
    place = np.nanmean(every[corner], axis=1) if len(corner) else np.zeros((0, 3))
    meeting = np.sort(of[corner], axis=1)
    vertices = settle(place, meeting, shapes, h)
    start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    lines = []
    for half, ends in zip(traced.borders, traced.ends, strict=True):
        middle = np.nanmean(np.stack([every[start[half]], every[end[half]]]), axis=0)
        lines.append(
            np.concatenate([middle, middle[:1]]) if ends[0] < 0 else np.concatenate([vertices[ends[:1]], middle, vertices[ends[1:]]])
        )
    return Drawn(vertices, draw_lines(lines, traced, shapes, h), [tuple(int(f) for f in row) for row in meeting])


def settle(place: Floats, faces: NDArray[np.int32], shapes: Sequence[Shape], h: float) -> Floats:
    """Move vertices (V, 3) onto the surfaces (V, K) that meet at them, as far as these leave no doubt where that is."""
    best = pull(place, faces, shapes, h, crossing=2.0)  # amid the surfaces
    for crossing in (0.5, 0.2):
        tried = pull(place, faces, shapes, h, crossing=crossing)
        near = np.linalg.norm(tried - place, axis=1) <= FAR * h
        before, after = (np.abs(measure(p, faces, shapes)[0]).max(axis=1, initial=0.0) for p in (best, tried))
        better = near & (after < before)
        best[better] = tried[better]
    return best


def draw_lines(lines: list[Floats], traced: Traced, shapes: Sequence[Shape], h: float) -> list[Floats]:
    """Smooth polylines and pull them onto both surfaces, in turn; their ends stay."""
    closed = traced.ends[:, 0] < 0
    sizes = np.array([len(line) for line in lines], np.int64)
    start = np.concatenate([[0], np.cumsum(sizes)])
    owner = np.repeat(np.arange(len(lines)), sizes)
    fixed = np.zeros(start[-1], bool)
    fixed[start[:-1][~closed]], fixed[start[1:][~closed] - 1] = True, True
    faces = traced.sides[owner]
    for _ in range(ROUNDS):
        # Nothing but its points says where a scan ends: no smoothing there, which would draw holes together.
        lines = [
            smooth(line, closed=bool(c), rounds=6) if f else line for line, c, f in zip(lines, closed, traced.sides[:, 1] >= 0, strict=True)
        ]
        flat = np.concatenate(lines) if lines else np.zeros((0, 3))
        moved = pull(flat, faces, shapes, h, steps=2)
        amid = pull(flat, faces, shapes, h, steps=2, crossing=2.0)
        # Surfaces that cross at a grazing angle say nothing reliable about places far away.
        far = np.linalg.norm(moved - flat, axis=1) > FAR * h
        moved[far] = amid[far]
        moved[fixed] = flat[fixed]
        lines = [moved[a:b] for a, b in pairwise(start)]
        for line, c in zip(lines, closed, strict=True):
            if c:
                line[-1] = line[0]
    return lines
