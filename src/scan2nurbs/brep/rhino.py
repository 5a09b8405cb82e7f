"""3DM: whole B-spline surfaces with their trimming curves beside them."""

from __future__ import annotations

import base64
import struct
import uuid
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.curve import Curve
from scan2nurbs.brep.edges import FaceEdge
from scan2nurbs.brep.header import AUTHOR, time_stamp
from scan2nurbs.errors import MissingExtraError
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

UNIT_NAMES = {"mm": "Millimeters", "cm": "Centimeters", "m": "Meters", "um": "Microns", "in": "Inches", "ft": "Feet"}
UNTRIMMED = "3DM holds whole, untrimmed surfaces; their trimming curves are written beside them as curves in space."

_HISTORY = struct.pack("<I", 0x20008021)
_HISTORY_SIZE = 77
_VERSION = 7


def write_3dm(path: Path, faces: Sequence[tuple[str, BSplineSurface, Sequence[Sequence[FaceEdge]]]], *, unit: str, offset: Floats) -> None:
    """Write surfaces and the curves of their wires, in their own numbers plus `offset`, as a Rhino 7 file.

    Parameters
    ----------
    path : Path
        Is overwritten.
    faces : sequence of (name, BSplineSurface, wires)
        Curves are called after their face.
    unit : str
        A key of `UNIT_NAMES`, the file's model unit.
    offset : (3,) float64
        Added to all points.

    Raises
    ------
    MissingExtraError
        If rhino3dm is not installed.
    """
    try:
        import rhino3dm

        rhino: Any = rhino3dm  # its type hints lag behind what it can do
    except ImportError as error:
        raise MissingExtraError("Writing 3DM", "rhino", path=path) from error
    model = rhino.File3dm()
    model.ApplicationName = AUTHOR
    model.Settings.ModelUnitSystem = getattr(rhino.UnitSystem, UNIT_NAMES[unit])
    layer = rhino.Layer()
    layer.Name, layer.Id = AUTHOR, _identity("layer")
    model.Layers.Add(layer)

    def add(name: str, geometry: Any) -> None:
        attributes = rhino.ObjectAttributes()
        attributes.Name, attributes.Id, attributes.LayerIndex = name, _identity(name), 0
        model.Objects.Add(geometry, attributes)

    for name, surface, wires in faces:
        add(name, _surface(rhino, surface, offset))
        curves = [edge.space or _side_curve(surface, edge) for wire in wires for edge in wire if edge.seam is None or edge.forward]
        for k, curve in enumerate(curves, start=1):
            add(f"{name}_trim_{k}", _curve(rhino, curve, offset))
    options = rhino.File3dmWriteOptions()
    options.Version = _VERSION
    # Unlike Write, Encode puts no path into the file.
    path.write_bytes(_with_fixed_time(base64.b64decode(model.Encode(options))))


def _identity(name: str) -> uuid.UUID:
    return uuid.uuid5(uuid.NAMESPACE_DNS, f"{AUTHOR}/{name}")


def _surface(rhino: Any, surface: BSplineSurface, offset: Floats) -> Any:
    n_u, n_v = surface.weights.shape
    rational = bool((surface.weights != surface.weights[0, 0]).any())
    p, q = surface.degrees
    made = rhino.NurbsSurface.Create(3, rational, p + 1, q + 1, n_u, n_v)
    # Rhino leaves out the first and the last knot, which change nothing.
    for target, knots in ((made.KnotsU, surface.knots[0]), (made.KnotsV, surface.knots[1])):
        for k, knot in enumerate(knots[1:-1].tolist()):
            target[k] = knot
    points = (surface.control_points + offset) * surface.weights[..., None]
    for i in range(n_u):
        for j in range(n_v):
            w = float(surface.weights[i, j])
            x, y, z = (points[i, j] if rational else points[i, j] / w).tolist()
            made.Points[i, j] = rhino.Point4d(x, y, z, w if rational else 1.0)
    return made


def _curve(rhino: Any, curve: Curve, offset: Floats) -> Any:
    made = rhino.NurbsCurve(3, False, curve.degree + 1, len(curve.control_points))
    for k, knot in enumerate(curve.knots[1:-1].tolist()):
        made.Knots[k] = knot
    for k, (x, y, z) in enumerate((curve.control_points + offset).tolist()):
        made.Points[k] = rhino.Point4d(x, y, z, 1.0)
    return made


def _side_curve(surface: BSplineSurface, edge: FaceEdge) -> Curve:
    """Return an edge on a side of the surface as a polyline, a point every sixteenth of a knot span."""
    low, high = edge.pcurve.domain
    knots = surface.knots[1 - edge.side[0]] if edge.side else np.empty(0)
    inner = knots[(knots > low) & (knots < high)]
    parameters = Curve(1, np.r_[low, low, np.unique(inner), high, high], np.empty((0, 2))).samples(16)
    points = surface.evaluate(np.clip(edge.pcurve(parameters), *np.array(surface.domain).T))
    return Curve(1, np.r_[low, parameters, high], points)


def _with_fixed_time(data: bytes) -> bytes:
    """Set the times of creation and last change, which rhino3dm takes from the clock, in the file's revision history.

    The chunk is: typecode, int64 length, version byte, name of the author, time, name of the last editor, time, count, CRC-32. A time
    is eight int32, a C struct tm; both names are empty, four zero bytes.
    """
    begin = data.find(_HISTORY)
    (length,) = struct.unpack_from("<q", data, begin + 4) if begin >= 0 else (0,)
    body = bytearray(data[begin + 12 : begin + 8 + length])
    if len(body) != _HISTORY_SIZE or any(body[1:5]) or any(body[37:41]):
        return data  # another version of the format: its times are the clock's
    at = time_stamp()
    weekday, year_day = (at.weekday() + 1) % 7, at.timetuple().tm_yday - 1
    for start in (5, 41):
        struct.pack_into("<8i", body, start, at.second, at.minute, at.hour, at.day, at.month - 1, at.year - 1900, weekday, year_day)
    return data[: begin + 12] + bytes(body) + struct.pack("<I", zlib.crc32(body)) + data[begin + 8 + length + 4 :]
