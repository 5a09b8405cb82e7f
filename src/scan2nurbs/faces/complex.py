"""The cell complex of a part: faces, the borders that two of them share, the vertices where borders end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.sheet import triangle_areas
from scan2nurbs.surfaces.shape import Floats

Loop = tuple[tuple[int, bool], ...]
"""Borders in order, each with whether it is walked from its first vertex to its last."""


def length_of(points: Floats) -> float:
    """Return the length of a polyline (K, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@dataclass(frozen=True)
class Border:
    """A piece of border between two faces, decided once for both of them.

    Attributes
    ----------
    points : (K, 3) float64
        Polyline from the first vertex to the last; its last point is its first one again where it is closed and has no vertex.
    faces : (int, int)
        The faces on its left and its right, seen from outside; −1 where the scan ends.
    vertices : (int, int)
        Indices of the vertices at its ends; (−1, −1) for a closed one without a vertex.
    """

    points: Floats
    faces: tuple[int, int]
    vertices: tuple[int, int]


@dataclass(frozen=True)
class LabelledMesh:
    """The surface that the complex was read from.

    Attributes
    ----------
    vertices : (n, 3) float64
    triangles : (m, 3) int32
        Counter-clockwise seen from outside; an oriented 2-manifold with or without a border.
    face : (m,) int32
        Face of each triangle; triangles of two faces share exactly the edges along their borders.
    """

    vertices: Floats
    triangles: NDArray[np.int32]
    face: NDArray[np.int32]


@dataclass(frozen=True)
class Topology:
    """Who meets whom.

    Attributes
    ----------
    vertices : (V, 3) float64
        Where three or more borders end.
    borders : tuple of Border
    loops : tuple of tuple of Loop
        Of each face its loops, in no order; the face lies on the left of a loop, seen from outside.
    source : (F,) int32
        The fit that each face came from: a surface whose points fall apart makes several faces.
    outward : (F,) int8
        +1 where the shape's normal points out of the body, −1 where into it.
    body : (F,) int32
        Connected body of each face, the largest first.
    closed : tuple of bool
        Whether each body has no free border.
    genus : (F,) int32
        Handles of each face: 0 for what lies flat, a disc with holes or a sphere.
    mesh : LabelledMesh
    notes : tuple of str
        What was left out or looks odd, as sentences.
    held : frozenset of int
        Vertices that stay where they are, whatever the surfaces around them say.
    """

    vertices: Floats
    borders: tuple[Border, ...]
    loops: tuple[tuple[Loop, ...], ...]
    source: NDArray[np.int32]
    outward: NDArray[np.int8]
    body: NDArray[np.int32]
    closed: tuple[bool, ...]
    genus: NDArray[np.int32]
    mesh: LabelledMesh
    notes: tuple[str, ...]
    held: frozenset[int] = frozenset()

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.source)

    @cached_property
    def areas(self) -> Floats:
        """Area of each face's part of the mesh, (F,)."""
        mesh = self.mesh
        areas = triangle_areas(mesh.vertices, mesh.triangles)
        return np.bincount(mesh.face, areas, minlength=self.n_faces).astype(np.float64, copy=False)

    def neighbours(self, face: int) -> tuple[int, ...]:
        """Return the faces that share a border with one, ascending."""
        other = {f for b in self.borders if face in b.faces for f in b.faces}
        return tuple(sorted(other - {face, -1}))
