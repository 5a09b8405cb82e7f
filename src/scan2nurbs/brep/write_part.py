"""Whole parts in model files: named and coloured faces, read back and compared before a file gets its name."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.check import ModelCheck, check
from scan2nurbs.brep.header import plain
from scan2nurbs.brep.iges import write_iges
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.occ import KernelError, from_surface, kernel_errors
from scan2nurbs.brep.part import PartModel
from scan2nurbs.brep.part_mesh import face_rows
from scan2nurbs.brep.read import faces_of, read_shape
from scan2nurbs.brep.rhino import UNTRIMMED, write_3dm
from scan2nurbs.brep.step import write_step
from scan2nurbs.brep.write import FAR, MESH_WRITERS, WrittenModel, checked_format, kernel_unit, read_again, write_brep
from scan2nurbs.cloud import UNITS
from scan2nurbs.io.atomic import atomic_path

Floats = NDArray[np.float64]
Colour = tuple[float, float, float]

COLOURS: dict[str, Colour] = {
    "plane": (0.62, 0.72, 0.82),
    "cylinder": (0.93, 0.69, 0.40),
    "cone": (0.85, 0.80, 0.42),
    "sphere": (0.80, 0.52, 0.62),
    "torus": (0.60, 0.76, 0.50),
    "extrusion": (0.55, 0.70, 0.70),
    "revolution": (0.70, 0.60, 0.80),
    "bspline": (0.85, 0.60, 0.55),
}
"""Colours of faces by the kind of their surface, red, green and blue in [0, 1]."""

_AREA = 2e-3
_DEFLECTION = 1e-3


def write_part(
    path: str | os.PathLike[str],
    part: PartModel,
    *,
    unit: str,
    name: str = "scan2nurbs",
    schema: str = "AP242",
    origin: ArrayLike = (0.0, 0.0, 0.0),
    deflection: float | None = None,
    names: Sequence[str] | None = None,
    colours: Sequence[Colour] | None = None,
) -> WrittenModel:
    """Write a whole part as a CAD model or a mesh.

    Parameters
    ----------
    path : path
        The suffix chooses the format: a key of `scan2nurbs.brep.write.FORMATS`.
    part : PartModel
    unit : str
        The unit of the cloud, and of STEP, IGES and 3DM files.
    name : str
        The product's name.
    schema : {"AP242", "AP214"}
        Of STEP.
    origin : (3,) array-like
        Added to all coordinates, in `unit`.
    deflection : float, optional
        Largest distance of a mesh from the faces, in `unit`; a thousandth of the extent by default.
    names : sequence of str, optional
        Of each face of the part, for formats that have names; by default kind and place in the part, such as "cylinder_3".
    colours : sequence of (red, green, blue), optional
        Of each face of the part, in [0, 1], for STEP; by default those of `COLOURS`.

    Raises
    ------
    ParameterError
        If the suffix, the unit or the schema is unknown, or a number is not finite.
    OutputError
        If the file cannot be written.
    InputError
        If what was written cannot be read back.
    KernelError
        If the CAD kernel refuses.
    MissingExtraError
        If 3DM is asked for and rhino3dm is not installed.

    Notes
    -----
    STEP, IGES and BREP files are read back before they get their name; the notes say how what is read differs from what was written.
    The same part gives the same bytes.
    """
    offset = np.asarray(origin, np.float64)
    form = checked_format(Path(path), unit, schema, offset, deflection)
    furthest = float(np.abs(_box(part.shape) / part.kernel_scale + offset).max())
    inside = {"STEP": kernel_unit(furthest, unit), "IGES": "mm"}.get(form, unit)
    scale = UNITS[unit] / UNITS[inside]
    whole = _moved(part.shape, scale / part.kernel_scale, offset * scale)
    faces = _named(part, whole, names or [f"{face.kind}_{row}" for row, face in enumerate(part.faces)])
    model = check(whole)
    model = replace(model, closed=model.closed and part.joined)
    if form in MESH_WRITERS or form == "3DM":
        return WrittenModel(Path(path), form, unit, model, _write_plain(path, form, whole, faces, unit, deflection))
    by_kind = colours or [COLOURS.get(face.kind, (0.7, 0.7, 0.7)) for face in part.faces]
    with atomic_path(path) as temporary:
        if form == "STEP":
            named = [(label, face) for label, _, face in faces]
            painted = [by_kind[row] for _, row, _ in faces]
            write_step(temporary, whole, named, unit=unit, kernel_unit=inside, name=plain(name), schema=schema, colours=painted)
        elif form == "IGES":
            write_iges(temporary, whole, unit=unit, name=plain(name))
        else:
            write_brep(temporary, whole)
        with read_again(path):
            notes = _differences(temporary, model, form, inside)
    if not model.valid:
        notes.append("The CAD kernel's own check finds the model invalid.")
    if form == "STEP" and inside != "mm":
        notes.append(FAR.format(unit))
    return WrittenModel(Path(path), form, inside, model, tuple(notes))


def _box(shape: Any) -> Floats:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    low, high = box.CornerMin(), box.CornerMax()
    return np.array([[low.X(), low.Y(), low.Z()], [high.X(), high.Y(), high.Z()]])


def _moved(shape: Any, factor: float, offset: Floats) -> Any:
    """Return a copy of a shape, scaled and then moved, by its geometry rather than by a placement."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec

    if factor == 1.0 and not offset.any():
        return shape
    with kernel_errors("move the model"):
        scaling, moving = gp_Trsf(), gp_Trsf()
        scaling.SetScale(gp_Pnt(0.0, 0.0, 0.0), factor)
        moving.SetTranslation(gp_Vec(*offset.tolist()))
        return BRepBuilderAPI_Transform(shape, moving.Multiplied(scaling), True).Shape()


def _named(part: PartModel, whole: Any, names: Sequence[str]) -> list[tuple[str, int, Any]]:
    """Return the faces of the moved shape with their names and their rows in the part."""
    rows = face_rows(part)
    return [(names[row], row, face) for row, face in zip(rows, faces_of(whole), strict=True)]


def _differences(path: Path, expected: ModelCheck, form: str, unit: str) -> list[str]:
    """Read a file back and say how it differs from what was to be written, and what its format could not hold.

    Raises
    ------
    InputError
        If it cannot be read, or holds no face.
    """
    found = check(read_shape(path, unit=unit))
    said = []
    if found.n_faces != expected.n_faces:
        said.append(f"{found.n_faces} faces instead of {expected.n_faces}")
    area, before = rough_area(found.shape), rough_area(expected.shape)
    if abs(area - before) > _AREA * before:
        said.append(f"an area of {area:.5g} instead of {before:.5g} {unit}²")
    # IGES does not say that two edges are one, nor how wide the gaps may be that its curves bridge.
    if form != "IGES" and expected.closed and not found.closed:
        said.append("open borders")
    notes = [f"A reader of the file finds {', '.join(said)}: a face at a wide gap is understood differently."] if said else []
    if form == "IGES":
        notes.append("IGES holds neither shared edges nor tolerances: a reader may have to sew the faces.")
    elif expected.valid and not found.valid:
        notes.append("The CAD kernel's check finds the model invalid once it is read back.")
    return notes


def _write_plain(
    path: str | os.PathLike[str], form: str, whole: Any, faces: list[tuple[str, int, Any]], unit: str, deflection: float | None
) -> tuple[str, ...]:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    if form == "3DM":
        with atomic_path(path) as temporary:
            write_3dm(temporary, [(label, _as_spline(face), ()) for label, _, face in faces], unit=unit, offset=np.zeros(3))
        return (UNTRIMMED,)
    low, high = _box(whole)
    deflection = _DEFLECTION * float(np.linalg.norm(high - low)) if deflection is None else deflection
    notes = [f"The mesh lies within {deflection:.3g} {unit} of the faces."]
    # Of a copy: triangles that were left on the part, finer or coarser ones, would be taken as they are.
    mesh = tessellate(BRepBuilderAPI_Copy(whole).Shape(), deflection=deflection)
    offset = np.zeros(3)
    # Single precision has 24 bits: far from zero, a mesh in STL would turn into steps.
    if form == "STL" and float(np.abs([low, high]).max()) * 2.0**-24 > 0.1 * deflection:
        offset = 0.5 * (low + high)
        notes.append(f"STL is too coarse for coordinates this large: it is written about the point {offset.tolist()}.")
    pieces = []
    for k, (label, _, _) in enumerate(faces):
        points, triangles = np.unique(mesh.corners[mesh.face == k].reshape(-1, 3), axis=0, return_inverse=True)
        pieces.append((label, points - offset, triangles.reshape(-1, 3)))
    with atomic_path(path) as temporary:
        MESH_WRITERS[form](temporary, pieces)
    return tuple(notes)


def _as_spline(face: Any) -> Any:
    """Return the part of a face's surface that its outline spans, as a B-spline surface."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepTools import BRepTools
    from OCP.Geom import Geom_RectangularTrimmedSurface
    from OCP.GeomConvert import GeomConvert

    with kernel_errors("turn a surface into a B-spline"):
        bounds = BRepTools.UVBounds_s(face)
        if bounds is None:
            raise KernelError("The CAD kernel could not measure a face.")
        return from_surface(GeomConvert.SurfaceToBSplineSurface_s(Geom_RectangularTrimmedSurface(BRep_Tool.Surface_s(face), *bounds)))
