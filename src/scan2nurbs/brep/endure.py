"""Whether shapes are still valid in a file: STEP keeps no tolerances, and who reads it mends what only they held together."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scan2nurbs.brep.check import is_valid, is_valid_meshed
from scan2nurbs.brep.occ import CONFUSION, KernelError
from scan2nurbs.brep.read import faces_of, read_shape
from scan2nurbs.brep.step import write_step
from scan2nurbs.errors import InputError

_ON_SURFACE = 10.0 * CONFUSION
"""How far from a surface a point may be that a file, which keeps about so many digits, holds of it."""


def endures(shape: Any) -> bool:
    """Tell whether a shape is valid, also with triangles, once it was written to a STEP file and read again.

    Parameters
    ----------
    shape : TopoDS_Shape
        In kernel units.
    """
    found = _read_again(shape)
    return found is not None and is_valid(found) and is_valid_meshed(found, every=False)


def spoilt(faces: Sequence[tuple[Any, ...]], shape: Any) -> list[int]:
    """Return the faces that are invalid, or cannot be triangulated, once the shape that they make was written and read again.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face.
    shape : TopoDS_Shape
        What holds them, in kernel units.

    Notes
    -----
    Who reads a file may divide a face. So it is found by a point within it: which lies on the face's surface, and if not on the face
    then near it.
    """
    found = _read_again(shape)
    if found is None:
        return []
    bad = [face for face in faces_of(found) if not (is_valid(face) and is_valid_meshed(face, every=False))]
    return sorted({_nearest(faces, place) for face in bad if (place := _within(face)) is not None})


def _read_again(shape: Any) -> Any | None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.step"
        try:
            write_step(path, shape, [], unit="mm", kernel_unit="mm", name="shape", schema="AP242")
            return read_shape(path)
        except (KernelError, InputError):
            return None


def _within(face: Any) -> Any | None:
    """Return a point of a face; None where the kernel finds none."""
    from OCP.BOPTools import BOPTools_AlgoTools3D
    from OCP.gp import gp_Pnt, gp_Pnt2d
    from OCP.IntTools import IntTools_Context

    place = gp_Pnt()
    return None if BOPTools_AlgoTools3D.PointInFace_s(face, place, gp_Pnt2d(), IntTools_Context()) else place


def _nearest(faces: Sequence[tuple[Any, ...]], place: Any) -> int:
    """Return the face nearest to a place, of those whose surfaces pass through it if there are any."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.ShapeAnalysis import ShapeAnalysis_Surface

    vertex = BRepBuilderAPI_MakeVertex(place).Vertex()

    def apart(face: Any) -> tuple[bool, float]:
        surface, between = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face)), BRepExtrema_DistShapeShape(vertex, face)
        surface.ValueOfUV(place, CONFUSION)
        return surface.Gap() > _ON_SURFACE, between.Value() if between.IsDone() else math.inf

    return min(range(len(faces)), key=lambda f: (min(map(apart, faces[f]), default=(True, math.inf)), f))
