"""IGES 5.3: trimmed surfaces (entity 144), which every reader knows."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from scan2nurbs.brep.header import AUTHOR, UNIT_NAMES, system, time_stamp
from scan2nurbs.brep.occ import EXPORT_LOCK, KernelError, kernel_errors, silence


def write_iges(path: Path, shape: Any, *, unit: str, name: str) -> None:
    """Write a shape in millimetres as an IGES file in `unit`. Faces have no names there.

    Raises
    ------
    KernelError
        If the kernel cannot translate the shape.
    """
    from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
    from OCP.Interface import Interface_Static

    silence()
    with EXPORT_LOCK, kernel_errors("write IGES"):
        IGESControl_Controller.Init_s()
        Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
        Interface_Static.SetCVal_s("write.iges.header.product", system())
        writer = IGESControl_Writer("IN" if unit == "in" else UNIT_NAMES[unit], 0)
        if not writer.AddShape(shape):
            raise KernelError("The CAD kernel could not translate the shape to IGES.")
        writer.ComputeModel()
        model = writer.Model()
        _set_header(model, name)
        path.write_bytes(_as_text(model))


def _set_header(model: Any, name: str) -> None:
    from OCP.TCollection import TCollection_HAsciiString

    def text(value: str) -> Any:
        return TCollection_HAsciiString(value)

    header = model.GlobalSection()
    stamp = time_stamp().strftime("%Y%m%d.%H%M%S")
    header.SetFileName(text(name))
    header.SetSendName(text(name))
    header.SetReceiveName(text(name))
    header.SetAuthorName(text(AUTHOR))
    header.SetCompanyName(text(AUTHOR))
    header.SetSystemId(text(system()))
    header.SetInterfaceVersion(text(system()))
    header.SetDate(text(stamp))
    header.SetLastChangeDate(text(stamp))
    model.SetGlobalSection(header)


def _as_text(model: Any) -> bytes:
    from OCP.IGESData import IGESData_IGESWriter
    from OCP.IGESSelect import IGESSelect_WorkLibrary

    writer = IGESData_IGESWriter(model)
    writer.FloatWriter().SetFormat("%.15E", True)
    writer.FloatWriter().SetFormatForRange("%.13f", 0.1, 1000.0)
    writer.SendModel(IGESSelect_WorkLibrary.DefineProtocol_s())
    stream = io.BytesIO()
    if not writer.Print(stream):
        raise KernelError("The CAD kernel could not print the IGES file.")
    return stream.getvalue()
