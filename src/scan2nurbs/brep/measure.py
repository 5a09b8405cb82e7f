"""Area, volume and tolerances of shapes."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import numpy as np

from scan2nurbs.brep.occ import kernel_errors

ACCURACY = 1e-5
"""Relative, of areas and volumes: a hundredth of what noise leaves open, and twice as fast as a millionth."""


def area(shape: Any, accuracy: float | None = ACCURACY) -> float:
    """Return the area of a shape to a relative accuracy, which may take seconds where surfaces are bent; None: see `rough_area`."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    found = GProp_GProps()
    with kernel_errors("measure the shape"):
        BRepGProp.SurfaceProperties_s(shape, found, *([] if accuracy is None else [accuracy]))
    return abs(float(found.Mass()))


def rough_area(shape: Any) -> float:
    """Return the area of a shape at once, and to about a hundredth of it."""
    return area(shape, None)


def volume(shape: Any, accuracy: float | None = ACCURACY) -> float:
    """Return the volume that the faces of a closed shape enclose, negative where they face inward, to a relative accuracy.

    That may take seconds where surfaces are bent; None: see `rough_volume`.
    """
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    found = GProp_GProps()
    with kernel_errors("measure the shape"):
        BRepGProp.VolumeProperties_s(shape, found, *([] if accuracy is None else [accuracy]))
    return float(found.Mass())


def rough_volume(shape: Any) -> float:
    """Return the volume that the faces of a closed shape enclose at once, and to about a hundredth of it; see `volume`."""
    return volume(shape, None)


def tolerance(shape: Any) -> float:
    """Return the largest tolerance of any vertex, edge or face."""
    from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance

    return float(np.float64(ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1)))
