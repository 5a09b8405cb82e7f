"""PCD, the format of the Point Cloud Library: ascii, binary and binary_compressed.

The format states no unit. PCL and ROS habitually write metres, CAD tools write millimetres into it too: nothing is guessed, and a note
says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.io.layout import Layout
from scan2nurbs.io.lzf import LARGEST_RATIO, LzfError, unpack_lzf
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source
from scan2nurbs.io.table import read_rows, show, with_newlines

_HEADER_LIMIT = 1 << 16
_KEYWORDS = {"VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"}
_TYPES = {("F", 4): "<f4", ("F", 8): "<f8", **{(t, n): f"<{t.lower()}{n}" for t in "IU" for n in (1, 2, 4, 8)}}
_NO_UNIT = "PCD states no unit; PCL and ROS habitually write metres (say --unit m if this file does)."
_IDENTITY = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


@dataclass(frozen=True)
class _Fields:
    """The columns of a point: NumPy type, number of values, byte offset in a point, and where x, y and z are."""

    types: tuple[str, ...]
    counts: tuple[int, ...]
    offsets: tuple[int, ...]
    itemsize: int
    xyz: tuple[int, int, int]


def is_pcd(head: bytes) -> bool:
    """Tell whether a file begins like PCD."""
    lines = head[:4096].splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith(b"#")), b"").split()
    return head[:7] == b"# .PCD " or (first[:1] in ([b"VERSION"], [b"FIELDS"]) and b"DATA" in head)


def read_pcd(source: Source) -> Scan:
    """Read the points of a PCD file; NaN points of organised clouds keep their places.

    Raises
    ------
    InputError
        If the header contradicts itself or the payload, or the payload is damaged.
    """
    header, start, line = _read_header(source)
    fields = _read_fields(source, header)
    declared = _declared(source, header)
    kind = " ".join(header["DATA"]).lower()
    if kind == "ascii":
        points = _read_ascii(source, fields, declared, start, line)
    elif kind == "binary":
        points = _read_binary(source, fields, declared, start)
    elif kind == "binary_compressed":
        points = _read_compressed(source, fields, declared, start)
    else:
        raise source.fault(f"The PCD header says DATA {show(kind.encode())}, which is none of ascii, binary and binary_compressed.")
    notes = [_NO_UNIT]
    if len(set(declared)) > 1:
        notes.append(f"The PCD header's WIDTH × HEIGHT and POINTS differ; the {len(points):,} points that are there were read.")
    notes += _viewpoint_note(header)
    return Scan(points, None, f"PCD ({kind})", tuple(notes))


def _read_header(source: Source) -> tuple[dict[str, list[str]], int, int]:
    """Return the header's entries, where the payload begins, and the number of its first line."""
    head = source.data[:_HEADER_LIMIT]
    header: dict[str, list[str]] = {}
    start, line = 0, 1
    while "DATA" not in header:
        end = head.find(b"\n", start)
        if end < 0:
            raise source.fault("The PCD header does not end: there is no line 'DATA'.", len(head))
        words = head[start:end].split(b"#", 1)[0].decode("latin-1").split()
        if words:
            keyword = words[0].upper()
            if keyword not in _KEYWORDS or keyword in header:
                what = "stands twice in" if keyword in header else "is no entry of"
                raise source.fault(f"Line {line}: {show(keyword.encode())} {what} a PCD header.", line)
            header[keyword] = words[1:]
        start, line = end + 1, line + 1
    return header, start, line


def _read_fields(source: Source, header: dict[str, list[str]]) -> _Fields:
    names = [name.lower() for name in header.get("FIELDS", header.get("COLUMNS", []))]
    if not names:
        raise source.fault("The PCD header has no line 'FIELDS'.")
    sizes = _integers(source, header, "SIZE", ["4"] * len(names))
    kinds = [kind.upper() for kind in header.get("TYPE", ["F"] * len(names))]
    counts = _integers(source, header, "COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise source.fault(f"The PCD header names {len(names)} fields, but {len(sizes)} sizes, {len(kinds)} types, {len(counts)} counts.")
    unknown = [f"{kind}{size}" for kind, size in zip(kinds, sizes, strict=True) if (kind, size) not in _TYPES]
    if unknown or max(counts) > 1 << 20:
        raise source.fault(f"The PCD header has a field of {unknown[0] if unknown else max(counts)}, which no PCD file has.")
    xyz = []
    for axis in "xyz":
        if names.count(axis) != 1 or counts[names.index(axis)] != 1:
            raise source.fault(f"The PCD header must name one field '{axis}' of count 1. It names {', '.join(names[:12])}.")
        xyz.append(names.index(axis))
    widths = [size * count for size, count in zip(sizes, counts, strict=True)]
    offsets = [sum(widths[:field]) for field in range(len(widths))]
    types = tuple(_TYPES[kind, size] for kind, size in zip(kinds, sizes, strict=True))
    return _Fields(types, tuple(counts), tuple(offsets), sum(widths), (xyz[0], xyz[1], xyz[2]))


def _integers(source: Source, header: dict[str, list[str]], keyword: str, default: list[str]) -> list[int]:
    words = header.get(keyword, default)
    if not all(word.isascii() and word.isdigit() and len(word) < 19 for word in words):
        raise source.fault(f"The PCD header's {keyword} must be whole numbers. Got {show(' '.join(words).encode())}.")
    return [int(word) for word in words]


def _declared(source: Source, header: dict[str, list[str]]) -> list[int]:
    """Return how many points the header declares, once by POINTS and once by WIDTH × HEIGHT where it has both."""
    declared = []
    for keywords in (("POINTS",), ("WIDTH", "HEIGHT")):
        if all(keyword in header for keyword in keywords):
            values = [_integers(source, header, keyword, []) for keyword in keywords]
            if any(len(value) != 1 for value in values):
                raise source.fault(f"The PCD header's {' and '.join(keywords)} must be one number each.")
            declared.append(int(np.prod([value[0] for value in values], dtype=object)))
    if not declared:
        raise source.fault("The PCD header says neither POINTS nor WIDTH and HEIGHT.")
    if max(declared) == 0:
        raise source.fault("The PCD header declares 0 points.")
    return declared


def _choose(source: Source, declared: list[int], held: int) -> int:
    """Return the declared number of points that the payload bears out: the only one, or of two the one that it holds exactly."""
    if len(set(declared)) > 1 and held in declared:
        return held
    if held < declared[0]:
        raise source.fault(f"The header declares {declared[0]:,} points, the payload ends after {held:,}.", len(source.data))
    if len(set(declared)) > 1:
        raise source.fault(f"The PCD header declares {declared[0]:,} and {declared[1]:,} points, and the payload holds neither.")
    return declared[0]


def _read_ascii(source: Source, fields: _Fields, declared: list[int], start: int, line: int) -> NDArray[np.float64]:
    source = Source(source.path, with_newlines(source.data), source.packed)
    columns = tuple(sum(fields.counts[:field]) for field in fields.xyz)
    layout = Layout(columns=(columns[0], columns[1], columns[2]), width=sum(fields.counts))
    if len(set(declared)) == 1:
        return read_rows(source, start, line, layout, n_rows=declared[0])
    points = read_rows(source, start, line, layout)
    return points[: _choose(source, declared, len(points))]


def _read_binary(source: Source, fields: _Fields, declared: list[int], start: int) -> NDArray[np.float64]:
    n = _choose(source, declared, (len(source.data) - start) // fields.itemsize)
    row = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [fields.types[field] for field in fields.xyz],
            "offsets": [fields.offsets[field] for field in fields.xyz],
            "itemsize": fields.itemsize,
        }
    )
    rows = np.frombuffer(source.data, row, n, start)
    points = np.empty((n, 3))
    for axis, name in enumerate("xyz"):
        points[:, axis] = rows[name]
    return points


def _read_compressed(source: Source, fields: _Fields, declared: list[int], start: int) -> NDArray[np.float64]:
    """Read LZF data, in which all values of a field stand together."""
    if start + 8 > len(source.data):
        raise source.fault("The PCD file ends before its compressed data.", len(source.data))
    packed_size, size = (int(word) for word in np.frombuffer(source.data, "<u4", 2, start))
    if start + 8 + packed_size > len(source.data):
        raise source.fault(f"The compressed data should be {packed_size:,} bytes long, the file ends before.", len(source.data))
    n = _choose(source, declared, size // fields.itemsize)
    if size > LARGEST_RATIO * packed_size:
        raise source.fault(f"{packed_size:,} compressed bytes cannot hold the {size:,} that are declared.", start)
    try:
        unpacked = unpack_lzf(source.data[start + 8 : start + 8 + packed_size], size)
    except LzfError as error:
        raise source.fault(f"The compressed data are damaged: {error}.", start + 8 + error.offset) from error
    held = size // fields.itemsize
    columns = [np.frombuffer(unpacked, fields.types[field], n, fields.offsets[field] * held) for field in fields.xyz]
    return np.stack(columns, axis=1).astype(np.float64)


def _viewpoint_note(header: dict[str, list[str]]) -> list[str]:
    words = header.get("VIEWPOINT", [])
    try:
        moved = bool(words) and [float(word) for word in words] != _IDENTITY
    except ValueError:
        moved = True
    return [f"The scanner's pose in the PCD header (VIEWPOINT {' '.join(words)}) was not applied."] if moved else []
