"""Sew faces that have outlines of their own to the free edges of their neighbours, where these run within a tolerance of each other."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scan2nurbs.brep.check import check
from scan2nurbs.brep.occ import KernelError, kernel_errors
from scan2nurbs.brep.solids import assemble


def sew(faces: Sequence[tuple[Any, ...]], tolerance: float) -> list[tuple[Any, ...]] | None:
    """Join the free edges of faces that lie within a tolerance of each other.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face, oriented outward, in kernel units.
    tolerance : float
        Largest distance between edges that become one, in kernel units.

    Returns
    -------
    list of tuple of TopoDS_Face, or None
        The faces in the same order; None where fewer free edges are not had without an invalid model, a lost face or a wider tolerance.
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing

    before = assemble([face for pieces in faces for face in pieces])
    try:
        with kernel_errors("sew the faces"):
            sewing = BRepBuilderAPI_Sewing(tolerance)
            sewing.SetMaxTolerance(tolerance)
            for pieces in faces:
                for face in pieces:
                    sewing.Add(face)
            sewing.Perform()
            if sewing.NbDeletedFaces():
                return None
            out = [tuple(_sewn(sewing, face) for face in pieces) for pieces in faces]
        after = assemble([face for pieces in out for face in pieces])
        if after.n_free_edges >= before.n_free_edges:
            return None
        found = check(after.shape)
    except KernelError:
        return None
    return out if found.valid and found.max_tolerance <= tolerance else None


def _sewn(sewing: Any, face: Any) -> Any:
    """Return what a face has become, turned as it was."""
    from OCP.TopoDS import TopoDS

    if not sewing.IsModified(face):
        return face
    changed = TopoDS.Face(sewing.Modified(face))
    return TopoDS.Face(changed.Oriented(face.Orientation()))
