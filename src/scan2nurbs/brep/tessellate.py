"""Triangles of a face, for pictures and mesh files."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.face import TrimmedFace
from scan2nurbs.brep.occ import KernelError, kernel_errors, silence
from scan2nurbs.errors import ParameterError

_ANGLE = 0.35


@dataclass(frozen=True)
class Triangles:
    """A triangle mesh.

    Attributes
    ----------
    points : (N, 3) float64
        In the frame and unit of the face.
    triangles : (M, 3) int64
        Indices of points, counter-clockwise seen from where the surface's normal points to.
    uv : (N, 2) float64
        The parameters of the points on the face's surface.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    uv: NDArray[np.float64]


def tessellate_face(face: TrimmedFace, *, deflection: float) -> Triangles:
    """Return triangles that lie within `deflection` of the face.

    Parameters
    ----------
    face : TrimmedFace
        Is left as it is.
    deflection : float
        Largest distance of a triangle's inside from the surface, in the unit of the face.

    Raises
    ------
    ParameterError
        If the deflection is not a positive number.
    KernelError
        If the kernel cannot triangulate the face.

    Notes
    -----
    Runs in one thread, so that the same face gives the same triangles.
    """
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location

    if not (np.isfinite(deflection) and deflection > 0):
        raise ParameterError(f"The 'deflection' parameter of tessellate_face must be a float in (0, inf). Got {deflection} instead.")
    silence()
    with kernel_errors("triangulate the face"):
        from OCP.BRep import BRep_Tool
        from OCP.TopoDS import TopoDS

        # The kernel keeps triangles inside the shape; a copy leaves the caller's alone.
        shape = TopoDS.Face(BRepBuilderAPI_Copy(face.shape).Shape())
        BRepMesh_IncrementalMesh(shape, deflection * face.kernel_scale, False, _ANGLE, False)
        mesh = BRep_Tool.Triangulation_s(shape, TopLoc_Location())
        if mesh is None:
            raise KernelError("The CAD kernel could not triangulate the face.")
        nodes = range(1, mesh.NbNodes() + 1)
        points = np.array([(p.X(), p.Y(), p.Z()) for p in map(mesh.Node, nodes)]).reshape(-1, 3)
        uv = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, nodes)]).reshape(-1, 2)
        triangles = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)], np.int64).reshape(-1, 3)
    return Triangles(points / face.kernel_scale, triangles - 1, uv)
