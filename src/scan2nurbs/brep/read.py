"""Reading a written model back: its surfaces as arrays, its loops as points."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.header import UNIT_NAMES
from scan2nurbs.brep.occ import EXPORT_LOCK, from_surface, kernel_errors, silence
from scan2nurbs.errors import InputError
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ReadFace:
    """One face of a file.

    Attributes
    ----------
    surface : BSplineSurface
        What lies under it.
    loops : tuple of (K, 3) float64
        Points of its wires in space, in order; the first is not repeated.
    """

    surface: BSplineSurface
    loops: tuple[Floats, ...]


@dataclass(frozen=True)
class ReadModel:
    """What a STEP, IGES or BREP file holds.

    Attributes
    ----------
    shape : TopoDS_Shape
        In the unit asked for; a BREP file's own numbers.
    faces : tuple of ReadFace
        In the order of the file.
    """

    shape: Any
    faces: tuple[ReadFace, ...]


def read_back(path: str | os.PathLike[str], *, unit: str = "mm", per_edge: int = 32) -> ReadModel:
    """Read a model of B-spline faces.

    Parameters
    ----------
    path : path
        A .step, .stp, .iges, .igs or .brep file.
    unit : str
        What lengths shall be in, a key of `scan2nurbs.cloud.UNITS`; a BREP file has no unit and keeps its numbers.
    per_edge : int
        Points taken of every edge.

    Raises
    ------
    InputError
        If the file is none of these, cannot be read, holds nothing, or a surface of it cannot be written as a B-spline.
    """
    shape = read_shape(Path(path), unit=unit)
    return ReadModel(shape, tuple(_face(face, per_edge) for face in faces_of(shape)))


def read_shape(path: Path, *, unit: str = "mm") -> Any:
    """Return the file's ``TopoDS_Shape``, its lengths in `unit` where the format has one."""
    silence()
    suffix = path.suffix.lower()
    if suffix not in (".step", ".stp", ".iges", ".igs", ".brep"):
        raise InputError(f"A model can be read from STEP, IGES and BREP, not from {suffix or 'a file without suffix'}.", path=path)
    if not path.is_file():
        raise InputError("There is no such file.", path=path)
    with EXPORT_LOCK, kernel_errors(f"read {path.name}"):
        shape = _read_brep(path) if suffix == ".brep" else _read_exchange(path, suffix, unit)
    if shape is None or shape.IsNull():
        raise InputError("The file holds no shape.", path=path)
    return shape


def faces_of(shape: Any) -> list[Any]:
    """Return the faces of a shape in the order in which the kernel finds them."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    found, explorer = [], TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        found.append(TopoDS.Face(explorer.Current()))
        explorer.Next()
    return found


def _read_brep(path: Path) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    if not BRepTools.Read_s(shape, str(path), BRep_Builder()):
        raise InputError("This is no BREP file.", path=path)
    return shape


def _read_exchange(path: Path, suffix: str, unit: str) -> Any:
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.IGESControl import IGESControl_Reader
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader() if suffix in (".step", ".stp") else IGESControl_Reader()
    Interface_Static.SetCVal_s("xstep.cascade.unit", UNIT_NAMES[unit])
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError("The file could not be read.", path=path)
    reader.TransferRoots()
    return reader.OneShape() if reader.NbShapes() else None


def _face(face: Any, per_edge: int) -> ReadFace:
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_BSplineSurface
    from OCP.GeomConvert import GeomConvert
    from OCP.TopAbs import TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    with kernel_errors("read a face"):
        surface = BRep_Tool.Surface_s(face)  # its location applied
        if not isinstance(surface, Geom_BSplineSurface):
            surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
        loops, explorer = [], TopExp_Explorer(face, TopAbs_WIRE)
        while explorer.More():
            loops.append(_loop(TopoDS.Wire(explorer.Current()), face, per_edge))
            explorer.Next()
        return ReadFace(from_surface(surface), tuple(loops))


def _loop(wire: Any, face: Any, per_edge: int) -> Floats:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepTools import BRepTools_WireExplorer
    from OCP.TopAbs import TopAbs_REVERSED

    points: list[tuple[float, float, float]] = []
    explorer = BRepTools_WireExplorer(wire, face)
    while explorer.More():
        edge = explorer.Current()
        if not BRep_Tool.Degenerated_s(edge):
            curve = BRepAdaptor_Curve(edge)
            steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), per_edge + 1)
            if edge.Orientation() == TopAbs_REVERSED:
                steps = steps[::-1]
            points += [(p.X(), p.Y(), p.Z()) for p in map(curve.Value, steps[:-1].tolist())]
        explorer.Next()
    return np.array(points).reshape(-1, 3)
