"""Write the example parts as STEP files: ``python -m examples.parts.make_parts FOLDER [NAME ...]`` from the root of the checkout."""

from __future__ import annotations

import sys
from pathlib import Path

from examples.parts import PARTS, WHOLE
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

from scan2nurbs.brep.occ import EXPORT_LOCK, silence
from scan2nurbs.errors import OutputError

ALL = {**WHOLE, **PARTS}


def write_parts(folder: str | Path, names: list[str] | None = None) -> list[Path]:
    """Write parts (all without `names`) into a folder, one STEP file each, and return their paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return [_write(ALL[name].build(), folder / f"{name}.step") for name in names or ALL]


def _write(shape: object, path: Path) -> Path:
    with EXPORT_LOCK:
        silence()
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OutputError("The STEP file could not be written.", path=str(path))
    return path


if __name__ == "__main__":
    if len(sys.argv) < 2 or any(name not in ALL for name in sys.argv[2:]):
        sys.exit(f"{__doc__}\nNames: {', '.join(ALL)}")
    for written in write_parts(sys.argv[1], sys.argv[2:] or None):
        print(written)
