"""STEP: AP242 and AP214."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scan2nurbs.brep.header import AUTHOR, UNIT_NAMES, system, time_stamp
from scan2nurbs.brep.occ import EXPORT_LOCK, KernelError, kernel_errors, silence

SCHEMAS = {"AP242": "AP242DIS", "AP214": "AP214IS"}
_ZEROS = re.compile(rb"(\.[0-9]*?)0+(?=[E,)\s;])")


Colour = tuple[float, float, float]


def write_step(
    path: Path,
    shape: Any,
    faces: Sequence[tuple[str, Any]],
    *,
    unit: str,
    kernel_unit: str,
    name: str,
    schema: str,
    colours: Sequence[Colour] | None = None,
) -> None:
    """Write a shape whose numbers are in `kernel_unit` as a STEP file in `unit`.

    Parameters
    ----------
    path : Path
        Is overwritten.
    shape : TopoDS_Shape
        Faces, shells, solids, or a compound of them.
    faces : sequence of (name, TopoDS_Face)
        The faces of the shape and how they are called in the file.
    unit, kernel_unit, name, schema : str
        Two keys of `UNIT_NAMES`; the product's name, in ASCII; a key of `SCHEMAS`.
    colours : sequence of (red, green, blue), optional
        Of each face, in [0, 1], as the screen shows them (sRGB).

    Raises
    ------
    KernelError
        If the kernel cannot translate the shape.
    """
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.STEPConstruct import STEPConstruct
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
    from OCP.TCollection import TCollection_HAsciiString

    silence()
    with EXPORT_LOCK, kernel_errors("write STEP"):
        document = STEPCAFControl_Writer()  # the settings below exist only once a writer does
        writer = document.ChangeWriter() if colours else STEPControl_Writer()
        Interface_Static.SetCVal_s("xstep.cascade.unit", UNIT_NAMES[kernel_unit])
        Interface_Static.SetCVal_s("write.step.unit", UNIT_NAMES[unit])
        Interface_Static.SetCVal_s("write.step.schema", SCHEMAS[schema])
        Interface_Static.SetIVal_s("write.step.assembly", 0)
        if colours:
            painted = _painted(shape, [face for _, face in faces], colours)
            if not document.Transfer(painted, STEPControl_StepModelType.STEPControl_AsIs):
                raise KernelError("The CAD kernel could not translate the shape to STEP.")
        else:
            _expect_done(writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs), "translate the shape to STEP")
        finder = writer.WS().TransferWriter().FinderProcess()
        for face_name, face in faces:
            entity = STEPConstruct.FindEntity_s(finder, face)
            if entity is not None:
                entity.SetName(TCollection_HAsciiString(face_name))
        model = writer.Model()
        _set_product(model, name)
        _set_header(model, name)
        path.write_bytes(_as_text(model, writer.WS().Protocol()))


def _painted(shape: Any, faces: Sequence[Any], colours: Sequence[Colour]) -> Any:
    """Return a document that holds a shape and the colours of its faces."""
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
    shape_tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colour_tool = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    label = shape_tool.AddShape(shape, False)
    for face, colour in zip(faces, colours, strict=True):
        made = Quantity_Color(*colour, Quantity_TypeOfColor.Quantity_TOC_sRGB)
        colour_tool.SetColor(shape_tool.AddSubShape(label, face), made, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    return document


def _set_product(model: Any, name: str) -> None:
    """Name the product; the kernel would number the products of one process."""
    from OCP.StepBasic import StepBasic_Product
    from OCP.TCollection import TCollection_HAsciiString

    for k in range(1, model.NbEntities() + 1):
        entity = model.Value(k)
        if isinstance(entity, StepBasic_Product):
            entity.SetName(TCollection_HAsciiString(name))
            entity.SetId(TCollection_HAsciiString(name))


def _set_header(model: Any, name: str) -> None:
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(value)

    header = APIHeaderSection_MakeHeader(model)
    header.SetName(text(name))
    header.SetTimeStamp(text(time_stamp().strftime("%Y-%m-%dT%H:%M:%S")))
    header.SetAuthorValue(1, text(AUTHOR))
    header.SetOrganizationValue(1, text(AUTHOR))
    header.SetOriginatingSystem(text(system()))
    header.SetPreprocessorVersion(text(system()))
    header.SetAuthorisation(text(""))
    header.SetDescriptionValue(1, text("Surfaces from a scan"))


def _as_text(model: Any, protocol: Any) -> bytes:
    """Return the file's bytes, with the digits that double precision has; the kernel's own default of 13 loses at large coordinates."""
    from OCP.StepData import StepData_StepWriter

    writer = StepData_StepWriter(model)
    writer.FloatWriter().SetFormat("%.15E", True)
    writer.FloatWriter().SetFormatForRange("%.13f", 0.1, 1000.0)
    writer.SendModel(protocol, False)
    stream = io.BytesIO()
    if not writer.Print(stream):
        raise KernelError("The CAD kernel could not print the STEP file.")
    return _without_trailing_zeros(stream.getvalue())


def _without_trailing_zeros(text: bytes) -> bytes:
    """Shorten the numbers of a STEP file, outside its strings. The kernel's own way of doing so drops digits, too."""
    parts = text.split(b"'")
    parts[::2] = [_ZEROS.sub(rb"\1", part) for part in parts[::2]]
    return b"'".join(parts)


def _expect_done(status: Any, what: str) -> None:
    from OCP.IFSelect import IFSelect_ReturnStatus

    if status != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise KernelError(f"The CAD kernel could not {what}: {status}.")
