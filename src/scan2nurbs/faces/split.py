"""Split a mesh with labels at its vertices along the borders between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.complex import LabelledMesh
from scan2nurbs.faces.draw import Drawn
from scan2nurbs.faces.trace import Closed, Traced
from scan2nurbs.surfaces.shape import Floats


def split_mesh(mesh: Closed, traced: Traced, drawn: Drawn, points: Floats, region: NDArray[np.int32]) -> LabelledMesh:
    """Split the triangles that borders run through, so that every triangle belongs to one face.

    Parameters
    ----------
    mesh, traced, drawn : Closed, Traced, Drawn
        The mesh, the complex of its regions, and its places.
    points : (V, 3) float64
        Vertices of the mesh.
    region : (V,) int32
        Region of each.
    """
    n = len(points)
    m = int(np.count_nonzero((mesh.triangles < n).all(axis=1)))
    triangles = mesh.triangles[:m].astype(np.int64)
    added = [points]
    crossing = np.full(len(mesh.twin), -1)
    for half, ends, line in zip(traced.borders, traced.ends, drawn.lines, strict=True):
        # Caps are no part of the surface: a free border runs through the mesh's own vertices.
        if mesh.triangles.ravel()[mesh.twin[half[0]]] >= n:
            continue
        number = n + np.arange(len(half))
        crossing[half] = crossing[mesh.twin[half]] = number
        inner = line[:-1] if ends[0] < 0 else line[1:-1]
        added.append(inner)
        n += len(half)
    of = region[triangles]
    same = of == np.roll(of, -1, axis=1)
    pieces, faces = [triangles[same.all(axis=1)]], [of[same.all(axis=1), 0]]
    for k in range(3):
        # Corner k differs from the other two.
        rows = np.flatnonzero(~same[:, k] & same[:, (k + 1) % 3] & ~same[:, (k + 2) % 3])
        a, b, c = (triangles[rows, (k + j) % 3] for j in range(3))
        ab, ca = crossing[3 * rows + k], crossing[3 * rows + (k + 2) % 3]
        pieces += [np.column_stack(t) for t in ((a, ab, ca), (ab, b, c), (ab, c, ca))]
        faces += [of[rows, k], of[rows, (k + 1) % 3], of[rows, (k + 1) % 3]]
    rows = traced.corners[traced.corners < m]
    centre = n + np.arange(len(rows))
    added.append(drawn.vertices[traced.corners < m])
    for k in range(3):
        a, ab, ca = triangles[rows, k], crossing[3 * rows + k], crossing[3 * rows + (k + 2) % 3]
        pieces += [np.column_stack((a, ab, centre)), np.column_stack((a, centre, ca))]
        faces += [of[rows, k]] * 2
    return LabelledMesh(np.concatenate(added), np.concatenate(pieces).astype(np.int32), np.concatenate(faces).astype(np.int32))
