"""Whether a model is sound, and what it consists of."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from scan2nurbs.brep.measure import area, volume
from scan2nurbs.brep.occ import CONFUSION, kernel_errors, silence

_MESHES = ((1e-2, 0.0, 0.5), (1e-2, 2e-3, 0.5), (2e-3, 2e-3, 0.1))
"""Coarse, coarse with small triangles where they are needed, and fine: deflection and least size, as shares of a shape's extent, and angle.
Programs choose theirs, and the sides of a narrow place may cross in one of them only. Where they do so in the second, the third may take
the kernel for ever."""
_FAILURES = 0x1 | 0x2 | 0x4
"""IMeshData_Status: an open wire, a wire that crosses itself, a failure."""


@dataclass(frozen=True)
class ModelCheck:
    """What the CAD kernel says about a shape.

    Attributes
    ----------
    valid : bool
        Whether the kernel's own analysis (BRepCheck) finds nothing wrong, before and after the shape is triangulated.
    n_faces, n_edges : int
        Distinct faces, and distinct edges that are not shrunk to a point.
    free_edges : int
        Edges with a face on one side only. A trimmed face has only such, but for the seam of a tube.
    closed : bool
        Whether there are faces and no free edges.
    max_tolerance : float
        The largest gap that any vertex, edge or face is allowed, in the numbers of the shape.
    shape : TopoDS_Shape
    """

    valid: bool
    n_faces: int
    n_edges: int
    free_edges: int
    closed: bool
    max_tolerance: float
    shape: Any = field(repr=False)

    @cached_property
    def area(self) -> float:
        """The area; found when it is asked for, since it takes long where surfaces are bent."""
        return area(self.shape)

    @cached_property
    def volume(self) -> float:
        """The volume; 0 for a shape that is not closed."""
        return abs(volume(self.shape)) if self.closed else 0.0


def check(shape: Any, sound: bool | None = None) -> ModelCheck:
    """Analyse a ``TopoDS_Shape``, as it is and once it is triangulated: edges that only a wide tolerance holds on fail then.

    Parameters
    ----------
    shape : TopoDS_Shape
    sound : bool, optional
        What `is_sound` said of it, where that is known.

    Raises
    ------
    KernelError
        If the kernel cannot even analyse it.
    """
    from OCP.BRep import BRep_Tool
    from OCP.collections import IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as EdgeMap
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
    from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS

    silence()
    with kernel_errors("analyse the shape"):
        valid = is_sound(shape) if sound is None else sound
        faces, edges = ShapeMap(), EdgeMap()
        TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
        TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, edges)
        n_edges = free = 0
        for k in range(1, edges.Size() + 1):
            edge = TopoDS.Edge(edges.FindKey(k))
            if BRep_Tool.Degenerated_s(edge):
                continue
            n_edges += 1
            # A seam is listed with its one face twice.
            free += edges.FindFromIndex(k).Size() < 2
        tolerance = ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1)
    return ModelCheck(
        valid=valid,
        n_faces=faces.Size(),
        n_edges=n_edges,
        free_edges=free,
        closed=faces.Size() > 0 and free == 0,
        max_tolerance=tolerance,
        shape=shape,
    )


def is_sound(shape: Any) -> bool:
    """Return whether a shape is valid as it is, and triangulated: coarsely, or if that fails in the finer ways."""
    return is_valid(shape) and is_valid_meshed(shape, every=False)


def is_valid(shape: Any, *, geometry: bool = True) -> bool:
    """Return whether the kernel's own analysis finds nothing wrong with a shape.

    Without `geometry` curves and surfaces are taken as valid, and only what is built of them is looked at, triangles included.
    """
    from OCP.BRepCheck import BRepCheck_Analyzer

    with kernel_errors("analyse the shape"):
        return bool(BRepCheck_Analyzer(shape, geometry, True).IsValid())


def is_valid_meshed(shape: Any, every: bool = True, *, extent: float | None = None) -> bool:
    """Return whether a valid shape can be triangulated, and the kernel's analysis finds nothing wrong with it then.

    Parameters
    ----------
    shape : TopoDS_Shape
        Valid by `is_valid`: triangles do not change its geometry, of which the analysis may take seconds.
    every : bool
        Whether all of `_MESHES` must be possible, or the first is enough, or else the others.
    extent : float, optional
        By what the triangles are measured; by default the shape's own.
    """
    extent = extent_of(shape) if extent is None else extent
    if extent == 0.0:
        return True
    coarse, *finer = (lambda m=m: _meshes(shape, m[0] * extent, m[1] * extent, m[2]) for m in _MESHES)
    return coarse() and all(mesh() for mesh in finer) if every else coarse() or all(mesh() for mesh in finer)


def extent_of(shape: Any) -> float:
    """Return the diagonal of a shape's bounding box; 0 for an empty one."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    return 0.0 if box.IsVoid() else float(box.SquareExtent() ** 0.5)


def _meshes(shape: Any, deflection: float, least: float, angle: float) -> bool:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_Parameters

    copy = BRepBuilderAPI_Copy(shape).Shape()
    how = IMeshTools_Parameters()
    # The kernel refuses a deflection below its own absolute tolerance.
    how.Deflection, how.Angle, how.InParallel = max(deflection, CONFUSION), angle, False
    if least:  # else a wrinkle, however small, is meshed until its angles are small
        how.MinSize = max(least, CONFUSION)
    mesh = BRepMesh_IncrementalMesh(copy, how)
    return mesh.GetStatusFlags() & _FAILURES == 0 and is_valid(copy, geometry=False)
