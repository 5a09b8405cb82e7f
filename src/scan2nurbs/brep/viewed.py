"""Faces that a part loses where it is triangulated as programs do that show it: as a whole, by lengths of its own size."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scan2nurbs.brep.check import is_valid
from scan2nurbs.brep.occ import CONFUSION, kernel_errors

_VIEWS = ((0.002, 0.1), (0.01, 0.5))
"""Deflection, as a share of the root of the part's area, and angle: what viewers and mesh exporters commonly take."""
_LEAST = 5e-4
"""Least size of triangles, as such a share: a wrinkle, however small, would be meshed until its angles are small."""


def unseen(faces: Sequence[tuple[Any, ...]], shape: Any) -> list[int]:
    """Return the faces that get no triangles, or only such as the kernel finds invalid, in one of the usual ways to show a part.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face.
    shape : TopoDS_Shape
        The valid part that holds them, in kernel units. It stays without triangles.

    Raises
    ------
    KernelError
        If the kernel cannot triangulate it at all.

    Notes
    -----
    A face that can be triangulated by itself may not be where it shares edges: each is divided so that it is fine enough for both faces.
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepGProp import BRepGProp
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GProp import GProp_GProps
    from OCP.IMeshTools import IMeshTools_Parameters

    lost: set[int] = set()
    with kernel_errors("triangulate the part"):
        props = GProp_GProps()
        BRepGProp.SurfaceProperties_s(shape, props, 1e-3)
        size = max(abs(props.Mass()), CONFUSION**2) ** 0.5
        for share, angle in _VIEWS:
            copied, how = BRepBuilderAPI_Copy(shape), IMeshTools_Parameters()
            how.Deflection, how.Angle, how.InParallel = max(share * size, CONFUSION), angle, False
            how.MinSize = max(_LEAST * size, CONFUSION)
            BRepMesh_IncrementalMesh(copied.Shape(), how)
            if is_valid(copied.Shape(), geometry=False) and not any(_bare(copied, pieces) for pieces in faces):
                continue
            lost |= {f for f, pieces in enumerate(faces) if _bare(copied, pieces) or not _sound(copied, pieces)}
    return sorted(lost)


def _bare(copied: Any, pieces: tuple[Any, ...]) -> bool:
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    copies = [TopoDS.Face(copied.ModifiedShape(piece)) for piece in pieces]
    return any(BRep_Tool.Triangulation_s(copy, TopLoc_Location()) is None for copy in copies)


def _sound(copied: Any, pieces: tuple[Any, ...]) -> bool:
    return all(is_valid(copied.ModifiedShape(piece), geometry=False) for piece in pieces)
