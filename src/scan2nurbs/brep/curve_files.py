"""Curve files: B-spline curves as STEP, IGES or BREP edges, or polylines as PLY or OBJ, by the suffix."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from scan2nurbs.brep.header import plain, system
from scan2nurbs.brep.iges import write_iges
from scan2nurbs.brep.occ import kernel_errors, to_knots, to_points
from scan2nurbs.brep.solids import compound
from scan2nurbs.brep.step import write_step
from scan2nurbs.brep.write import write_brep
from scan2nurbs.cloud import UNITS
from scan2nurbs.errors import ParameterError
from scan2nurbs.io.atomic import atomic_path

Floats = NDArray[np.float64]

CURVES = (".step", ".stp", ".iges", ".igs", ".brep", ".ply", ".obj")
"""Suffixes of files of curves."""

_PLY_EDGE = np.dtype([("vertex1", "<i4"), ("vertex2", "<i4"), ("curve", "<i4")])


@dataclass(frozen=True)
class NamedCurve:
    """A curve to write.

    Attributes
    ----------
    name : str
    spline : scipy.interpolate.BSpline
        Of points in space; periodic or not.
    polyline : (K, 3) float64
        Points along it; the last repeats the first where it is closed.
    """

    name: str
    spline: BSpline
    polyline: Floats


def write_curves(path: str | os.PathLike[str], curves: Sequence[NamedCurve], *, unit: str, name: str = "scan2nurbs") -> None:
    """Write curves in space.

    Parameters
    ----------
    path : path
        The suffix chooses the format: one of `CURVES`. STEP, IGES and BREP hold the B-splines, PLY (vertices, and edges with the number
        of its curve) and OBJ (lines) hold polylines.
    curves : sequence of NamedCurve
        At least one.
    unit : str
        Of the curves, and of STEP and IGES files: a key of `scan2nurbs.cloud.UNITS`.
    name : str
        The product's name in the file.

    Raises
    ------
    ParameterError
        If the suffix or the unit is unknown, or there are no curves.
    OutputError
        If the file cannot be written.
    KernelError
        If the CAD kernel refuses.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in CURVES:
        raise ParameterError(f"The suffix of a file of curves must be one of {', '.join(CURVES)}. Got {suffix!r} instead.")
    if unit not in UNITS:
        raise ParameterError(f"The 'unit' parameter of write_curves must be one of {', '.join(UNITS)}. Got {unit!r} instead.")
    if not curves:
        raise ParameterError("The 'curves' parameter of write_curves must hold at least one curve. Got none instead.")
    with atomic_path(path) as temporary:
        if suffix == ".ply":
            _write_ply(temporary, curves)
        elif suffix == ".obj":
            _write_obj(temporary, curves)
        else:
            scale = UNITS[unit] if suffix != ".brep" else 1.0
            shapes = [(curve.name, _edge(curve.spline, scale)) for curve in curves]
            whole = compound([shape for _, shape in shapes])
            if suffix in (".step", ".stp"):
                write_step(temporary, whole, shapes, unit=unit, kernel_unit="mm", name=plain(name), schema="AP242")
            elif suffix == ".brep":
                write_brep(temporary, whole)
            else:
                write_iges(temporary, whole, unit=unit, name=plain(name))


def clamped(spline: BSpline) -> BSpline:
    """Return a curve over the same domain whose knots are repeated at both ends (The NURBS Book, section 5.2: knot insertion)."""
    k = spline.k
    low, high = spline.t[k], spline.t[len(spline.t) - k - 1]
    open_ = BSpline(spline.t, spline.c, k, extrapolate=False)
    for end in (low, high):
        for _ in range(k - int(np.count_nonzero(open_.t == end))):
            open_ = open_.insert_knot(end)
    first = int(np.searchsorted(open_.t, low, side="right")) - k
    last = int(np.searchsorted(open_.t, high, side="left"))
    # A clamped end has one more knot than an inserted one.
    knots = np.r_[low, open_.t[first : last + k], high]
    return BSpline(knots, open_.c[first - 1 : last], k, extrapolate=False)


def _edge(spline: BSpline, scale: float) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.Geom import Geom_BSplineCurve

    curve = clamped(spline)
    with kernel_errors("make a B-spline curve"):
        return BRepBuilderAPI_MakeEdge(Geom_BSplineCurve(to_points(curve.c * scale), *to_knots(curve.t), curve.k)).Edge()


def _write_ply(path: Path, curves: Sequence[NamedCurve]) -> None:
    points = np.concatenate([curve.polyline for curve in curves])
    edges, first = [], 0
    for number, curve in enumerate(curves):
        pairs = np.empty(len(curve.polyline) - 1, _PLY_EDGE)
        pairs["vertex1"] = first + np.arange(len(pairs))
        pairs["vertex2"], pairs["curve"] = pairs["vertex1"] + 1, number
        edges.append(pairs)
        first += len(curve.polyline)
    joined = np.concatenate(edges)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {system()}\nelement vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element edge {len(joined)}\nproperty int vertex1\nproperty int vertex2\nproperty int curve\nend_header\n"
    )
    path.write_bytes(header.encode("ascii") + points.astype("<f8").tobytes() + joined.tobytes())


def _write_obj(path: Path, curves: Sequence[NamedCurve]) -> None:
    lines, first = [f"# {system()}"], 1
    for curve in curves:
        lines.append(f"o {curve.name}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in curve.polyline.tolist()]
        lines.append("l " + " ".join(str(k) for k in range(first, first + len(curve.polyline))))
        first += len(curve.polyline)
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")
