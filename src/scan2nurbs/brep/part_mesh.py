"""Triangles of a whole part, for pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.part import PartModel
from scan2nurbs.brep.read import faces_of


@dataclass(frozen=True)
class PartMesh:
    """A part as triangles.

    Attributes
    ----------
    corners : (T, 3, 3) float64
        In the frame and unit of the cloud.
    face : (T,) int32
        The row of ``PartModel.faces`` that each belongs to.
    """

    corners: NDArray[np.float64]
    face: NDArray[np.int32]


def mesh_part(part: PartModel) -> PartMesh:
    """Return triangles fine enough for pictures."""
    mesh = tessellate(part.shape)
    return PartMesh(mesh.corners / part.kernel_scale, np.array(face_rows(part), np.int32)[mesh.face])


def face_rows(part: PartModel) -> list[int]:
    """Return the row of ``part.faces`` that each of the kernel's faces of ``part.shape`` belongs to, in their order."""
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap  # pyright: ignore[reportAttributeAccessIssue]

    known: Any = ShapeMap()
    rows: list[int] = []
    for row, face in enumerate(part.faces):
        for shape in face.shapes:
            if known.Add(shape) > len(rows):
                rows.append(row)
    return [rows[known.FindIndex(face) - 1] for face in faces_of(part.shape)]
