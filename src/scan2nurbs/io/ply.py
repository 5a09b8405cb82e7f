"""PLY, the Stanford polygon format: ascii and binary, any properties in any order, the vertices of meshes too.

The format knows no unit; comments such as ``comment length unit = meters`` are heeded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.io import ply_rows
from scan2nurbs.io.layout import Layout
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source
from scan2nurbs.io.table import blocks, read_rows, show, skip_rows, with_newlines
from scan2nurbs.io.units import unit_in

_HEADER_LIMIT = 1 << 20
_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("int64", "long"), "i8"),
    **dict.fromkeys(("uint64", "ulong"), "u8"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_ROW_END = re.compile(rb"\n(?![ \t\r]*\n)")
_END = re.compile(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r|$)")


@dataclass
class _Header:
    """What the header declares; `order` is "" for ascii and else the byte order."""

    order: str | None = None
    elements: list[ply_rows.Element] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    start: int = 0
    lines: int = 0


def is_ply(head: bytes) -> bool:
    """Tell whether a file begins like PLY."""
    return head[:3] == b"ply" and head[3:4] in {b"\n", b"\r", b" ", b"\t"}


def read_ply(source: Source) -> Scan:
    """Read the vertices of a PLY file.

    Raises
    ------
    InputError
        If the header is not PLY's, has no vertices with x, y and z, or declares more than the file holds.
    """
    header = _read_header(source)
    names = [element.name for element in header.elements]
    if "vertex" not in names:
        raise source.fault("The PLY header has no element 'vertex'.")
    position = names.index("vertex")
    vertex = header.elements[position]
    columns = _coordinate_columns(source, vertex)
    if vertex.count == 0:
        raise source.fault("The PLY header declares 0 vertices.")
    if header.order:
        points = _read_binary(source, header, header.order, position, columns)
    else:
        points = _read_ascii(source, header, position, columns)
    unit = next((unit for unit in map(unit_in, header.comments) if unit), None)
    kind = {"": "ascii", "<": "binary little-endian", ">": "binary big-endian"}[header.order or ""]
    return Scan(points, unit, f"PLY ({kind})", _more_follows(source, header, position))


def _more_follows(source: Source, header: _Header, position: int) -> tuple[str, ...]:
    """Say so where the file goes on behind the last of its vertices, and no other element stands there."""
    if position < len(header.elements) - 1:
        return ()
    count = header.elements[position].count
    if header.order:
        offset = header.start
        for element in header.elements:
            offset = ply_rows.end_of(source, element, offset, header.order)
        more = f"{len(source.data) - offset:,} more bytes" if offset < len(source.data) else ""
    else:
        declared = sum(element.count for element in header.elements if element.properties)
        found = _count_rows(source, header, b"\n")
        if found > declared:  # or lines are blank
            found = _count_rows(source, header, _ROW_END)
        more = f"{found - declared:,} more lines" if found > declared else ""
    return (f"The header declares {count:,} vertices, but {more} follow, which were not read.",) if more else ()


def _count_rows(source: Source, header: _Header, end: bytes | re.Pattern[bytes]) -> int:
    """Count the lines behind the header, by what ends each but the last of a block."""
    texts = (block.strip() for block, _ in blocks(source, header.start, header.lines + 1))
    return sum(1 + (text.count(end) if isinstance(end, bytes) else len(end.findall(text))) for text in texts if text)


def _read_binary(source: Source, header: _Header, order: str, position: int, columns: tuple[int, int, int]) -> NDArray[np.float64]:
    offset = header.start
    for element in header.elements[:position]:
        offset = ply_rows.end_of(source, element, offset, order)
    return ply_rows.read_columns(source, header.elements[position], offset, columns, order)


def _read_ascii(source: Source, header: _Header, position: int, columns: tuple[int, int, int]) -> NDArray[np.float64]:
    source = Source(source.path, with_newlines(source.data), source.packed)
    start, line = header.start, header.lines + 1
    for element in header.elements[:position]:
        start, line = skip_rows(source, start, line, element.count if element.properties else 0)
    vertex = header.elements[position]
    lists = [column for column, prop in enumerate(vertex.properties) if prop.length is not None]
    if any(column < max(columns) for column in lists):
        return ply_rows.read_text_rows(source, vertex, start, line, columns)
    layout = Layout(columns=columns, width=None if lists else len(vertex.properties))
    return read_rows(source, start, line, layout, n_rows=vertex.count, what="vertices")


def _coordinate_columns(source: Source, vertex: ply_rows.Element) -> tuple[int, int, int]:
    columns = []
    for name in "xyz":
        found = [column for column, prop in enumerate(vertex.properties) if prop.name.lower() == name]
        if len(found) != 1:
            raise source.fault(f"The PLY vertices have {'no' if not found else len(found)} property '{name}'.")
        if vertex.properties[found[0]].length is not None:
            raise source.fault(f"The PLY property '{name}' is a list.")
        columns.append(found[0])
    return columns[0], columns[1], columns[2]


def _read_header(source: Source) -> _Header:
    head = source.data[:_HEADER_LIMIT]
    end = _END.search(head)
    if end is None:
        raise source.fault("The PLY header does not end: there is no line 'end_header'.", min(len(head), len(source.data)))
    stop = end.end()
    if end[1] == b"\r\n" and b"\r\n" not in head[: end.start()]:
        stop -= 1  # lines end by a carriage return here, and the line feed is the first byte of the data
    header = _Header(start=stop)
    lines = head[: end.start()].splitlines()
    header.lines = len(lines) + 1
    for line, text in enumerate(lines[1:], 2):
        _read_header_line(source, header, text, line)
    if header.order is None:
        raise source.fault("The PLY header has no line 'format'.")
    if len({element.name for element in header.elements}) < len(header.elements):
        raise source.fault("The PLY header declares an element twice.")
    return header


def _read_header_line(source: Source, header: _Header, text: bytes, line: int) -> None:
    words = text.decode("latin-1").split()
    match words:
        case ["comment" | "obj_info", *_]:
            header.comments.append(text.decode("utf-8", "replace").strip())
        case []:
            pass
        case ["format", kind, _] if kind in _FORMATS and header.order is None:
            header.order = _FORMATS[kind]
        case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 19:
            header.elements.append(ply_rows.Element(name, int(count)))
        case ["property", "list", length, item, name] if header.elements and _TYPES.get(length, "f")[0] in "iu" and item in _TYPES:
            header.elements[-1].properties.append(ply_rows.Property(name, _TYPES[item], _TYPES[length]))
        case ["property", item, name] if header.elements and item in _TYPES:
            header.elements[-1].properties.append(ply_rows.Property(name, _TYPES[item]))
        case _:
            raise source.fault(f"Line {line} of the PLY header cannot be understood: {show(text)}.", line)
