"""Faces that a part loses where it is triangulated as programs do that show it: as a whole, by lengths of its own size."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import repeat
from typing import Any

from scan2nurbs.brep.check import is_valid
from scan2nurbs.brep.crossing import longest_lobe
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.occ import CONFUSION, kernel_errors
from scan2nurbs.brep.solids import compound

_VIEWS = ((0.01, 0.5, False), (0.002, 0.1, False), (0.002, 0.5, True), (0.002, 0.1, True), (1 / 3000, 0.1, True))
"""Deflection, as a share of the root of the part's area, the finest last, and angle: what viewers and mesh exporters commonly take. Whether
triangles may be as small as the kernel likes, as viewers have it: then for surfaces without wrinkles only."""
_LEAST = 5e-4
"""Least size of the other triangles, as such a share."""
_LOOP = 0.008
"""Loops between borders that cross, shorter than such a share, four fine deflections, vanish between triangles of a least size."""

Pieces = tuple[Any, ...]


def unseen(faces: Sequence[Pieces], shape: Any, wrinkled: Collection[int] = ()) -> list[int]:
    """Return the faces that get no triangles, or only such as the kernel finds invalid, in one of the usual ways to show a part.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face.
    shape : TopoDS_Shape
        The valid part that holds them, in kernel units. It stays without triangles.
    wrinkled : collection of int
        Faces whose surfaces may have wrinkles. However small, these would be meshed until their angles are small, for minutes: so all
        triangles have a least size, but those of the other faces are tried once more by that which the kernel takes by default.

    Raises
    ------
    KernelError
        If the kernel cannot triangulate it at all.

    Notes
    -----
    Curved faces whose borders cross are not shown at all: the kernel may refine their triangles for ever. Those that cross in a loop so
    short that it vanishes between triangles of a least size are not asked for others where it is longer than the deflection.
    A face that can be triangulated by itself may not be where it shares edges: each is divided so that it is fine enough for both faces.
    """
    every = dict(enumerate(faces))
    with kernel_errors("triangulate the part"):
        size = max(rough_area(shape), CONFUSION**2) ** 0.5
        lobes = {f: max(map(_lobe_of, pieces, repeat(_VIEWS[-1][0] * size)), default=0.0) for f, pieces in every.items()}
        lost = {f for f, lobe in lobes.items() if lobe > _LOOP * size}
        for deflection, angle, small in _VIEWS:
            # What is lost in coarse triangles is not asked for fine ones, which may take the kernel minutes then.
            spared = {f for f, lobe in lobes.items() if lobe > deflection * size}.union(wrinkled) if small else set[int]()
            shown = {f: pieces for f, pieces in every.items() if f not in lost | spared}
            lost.update(_lost(shown, deflection * size, angle, None if small else _LEAST * size) if shown else ())
        return sorted(lost)


def _lobe_of(face: Any, step: float) -> float:
    """Return the longest loop between borders that cross, of a face that is not plane: there the kernel joins the borders' points alone."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_Plane

    return 0.0 if BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane else longest_lobe(face, step)


def _lost(faces: Mapping[int, Pieces], deflection: float, angle: float, least: float | None) -> list[int]:
    """Return the faces that one triangulation of all of them together loses or spoils."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_Parameters

    together = compound([piece for pieces in faces.values() for piece in pieces])
    copied, how = BRepBuilderAPI_Copy(together), IMeshTools_Parameters()
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
