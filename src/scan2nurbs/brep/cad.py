"""Read CAD files, and their surfaces as triangles that know where on which surface they lie."""

# pyright: reportAttributeAccessIssue=false
from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.evaluate import Evaluator, Floats, evaluator
from scan2nurbs.brep.header import UNIT_NAMES
from scan2nurbs.brep.occ import EXPORT_LOCK, KernelError, kernel_errors, silence
from scan2nurbs.errors import InputError

_DEFLECTION = 1 / 3000
"""Default distance of triangles to the surface, in units of the square root of the part's area."""

_ANGLE = 0.1
"""Largest turn of the surface across a triangle, in radians."""


@dataclass(frozen=True)
class CadFace:
    """A face of a CAD part.

    Attributes
    ----------
    type : str
        "Plane", "Cylinder", "Cone", "Sphere", "Torus", "BSplineSurface", … as the CAD kernel names it.
    sign : float
        +1 where the outward normal is S_u × S_v, −1 where the face is reversed.
    solid : bool
        Whether it bounds a solid, so that it is seen from outside only.
    stretch : float
        Median of |S_u × S_v| over its triangles: against it a pole of the surface shows.
    evaluate : callable
        Points and derivatives of its surface at many parameters.
    """

    type: str
    sign: float
    solid: bool
    stretch: float
    evaluate: Evaluator = field(repr=False, compare=False)


@dataclass(frozen=True)
class CadPart:
    """The faces of a CAD model, tessellated.

    Attributes
    ----------
    shape : TopoDS_Shape
        The model itself, in `unit`.
    faces : tuple of CadFace
        In the order in which the model holds them; the position is the face's id.
    corners : (T, 3, 3) float64
        The triangles, wound so that they are counter-clockwise seen from outside.
    uv : (T, 3, 2) float64
        Surface parameters of each corner.
    normals : (T, 3, 3) float64
        The outward unit normals of the true surfaces at each corner.
    face : (T,) int32
        The face of each triangle.
    deflection : float
        Largest distance of the triangles to the surface that was asked for, in `unit`.
    unit : str
        A key of ``cloud.UNITS``.
    source : str
        The file's path, or "shape".
    notes : tuple of str
        What was guessed, one sentence each.
    """

    shape: Any = field(repr=False)
    faces: tuple[CadFace, ...]
    corners: Floats = field(repr=False)
    uv: Floats = field(repr=False)
    normals: Floats = field(repr=False)
    face: NDArray[np.int32] = field(repr=False)
    deflection: float
    unit: str = "mm"
    source: str = "shape"
    notes: tuple[str, ...] = ()

    @property
    def types(self) -> tuple[str, ...]:
        """The type of each face."""
        return tuple(face.type for face in self.faces)

    @property
    def triangle_area(self) -> Floats:
        """Area of each triangle, (T,)."""
        cross = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        return 0.5 * np.linalg.norm(cross, axis=1)

    @property
    def area(self) -> float:
        """Area of all faces, measured on the triangles."""
        return float(self.triangle_area.sum())

    @property
    def face_area(self) -> Floats:
        """Area of each face, (F,)."""
        return np.bincount(self.face, weights=self.triangle_area, minlength=len(self.faces)).astype(np.float64)

    def lift(self, triangle: NDArray[np.integer], weight: Floats) -> tuple[Floats, Floats]:
        """Return the points and outward unit normals on the true surfaces that belong to points of the triangles.

        Parameters
        ----------
        triangle : (N,) int
            Triangles, as rows of `corners`.
        weight : (N, 3) float64
            Barycentric weights of the points in them.

        Returns
        -------
        points : (N, 3) float64
            S(u, v) at the interpolated parameters: exactly on the surface, though not exactly above the triangle's point.
        normals : (N, 3) float64
            Unit length; at a pole of the surface the limit from inside the face.
        """
        uv = np.einsum("nkc,nk->nc", self.uv[triangle], weight)
        owner = self.face[triangle]
        points, normals = np.empty((2, len(uv), 3))
        order = np.argsort(owner, kind="stable")
        borders = np.searchsorted(owner[order], np.arange(len(self.faces) + 1))
        for index, face in enumerate(self.faces):
            rows = order[borders[index] : borders[index + 1]]
            if len(rows):
                points[rows], normals[rows] = _on_surface(face, uv[rows], self.uv[triangle[rows]].mean(axis=1))
        return points, normals

    def nearest_face(self, point: Any) -> int:
        """Return the face nearest to a point, measured to the triangles."""
        local = self.corners - np.asarray(point, dtype=np.float64)
        ends = np.roll(local, -1, axis=1)
        sides = ends - local
        along = np.einsum("tkc,tkc->tk", -local, sides) / np.maximum(np.einsum("tkc,tkc->tk", sides, sides), np.finfo(float).tiny)
        squared = ((local + np.clip(along, 0.0, 1.0)[..., None] * sides) ** 2).sum(axis=2).min(axis=1)
        normal = np.cross(sides[:, 0], sides[:, 1])
        foot_sides = np.einsum("tkc,tc->tk", np.cross(sides, -local), normal)
        height = np.einsum("tc,tc->t", local[:, 0], normal) / np.linalg.norm(normal, axis=1)
        above = (foot_sides > 0).all(axis=1)
        return int(self.face[np.where(above, height**2, squared).argmin()])


def _on_surface(face: CadFace, uv: Floats, inside: Floats) -> tuple[Floats, Floats]:
    points, along_u, along_v = face.evaluate(uv[:, 0], uv[:, 1])
    normals = np.cross(along_u, along_v)
    length = np.linalg.norm(normals, axis=1)
    pole = np.flatnonzero(length <= 1e-9 * face.stretch)
    if len(pole):
        nearby = uv[pole] + 1e-4 * (inside[pole] - uv[pole])
        _, along_u, along_v = face.evaluate(nearby[:, 0], nearby[:, 1])
        normals[pole] = np.cross(along_u, along_v)
        length[pole] = np.linalg.norm(normals[pole], axis=1)
    return points, normals * (face.sign / np.maximum(length, np.finfo(float).tiny))[:, None]


def load_cad(path: str | os.PathLike[str], *, deflection: float | None = None) -> CadPart:
    """Read a STEP, IGES or BREP file, told apart by content.

    Parameters
    ----------
    path : path
        The file. STEP and IGES are converted to millimetres; BREP carries no unit and is taken as millimetres, with a note.
    deflection : float, optional
        Largest distance of the triangles to the surface, in millimetres; default 1/3000 of the square root of the area.

    Raises
    ------
    InputError
        If the file is missing, empty, of another kind, damaged, or holds no faces.
    """
    path = Path(path)
    kind = _kind_of(path)
    shape = _read_brep(path) if kind == "BREP" else _read_exchange(path, kind)
    notes = ("The BREP format carries no unit; millimetres are assumed.",) if kind == "BREP" else ()
    return tessellate(shape, deflection=deflection, source=str(path), notes=notes)


def tessellate(
    shape: Any, *, deflection: float | None = None, least: float | None = None, source: str = "shape", notes: tuple[str, ...] = ()
) -> CadPart:
    """Make a `CadPart` of a ``TopoDS_Shape`` (solids, shells, faces or any compound of them); no triangle is made smaller than `least`.

    Raises
    ------
    InputError
        If the shape holds no faces, or none that can be tessellated.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_Parameters
    from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID

    path = None if source == "shape" else source
    topo_faces = [] if shape is None or shape.IsNull() else _faces_of(shape)
    if not topo_faces:
        raise InputError("It holds no faces, so there is no surface to work on.", path=path)
    if deflection is None:
        deflection = _DEFLECTION * float(np.sqrt(_area_of(shape)))
    # A finer mesh that another call left on the shape is used as it is.
    if least is None:
        BRepMesh_IncrementalMesh(shape, max(deflection, 1e-7), False, _ANGLE, True)
    else:
        # Without a least size a wrinkle, however small, is meshed until its angles are small.
        how = IMeshTools_Parameters()
        how.Deflection, how.MinSize = max(deflection, 1e-7), least
        how.Angle, how.InParallel = _ANGLE, True
        BRepMesh_IncrementalMesh(shape, how)
    of_solids = _map_of(shape, TopAbs_SOLID, TopAbs_FACE)
    faces, pieces = [], []
    for index, topo in enumerate(topo_faces):
        adaptor = BRepAdaptor_Surface(topo)
        sign = -1.0 if topo.Orientation() == TopAbs_REVERSED else 1.0
        corners, uv = _triangles_of(topo, reverse=sign < 0)
        evaluate = evaluator(adaptor)
        face = CadFace(adaptor.GetType().name.removeprefix("GeomAbs_"), sign, of_solids.Contains(topo), _stretch(evaluate, uv), evaluate)
        _, normals = _on_surface(face, uv.reshape(-1, 2), np.repeat(uv.mean(axis=1), 3, axis=0))
        faces.append(face)
        pieces.append((corners, uv, normals.reshape(-1, 3, 3), np.full(len(corners), index, np.int32)))
    corners, uv, normals, owner = (np.concatenate(part) for part in zip(*pieces, strict=True))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = area > 1e-14 * area.sum()
    if not kept.any():
        raise InputError("None of its faces could be tessellated.", path=path)
    return CadPart(shape, tuple(faces), corners[kept], uv[kept], normals[kept], owner[kept], deflection, source=source, notes=notes)


def _stretch(evaluate: Evaluator, uv: Floats) -> float:
    if len(uv) == 0:
        return 0.0
    u, v = uv.mean(axis=1).T
    _, along_u, along_v = evaluate(np.ascontiguousarray(u), np.ascontiguousarray(v))
    return float(np.median(np.linalg.norm(np.cross(along_u, along_v), axis=1)))


def _kind_of(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
    except OSError as error:
        raise InputError(f"The file cannot be read: {error.strerror or error}.", path=path) from error
    if not head.strip():
        raise InputError("The file is empty.", path=path)
    if b"ISO-10303-21" in head:
        return "STEP"
    if b"CASCADE Topology" in head or b"DBRep_DrawableShape" in head:
        return "BREP"
    first = head.splitlines()[0]
    if len(first) >= 73 and first[72:73] in b"SC":
        return "IGES"
    raise InputError("The file is none of STEP, IGES and BREP, the CAD formats that can be read.", path=path)


def _read_exchange(path: Path, kind: str) -> Any:
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static

    if kind == "STEP":
        from OCP.STEPControl import STEPControl_Reader as Reader
    else:
        from OCP.IGESControl import IGESControl_Reader as Reader
    with _damage(path, kind), EXPORT_LOCK:
        silence()
        reader = Reader()
        # The unit that lengths are turned into is the kernel's for the whole process, and writers leave theirs.
        Interface_Static.SetCVal_s("xstep.cascade.unit", UNIT_NAMES["mm"])
        if reader.ReadFile(str(path)) != IFSelect_RetDone:
            raise InputError(f"The {kind} file is damaged or incomplete.", path=path)
        reader.TransferRoots()
        return reader.OneShape()


def _read_brep(path: Path) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    with _damage(path, "BREP"):
        silence()
        if not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
            raise InputError("The BREP file is damaged or incomplete.", path=path)
    return shape


@contextmanager
def _damage(path: Path, kind: str) -> Iterator[None]:
    """Turn what the kernel raises on a damaged file into an error about that file."""
    try:
        with kernel_errors("read it"):
            yield
    except KernelError as error:
        raise InputError(f"The {kind} file is damaged: {error}", path=path) from error


def _faces_of(shape: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    found = _map_of(shape, None, TopAbs_FACE)
    return [TopoDS.Face(found.FindKey(i + 1)) for i in range(found.Extent())]


def _map_of(shape: Any, owner: Any, kind: Any) -> Any:
    """Return the distinct sub-shapes of a kind, in the model's order; only those of owners of another kind, if one is given."""
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
    from OCP.TopExp import TopExp

    owners, found = ShapeMap(), ShapeMap()
    if owner is None:
        TopExp.MapShapes_s(shape, kind, found)
        return found
    TopExp.MapShapes_s(shape, owner, owners)
    for i in range(owners.Extent()):
        TopExp.MapShapes_s(owners.FindKey(i + 1), kind, found)
    return found


def _area_of(shape: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties)
    return abs(properties.Mass())


def _triangles_of(face: Any, *, reverse: bool) -> tuple[Floats, Floats]:
    """Return corners (T, 3, 3) and parameters (T, 3, 2) of a face's triangles; none where it could not be meshed."""
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None or not mesh.HasUVNodes():
        return np.empty((0, 3, 3)), np.empty((0, 3, 2))
    move = location.Transformation()
    count = mesh.NbNodes()
    nodes, parameters = np.empty((count, 3)), np.empty((count, 2))
    for k in range(count):
        point, uv = mesh.Node(k + 1).Transformed(move), mesh.UVNode(k + 1)
        nodes[k] = point.X(), point.Y(), point.Z()
        parameters[k] = uv.X(), uv.Y()
    index = np.array([mesh.Triangle(k + 1).Get() for k in range(mesh.NbTriangles())], dtype=np.int64).reshape(-1, 3) - 1
    if reverse:
        index = index[:, ::-1]
    return nodes[index], parameters[index]
