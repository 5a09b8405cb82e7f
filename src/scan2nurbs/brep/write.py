"""Model files: one call, the format by the file's suffix, whole and checked or not at all."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scan2nurbs.brep import mesh
from scan2nurbs.brep.build import build_face, natural_face
from scan2nurbs.brep.check import ModelCheck, check
from scan2nurbs.brep.face import TrimmedFace
from scan2nurbs.brep.header import plain
from scan2nurbs.brep.iges import write_iges
from scan2nurbs.brep.occ import CONFUSION, KernelError, kernel_errors
from scan2nurbs.brep.rhino import UNTRIMMED, write_3dm
from scan2nurbs.brep.solids import compound
from scan2nurbs.brep.step import SCHEMAS, write_step
from scan2nurbs.brep.tessellate import tessellate_face
from scan2nurbs.brep.verify import differences
from scan2nurbs.cloud import UNITS
from scan2nurbs.errors import InputError, OutputError, ParameterError
from scan2nurbs.io.atomic import atomic_path

Floats = NDArray[np.float64]

FORMATS = {
    ".step": "STEP",
    ".stp": "STEP",
    ".iges": "IGES",
    ".igs": "IGES",
    ".brep": "BREP",
    ".3dm": "3DM",
    ".stl": "STL",
    ".ply": "PLY",
    ".obj": "OBJ",
}
"""The formats of `write_model` by suffix."""

MESH_WRITERS = {"STL": mesh.write_stl, "PLY": mesh.write_ply, "OBJ": mesh.write_obj}
_DEFLECTION = 1e-3
FAR = "The coordinates lie so far from zero that CAD systems which work in millimetres may lose detail; they are exact in {}."


@dataclass(frozen=True)
class WrittenModel:
    """What was written.

    Attributes
    ----------
    path : Path
        The file.
    format : str
        A value of `FORMATS`.
    unit : str
        The unit of the figures in `model`.
    model : ModelCheck
        The model's analysis as it was written: in `unit`.
    notes : tuple of str
        What the format could not hold, one sentence each.
    """

    path: Path
    format: str
    unit: str
    model: ModelCheck
    notes: tuple[str, ...] = field(default=())


def write_model(
    path: str | os.PathLike[str],
    faces: TrimmedFace | Sequence[TrimmedFace],
    *,
    unit: str,
    name: str = "scan2nurbs",
    schema: str = "AP242",
    origin: ArrayLike = (0.0, 0.0, 0.0),
    deflection: float | None = None,
) -> WrittenModel:
    """Write faces as a CAD model or a mesh.

    Parameters
    ----------
    path : path
        The suffix chooses the format: a key of `FORMATS`.
    faces : TrimmedFace or sequence of them
        Called "bspline_1", "bspline_2", ... in formats that have names.
    unit : str
        The unit of the faces, and of STEP, IGES and 3DM files: a key of `scan2nurbs.cloud.UNITS`. The other formats carry no unit; their
        numbers are in it all the same.
    name : str
        The product's name in the file; what is not ASCII is written as near to it as can be.
    schema : {"AP242", "AP214"}
        Of STEP.
    origin : (3,) array-like
        Added to all coordinates, in `unit`: where the local frame of the faces lies.
    deflection : float, optional
        Largest distance of a mesh from the faces, in `unit`; a thousandth of the extent by default. The notes state it.

    Returns
    -------
    WrittenModel
        With the notes for the user.

    Raises
    ------
    ParameterError
        If the suffix, the unit or the schema is unknown, there are no faces, or a number is not finite.
    OutputError
        If the file cannot be written, or what was written to it does not read back as the same model. There is no file then, or the one
        that was there before.
    KernelError
        If the CAD kernel refuses.
    MissingExtraError
        If 3DM is asked for and rhino3dm is not installed.

    Notes
    -----
    STEP, IGES and BREP files are read back and compared before they get their name. The same faces give the same bytes: time stamps are
    those of SOURCE_DATE_EPOCH, or the beginning of 1970. Author, organisation and system are "scan2nurbs"; no file tells of the user, the
    machine or the path.
    """
    faces = (faces,) if isinstance(faces, TrimmedFace) else tuple(faces)
    offset = np.asarray(origin, np.float64)
    form = checked_format(Path(path), unit, schema, offset, deflection)
    if not faces:
        raise ParameterError("The 'faces' parameter of write_model must hold at least one face. Got none instead.")
    named = [(f"bspline_{k}", face) for k, face in enumerate(faces, start=1)]
    if form in MESH_WRITERS or form == "3DM":
        model = check(compound([face.shape for face in faces]))
        notes = _write_plain(path, form, named, unit, offset, deflection)
        return WrittenModel(Path(path), form, unit, model, notes)
    furthest = max(float(np.abs(face.surface.control_points + offset).max()) for face in faces)
    inside = {"STEP": kernel_unit(furthest, unit), "IGES": "mm"}.get(form, unit)
    scale = UNITS[unit] / UNITS[inside]
    shapes = [(label, _shape(face, scale, offset * scale)) for label, face in named]
    whole = shapes[0][1] if len(shapes) == 1 else compound([shape for _, shape in shapes])
    model = check(whole)
    with atomic_path(path) as temporary:
        if form == "STEP":
            write_step(temporary, whole, shapes, unit=unit, kernel_unit=inside, name=plain(name), schema=schema)
        elif form == "IGES":
            write_iges(temporary, whole, unit=unit, name=plain(name))
        else:
            write_brep(temporary, whole)
        with read_again(path):
            wrong = differences(temporary, [shape for _, shape in shapes], model, unit=inside)
        if wrong:
            raise OutputError(f"The file does not read back as it was written: {'; '.join(wrong)}.", path=os.fspath(path))
    notes = [] if model.valid else ["The CAD kernel's own check finds the model invalid."]
    if form == "STEP" and inside != "mm":
        notes.append(FAR.format(unit))
    return WrittenModel(Path(path), form, inside, model, tuple(notes))


def checked_format(path: Path, unit: str, schema: str, offset: Floats, deflection: float | None) -> str:
    """Return the format of a file that is to be written, if all parameters are in their ranges.

    Raises
    ------
    ParameterError
        If one of them is not.
    """
    form = FORMATS.get(path.suffix.lower())
    if form is None:
        raise ParameterError(f"The suffix of a model must be one of {', '.join(FORMATS)}. Got {path.suffix!r} instead.")
    if unit not in UNITS:
        raise ParameterError(f"The 'unit' of a model must be one of {', '.join(UNITS)}. Got {unit!r} instead.")
    if schema not in SCHEMAS:
        raise ParameterError(f"The 'schema' of a model must be one of {', '.join(SCHEMAS)}. Got {schema!r} instead.")
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise ParameterError(f"The 'origin' of a model must be three finite numbers. Got {offset.tolist()} instead.")
    if deflection is not None and not (np.isfinite(deflection) and deflection > 0):
        raise ParameterError(f"The 'deflection' of a model must be a float in (0, inf). Got {deflection} instead.")
    return form


def kernel_unit(furthest: float, unit: str) -> str:
    """Return the unit in which the kernel's absolute tolerance fits: millimetres, but the file's own for coordinates far from zero."""
    return "mm" if furthest * UNITS[unit] * np.finfo(float).eps <= 0.1 * CONFUSION else unit


def _shape(face: TrimmedFace, scale: float, offset: Floats) -> Any:
    if not face.wires:
        return natural_face(face.surface, scale=scale, offset=offset)
    return build_face(face.surface, face.wires, scale=scale, offset=offset)


@contextmanager
def read_again(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what goes wrong where a file is read that was just written into an error about the file that was asked for."""
    try:
        yield
    except (InputError, KernelError) as error:
        said = error.message if isinstance(error, InputError) else str(error)
        raise OutputError(f"What was written cannot be read again: {said}", path=os.fspath(path)) from error


def write_brep(path: Path, shape: Any) -> None:
    """Write a shape in the kernel's own format."""
    from OCP.BRepTools import BRepTools
    from OCP.TopTools import TopTools_FormatVersion

    with kernel_errors("write BREP"):
        BRepTools.Write_s(shape, str(path), False, False, TopTools_FormatVersion.TopTools_FormatVersion_VERSION_1)


def _write_plain(
    path: str | os.PathLike[str],
    form: str,
    named: Sequence[tuple[str, TrimmedFace]],
    unit: str,
    offset: Floats,
    deflection: float | None,
) -> tuple[str, ...]:
    """Write the formats that do not hold trimmed faces."""
    if form == "3DM":
        with atomic_path(path) as temporary:
            write_3dm(temporary, [(label, face.surface, face.wires) for label, face in named], unit=unit, offset=offset)
        return (UNTRIMMED,)
    points = np.concatenate([face.surface.control_points.reshape(-1, 3) for _, face in named])
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    deflection = _DEFLECTION * extent if deflection is None else deflection
    notes = [f"The mesh lies within {deflection:.3g} {unit} of the faces."]
    # Single precision has 24 bits: far from zero, a mesh in STL would turn into steps.
    if form == "STL" and float(np.abs(points + offset).max()) * 2.0**-24 > 0.1 * deflection:
        notes.append(f"STL is too coarse for coordinates this large: it is written about the origin {offset.tolist()}.")
        offset = np.zeros(3)
    meshes = [(label, tessellate_face(face, deflection=deflection)) for label, face in named]
    with atomic_path(path) as temporary:
        MESH_WRITERS[form](temporary, [(label, part.points + offset, part.triangles) for label, part in meshes])
    return tuple(notes)
