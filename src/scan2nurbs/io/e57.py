"""E57 (ASTM E2807), the exchange format of terrestrial scanners: all scans of the file in one frame. Its unit is the metre.

Needs the extra ``e57``. The pose of every scan is applied. Points that the scanner marked as invalid keep their rows, as NaN.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError, MissingExtraError
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source

_HEADER = struct.Struct("<8sIIQQQQ")  # signature, version, file length, offset and length of the XML part, page size
_PAGE = 1024
_CHUNK = 1 << 20
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


def read_e57(source: Source) -> Scan:
    """Read the points of all scans of an E57 file.

    Raises
    ------
    MissingExtraError
        If pye57 is not installed.
    InputError
        If the file is truncated or damaged (every page has a checksum), or holds no coordinates.
    """
    if source.packed:
        raise source.fault("E57 inside gzip cannot be read; unpack it first.")
    _check_header(source)
    try:
        from pye57 import libe57  # type: ignore[attr-defined] - compiled  # noqa: PLC0415 - an optional dependency
    except ImportError:
        raise MissingExtraError("Reading E57", "e57", path=source.path) from None
    try:
        image = libe57.ImageFile(str(source.path), "r")
        try:
            return _read_scans(source, libe57, image)
        finally:
            image.close()
    except InputError:
        raise
    except Exception as error:
        # The library's own exception, and whatever its Python binding makes of others; the file is damaged in any case.
        raise source.fault(f"The E57 file is damaged: {str(error).splitlines()[0] if str(error) else error!r}.") from error


def _check_header(source: Source) -> None:
    size = len(source.data)
    if size < _HEADER.size:
        raise source.fault("The E57 file ends within its header.", size)
    _, major, _, length, xml_offset, xml_length, page = _HEADER.unpack(source.data[: _HEADER.size])
    if major != 1 or page != _PAGE:
        raise source.fault(f"E57 version {major} with pages of {page:,} bytes is not known.", 8)
    if length > size:
        raise source.fault(f"The E57 header declares {length:,} bytes, the file ends after {size:,}.", size)
    if xml_offset > size or xml_length > size - xml_offset:
        raise source.fault("The XML part of the E57 file lies behind its end.", 24)
    # Every page ends with four bytes of checksum, which may stand within a word.
    start = xml_offset // _PAGE * _PAGE
    pages = source.data[start : xml_offset + xml_length + xml_length // 255 + _PAGE]
    xml = b"".join(pages[place : place + _PAGE - 4] for place in range(0, len(pages), _PAGE))
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:
        raise source.fault("The XML part of the E57 file declares entities, which no scanner writes.", xml_offset)


def _read_scans(source: Source, libe57: Any, image: Any) -> Scan:
    root = image.root()
    if not root.isDefined("data3D"):
        raise source.fault("The E57 file holds no scans.")
    scans = root["data3D"]
    parts: list[NDArray[np.float64]] = []
    notes: list[str] = []
    for index in range(scans.childCount()):
        node = scans[index]
        points = node["points"]
        if points.childCount() > 8 * len(source.data):
            raise source.fault(f"Scan {index + 1} declares {points.childCount():,} points, more than the file can hold.")
        values, invalid = _read_points(source, libe57, image, points, index)
        values[invalid] = np.nan
        if invalid.any():
            notes.append(f"{np.count_nonzero(invalid):,} points of scan {index + 1} are marked as invalid and kept as empty rows.")
        parts.append(_place(node, values))
    if not sum(map(len, parts)):
        raise source.fault("The E57 file holds no points.")
    if len(parts) > 1:
        notes.insert(0, f"The {len(parts)} scans of the file were put together by their poses.")
    return Scan(np.concatenate(parts), "m", "E57", tuple(notes))


def _read_points(source: Source, libe57: Any, image: Any, points: Any, index: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the points in the frame of their scan, and which of them are marked as invalid."""
    prototype = libe57.StructureNode(points.prototype())
    system = next((names for names in (_CARTESIAN, _SPHERICAL) if all(map(prototype.isDefined, names))), None)
    if system is None:
        raise source.fault(f"Scan {index + 1} of the E57 file has neither cartesian nor spherical coordinates.")
    state = "cartesianInvalidState" if system is _CARTESIAN else "sphericalInvalidState"
    fields = (*system, state) if prototype.isDefined(state) else system
    columns = np.zeros((len(fields), min(_CHUNK, max(1, points.childCount()))))
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in zip(fields, columns, strict=True):
        buffers.append(libe57.SourceDestBuffer(image, name, column, len(column), True, True))
    reader = points.reader(buffers)
    parts, total = [], 0
    try:
        while (count := reader.read()) > 0:
            parts.append(columns[:, :count].copy())
            total += count
    finally:
        reader.close()
    if total < points.childCount():
        raise source.fault(f"Scan {index + 1} declares {points.childCount():,} points, the payload ends after {total:,}.")
    values = np.concatenate(parts, axis=1) if parts else np.empty((len(fields), 0))
    invalid = values[3] != 0 if len(fields) > 3 else np.zeros(total, bool)
    return (values[:3].T.copy() if system is _CARTESIAN else _cartesian(*values[:3])), invalid


def _cartesian(distance: NDArray, azimuth: NDArray, elevation: NDArray) -> NDArray[np.float64]:
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _place(node: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move points from the frame of their scan to the file's: rotate by the unit quaternion, then translate (E2807, 8.4.3)."""
    pose = node["pose"] if node.isDefined("pose") else None
    if pose is not None and pose.isDefined("rotation"):
        w, x, y, z = (pose["rotation"][name].value() for name in "wxyz")
        norm = w * w + x * x + y * y + z * z
        if not np.isfinite(norm) or norm <= 0:
            raise ValueError("the pose of a scan is no rotation")
        s = 2 / norm
        rotation = np.array(
            [
                [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
            ]
        )
        if not np.array_equal(rotation, np.eye(3)):  # multiplying by one would be exact, but only without infinities
            points = points @ rotation.T
    if pose is not None and pose.isDefined("translation"):
        points = points + np.array([pose["translation"][name].value() for name in "xyz"])
    return points
