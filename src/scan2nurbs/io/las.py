"""LAS and its packed form LAZ, the formats of airborne scanning (ASPRS LAS 1.0 to 1.4).

Coordinates are integers times a scale plus an offset, computed in float64, so that nothing is lost. The unit is the metre unless the
coordinate system in the file names feet. LAS needs nothing but this module; LAZ needs the extra ``las``.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import MissingExtraError
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source

_CHUNK = 1_000_000
_LAZ_TYPE = 0x80
_LARGEST_LAZ_RATIO = 1000
_LAZ_ITEMS = 34  # where the list of (type, size, version) begins in LASzip's record; before it stands its length
_HEADER = struct.Struct("<24xBB68xHIIBHI")  # version, header size, offset to points, VLRs, format, record length, points
_SCALES = struct.Struct("<6d")
_VLR = struct.Struct("<2x16sHH32x")
_EPSG_UNITS = {9001: "m", 9002: "ft", 9003: "us-ft"}


@dataclass(frozen=True)
class _Header:
    version: tuple[int, int]
    size: int
    offset: int
    n_vlrs: int
    kind: int
    record: int
    count: int
    scales: NDArray[np.float64]
    offsets: NDArray[np.float64]


def read_las(source: Source) -> Scan:
    """Read the points of a LAS or LAZ file.

    Raises
    ------
    MissingExtraError
        If the file is LAZ and laspy is not installed.
    InputError
        If the header is damaged or declares more than the file holds, or the packed points are damaged.
    """
    header = _read_header(source)
    unit, notes = _unit(source, header)
    packed = header.kind >= _LAZ_TYPE
    integers = _unpack_laz(source, header) if packed else _read_integers(source, header)
    points = integers * header.scales
    points += header.offsets
    return Scan(points, unit, f"{'LAZ' if packed else 'LAS'} {header.version[0]}.{header.version[1]}", notes)


def _read_header(source: Source) -> _Header:
    data, size = source.data, len(source.data)
    if size < 227:
        raise source.fault(f"A LAS header has at least 227 bytes, this file {size:,} in all.", size)
    major, minor, header_size, offset, n_vlrs, kind, record, count = _HEADER.unpack(data[: _HEADER.size])
    scales = np.array(_SCALES.unpack(data[131 : 131 + _SCALES.size]))
    if major != 1 or minor > 4:
        raise source.fault(f"LAS version {major}.{minor} is not known.", 24)
    if header_size < 227 or not header_size <= offset <= size:
        raise source.fault(f"The points of the LAS file should begin at byte {offset:,}, which cannot be.", 96)
    if minor == 4 and header_size >= 375:
        count = int.from_bytes(data[247:255], "little") or count
    if not np.isfinite(scales).all() or np.any(scales[:3] == 0):
        raise source.fault("The scales and offsets in the LAS header are no usable numbers.", 131)
    if count == 0:
        raise source.fault("The LAS header declares 0 points.", 107)
    if record < 20:
        raise source.fault(f"A LAS point has at least 20 bytes; the header declares {record}.", 105)
    return _Header((major, minor), header_size, offset, n_vlrs, kind, record, count, scales[:3], scales[3:])


def _read_integers(source: Source, header: _Header) -> NDArray[np.int32]:
    held = (len(source.data) - header.offset) // header.record
    if held < header.count:
        raise source.fault(f"The header declares {header.count:,} points, the payload ends after {held:,}.", len(source.data))
    row = np.dtype({"names": ["xyz"], "formats": [("<i4", (3,))], "offsets": [0], "itemsize": header.record})
    return np.frombuffer(source.data, row, header.count, header.offset)["xyz"]


def _unpack_laz(source: Source, header: _Header) -> NDArray[np.int32]:
    try:
        import laspy  # noqa: PLC0415 - an optional dependency
        import lazrs  # noqa: F401, PLC0415 - what unpacks LAZ for laspy
    except ImportError:
        raise MissingExtraError("Reading LAZ", "las", path=source.path) from None
    _check_laz(source, header)
    parts: list[NDArray[np.int32]] = []
    try:
        # Not the parallel unpacker: it allocates what the damaged table of chunks says.
        with laspy.LasReader(io.BytesIO(source.data[:]), laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False) as reader:
            for points in reader.chunk_iterator(min(_CHUNK, header.count)):
                parts.append(np.stack([np.asarray(points[axis]) for axis in "XYZ"], axis=1))
    except BaseException as error:
        # A panic in the unpacker, which is written in Rust, is no Exception; whatever it meets here are damaged bytes.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        raise source.fault(f"The packed points of the LAZ file are damaged: {error}.") from error
    found = sum(map(len, parts))
    if found < header.count:
        raise source.fault(f"The header declares {header.count:,} points, the payload ends after {found:,}.", len(source.data))
    return np.concatenate(parts)


def _check_laz(source: Source, header: _Header) -> None:
    """Check the numbers by which the unpacker allocates memory against the size of the file."""
    size, start = len(source.data), header.offset
    if header.record * header.count > _LARGEST_LAZ_RATIO * size:
        raise source.fault(f"{size:,} bytes cannot hold the {header.count:,} points that the LAZ header declares.", 107)
    if start + 8 > size:
        raise source.fault("The LAZ file ends before its points.", size)
    table = int.from_bytes(source.data[start : start + 8], "little", signed=True)
    if table == -1:  # written to a stream: the place of the table stands at the end of the file
        table = int.from_bytes(source.data[size - 8 : size], "little", signed=True)
    if not start + 8 <= table <= size - 8:
        raise source.fault("The LAZ file is truncated: its table of chunks lies behind its end.", size)
    chunks = int.from_bytes(source.data[table + 4 : table + 8], "little")
    if chunks > size - start:
        raise source.fault(f"The LAZ file declares {chunks:,} chunks, more than it has bytes.", table)
    packing = next((content for user, record, content in _vlrs(source, header) if (user, record) == (b"laszip encoded", 22204)), b"")
    items = np.frombuffer(packing[_LAZ_ITEMS : len(packing) // 2 * 2], "<u2")
    sizes = items[1::3][: int.from_bytes(packing[_LAZ_ITEMS - 2 : _LAZ_ITEMS], "little")]
    if int(sizes.sum()) != header.record:
        raise source.fault("The LAZ file does not say how its points are packed: the record 'laszip encoded' is missing or damaged.")


def _vlrs(source: Source, header: _Header) -> Iterator[tuple[bytes, int, bytes]]:
    """Yield user, number and content of the variable length records that lie whole before the points."""
    place = header.size
    for _ in range(header.n_vlrs):
        if place + _VLR.size > header.offset:
            raise source.fault(f"The {header.n_vlrs:,} records that the LAS header declares do not fit before the points.", place)
        user, number, length = _VLR.unpack(source.data[place : place + _VLR.size])
        place += _VLR.size
        yield user.split(b"\0", 1)[0], number, source.data[place : min(place + length, header.offset)]
        place += length


def _unit(source: Source, header: _Header) -> tuple[str, tuple[str, ...]]:
    """Return the unit by the coordinate system where the file has one, and what is to be noted about it."""
    units: set[str] = set()
    for user, number, content in _vlrs(source, header):
        if user == b"LASF_Projection" and number == 34735:
            units |= _units_of_keys(content)
        elif user == b"LASF_Projection" and number == 2112:
            units |= _units_of_wkt(content.decode("latin-1"))
    if "degree" in units:
        return "m", ("The coordinates of the LAS file are degrees of longitude and latitude, not lengths.",)
    if units <= {"m"}:
        return "m", ()
    if units <= {"ft"}:
        return "ft", ()
    if units <= {"ft", "us-ft"}:
        return "ft", ("The coordinates of the LAS file are in US survey feet, which are 2 millionths longer than the feet assumed.",)
    chosen = "ft" if units & {"ft", "us-ft"} else "m"
    return chosen, (f"The LAS file names several units or an unknown one ({', '.join(sorted(units))}); {chosen} is assumed for all axes.",)


def _units_of_keys(content: bytes) -> set[str]:
    """Return the units in a directory of GeoTIFF keys: linear (3076), vertical (4099), or degrees by the kind of system (1024)."""
    keys = np.frombuffer(content[: len(content) // 8 * 8], "<u2").reshape(-1, 4)[1:].tolist()
    linear = {_EPSG_UNITS.get(value, f"code {value}") for key, place, _, value in keys if key in {3076, 4099} and place == 0}
    return linear | {"degree" for key, _, _, value in keys if key == 1024 and value == 2}


def _units_of_wkt(text: str) -> set[str]:
    """Return the units of length in a coordinate system written as well-known text, by their size in metres."""
    if re.match(r"\s*(GEOGCS|GEOGCRS)\b", text):
        return {"degree"}
    sizes = {float(size) for size in re.findall(r"\b(?:LENGTH)?UNIT\s*\[\s*\"[^\"]*\"\s*,\s*(\d+\.?\d*)", text)}
    # Angles are below 0.02 in radians; no unit of length that surveyors use is.
    names = {1.0: "m", 0.3048: "ft"}
    return {names.get(size, "us-ft" if abs(size - 1200 / 3937) < 1e-7 else f"{size:g} m") for size in sizes if size > 0.02}
