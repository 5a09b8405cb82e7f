"""Whether shapes are still valid in a file: STEP keeps no tolerances, and who reads it mends what only they held together."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from scan2nurbs.brep.check import is_valid, is_valid_meshed
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.brep.read import read_shape
from scan2nurbs.brep.step import write_step
from scan2nurbs.errors import InputError


def endures(shape: Any) -> bool:
    """Tell whether a shape is valid, also with triangles, once it was written to a STEP file and read again.

    Parameters
    ----------
    shape : TopoDS_Shape
        In kernel units.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.step"
        try:
            write_step(path, shape, [], unit="mm", kernel_unit="mm", name="shape", schema="AP242")
            found = read_shape(path)
        except (KernelError, InputError):
            return False
        return is_valid(found) and is_valid_meshed(found, every=False)
