"""Faces that a part loses where it is triangulated as programs do that show it: as a whole, by lengths of its own size."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from scan2nurbs.brep.check import is_valid
from scan2nurbs.brep.occ import CONFUSION, kernel_errors
from scan2nurbs.brep.solids import compound

_VIEWS = ((0.002, 0.1), (0.01, 0.5))
"""Deflection, as a share of the root of the part's area, and angle: what viewers and mesh exporters commonly take."""
_LEAST = 5e-4
"""Least size of triangles, as such a share."""
_PLAIN = ((0.002, 0.1), (1 / 3000, 0.1))
"""The same without a least size but the kernel's own, for surfaces without wrinkles: as viewers have it, and as meshes are exported."""

Pieces = tuple[Any, ...]


def unseen(faces: Sequence[Pieces], shape: Any, bent: Collection[int] = ()) -> list[int]:
    """Return the faces that get no triangles, or only such as the kernel finds invalid, in one of the usual ways to show a part.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face.
    shape : TopoDS_Shape
        The valid part that holds them, in kernel units. It stays without triangles.
    bent : collection of int
        Faces whose surfaces may have wrinkles. However small, these would be meshed until their angles are small, for minutes: so all
        triangles have a least size, but those of the other faces are tried once more by that which the kernel takes by default.

    Raises
    ------
    KernelError
        If the kernel cannot triangulate it at all.

    Notes
    -----
    A face that can be triangulated by itself may not be where it shares edges: each is divided so that it is fine enough for both faces.
    """
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    every = dict(enumerate(faces))
    with kernel_errors("triangulate the part"):
        props = GProp_GProps()
        BRepGProp.SurfaceProperties_s(shape, props, 1e-3)
        size = max(abs(props.Mass()), CONFUSION**2) ** 0.5
        lost = {f for deflection, angle in _VIEWS for f in _lost(every, shape, deflection * size, angle, _LEAST * size)}
        plain = {f: pieces for f, pieces in every.items() if f not in bent and f not in lost}
        together = compound([piece for pieces in plain.values() for piece in pieces])
        return sorted(lost.union(f for deflection, angle in _PLAIN for f in _lost(plain, together, deflection * size, angle, None)))


def _lost(faces: Mapping[int, Pieces], shape: Any, deflection: float, angle: float, least: float | None) -> list[int]:
    """Return the faces that one triangulation of a shape loses or spoils."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_Parameters

    copied, how = BRepBuilderAPI_Copy(shape), IMeshTools_Parameters()
    how.Deflection, how.Angle, how.InParallel = max(deflection, CONFUSION), angle, False
    if least is not None:
        how.MinSize = max(least, CONFUSION)
    BRepMesh_IncrementalMesh(copied.Shape(), how)
    if is_valid(copied.Shape(), geometry=False) and not any(_bare(copied, pieces) for pieces in faces.values()):
        return []
    return [f for f, pieces in faces.items() if _bare(copied, pieces) or not _sound(copied, pieces)]


def _bare(copied: Any, pieces: Pieces) -> bool:
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    copies = [TopoDS.Face(copied.ModifiedShape(piece)) for piece in pieces]
    return any(BRep_Tool.Triangulation_s(copy, TopLoc_Location()) is None for copy in copies)


def _sound(copied: Any, pieces: Pieces) -> bool:
    return all(is_valid(copied.ModifiedShape(piece), geometry=False) for piece in pieces)
