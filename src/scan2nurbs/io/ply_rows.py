"""The rows of a PLY element: of one size where there are no lists, walked one by one where there are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.io.source import Source
from scan2nurbs.io.table import blocks, number, show

_LARGEST_ROW = 1 << 30
"""Bytes that a row type of NumPy may have."""


@dataclass(frozen=True)
class Property:
    """A property: the NumPy type of its value or items, without byte order, and for a list that of its length."""

    name: str
    item: str
    length: str | None = None


@dataclass
class Element:
    """An element, its declared number of rows, and its properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


def read_columns(source: Source, element: Element, offset: int, columns: tuple[int, int, int], order: str) -> NDArray[np.float64]:
    """Read three scalar properties of all rows of the element at byte `offset`, as (count, 3) float64."""
    row = _uniform_row(source, element, offset, order)
    if row is not None:
        rows = np.frombuffer(source.data, row, element.count, offset)
        points = np.empty((element.count, 3))
        for axis, column in enumerate(columns):
            points[:, axis] = rows[f"value{column}"]
        return points
    places, _ = _walk(source, element, offset, order, columns)
    data = np.frombuffer(source.data, np.uint8)
    values = [_gather(data, places[:, axis], order + element.properties[column].item) for axis, column in enumerate(columns)]
    return np.stack(values, axis=1)


def read_text_rows(source: Source, element: Element, start: int, line: int, columns: tuple[int, int, int]) -> NDArray[np.float64]:
    """Read three scalar properties of an element in ascii whose rows have lists before them, as (count, 3) float64."""
    points: list[list[float]] = []
    for block, first_line in blocks(source, start, line):
        for number_of_line, text in enumerate(block.split(b"\n"), first_line):
            if len(points) == element.count:
                return np.array(points)
            if tokens := text.split():
                points.append(_text_row(source, element, tokens, columns, number_of_line))
    if len(points) < element.count:
        raise _truncated(source, element, len(points))
    return np.array(points)


def _text_row(source: Source, element: Element, tokens: list[bytes], columns: tuple[int, int, int], line: int) -> list[float]:
    places, place = [], 0
    for prop in element.properties:
        places.append(place)
        place += 1
        if prop.length is not None and place <= len(tokens):
            length = tokens[place - 1]
            if not length.isdigit() or len(length) > len(str(len(tokens))):
                raise source.fault(f"Line {line}: {show(length)} is no length of a list in this line.", line)
            place += int(length)
    if place != len(tokens):
        raise source.fault(f"Line {line} has {len(tokens)} columns instead of {place}.", line)
    values = [number(tokens[places[column]]) for column in columns]
    if None in values:
        raise source.fault(f"Line {line}: {show(tokens[places[columns[values.index(None)]]])} is no number.", line)
    return [value for value in values if value is not None]


def end_of(source: Source, element: Element, offset: int, order: str) -> int:
    """Return the byte offset behind the rows of the element at byte `offset`."""
    if not element.properties or not element.count:
        return offset
    row = _uniform_row(source, element, offset, order)
    if row is not None:
        return offset + element.count * row.itemsize
    return _walk(source, element, offset, order, ())[1]


def _uniform_row(source: Source, element: Element, offset: int, order: str) -> np.dtype[np.void] | None:
    """Return the type of the rows if all have the first one's size (as the faces of a triangle mesh), else None.

    Raises
    ------
    InputError
        If there are no lists and the file cannot hold the rows.
    """
    lengths = _first_lengths(source, element, offset, order)
    if lengths is None or not element.properties:
        return None
    fields, place = [], 0
    for column, (prop, length) in enumerate(zip(element.properties, lengths, strict=True)):
        if prop.length is not None:
            fields.append((f"length{column}", order + prop.length, place))
            place += np.dtype(prop.length).itemsize
            place += length * np.dtype(prop.item).itemsize
        else:
            fields.append((f"value{column}", order + prop.item, place))
            place += np.dtype(prop.item).itemsize
    has_lists = any(prop.length is not None for prop in element.properties)
    whole = (len(source.data) - offset) // place
    if whole < element.count or place > _LARGEST_ROW:
        if has_lists:
            return None
        raise _truncated(source, element, whole)
    names, formats, offsets = zip(*fields, strict=True)
    row = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": place})
    if has_lists:
        rows = np.frombuffer(source.data, row, element.count, offset)
        if any(np.any(rows[name] != rows[name][0]) for name in names if name.startswith("length")):
            return None
    return row


def _first_lengths(source: Source, element: Element, offset: int, order: str) -> list[int] | None:
    """Return the length of each list of the first row (0 for scalars), or None where the row does not fit into the file."""
    lengths = []
    for prop in element.properties:
        length = 0
        if prop.length is not None and element.count:
            size = np.dtype(prop.length).itemsize
            if offset + size > len(source.data):
                return None
            length = int(np.frombuffer(source.data, order + prop.length, 1, offset)[0])
            offset += size + length * np.dtype(prop.item).itemsize
            if length < 0 or offset > len(source.data):
                return None
        elif prop.length is None:
            offset += np.dtype(prop.item).itemsize
        lengths.append(length)
    return lengths


def _walk(source: Source, element: Element, offset: int, order: str, columns: tuple[int, ...]) -> tuple[NDArray[np.int64], int]:
    """Follow the rows one by one; return where the columns' values stand, (count, columns), and where the element ends."""
    data, size = source.data, len(source.data)
    byte_order = {"<": "little", ">": "big"}[order]
    steps = [
        (np.dtype(p.item).itemsize, np.dtype(p.length).itemsize if p.length else 0, bool(p.length) and p.length[0] == "i")
        for p in element.properties
    ]
    places: list[int] = []
    for row in range(element.count):
        at = []
        for item, length, signed in steps:
            at.append(offset)
            if length:
                count = int.from_bytes(data[offset : offset + length], byte_order, signed=signed)  # type: ignore[arg-type] - a str
                if count < 0:
                    raise source.fault(f"A list of the PLY element '{element.name}' has the length {count} (row {row}).", offset)
                offset += length + count * item
            else:
                offset += item
        if offset > size:
            raise _truncated(source, element, row)
        places.extend(at[column] for column in columns)
    return np.array(places, np.int64).reshape(-1, max(1, len(columns))), offset


def _gather(data: NDArray[np.uint8], places: NDArray[np.int64], kind: str) -> NDArray[np.float64]:
    """Read values of one type that stand anywhere in the data."""
    dtype = np.dtype(kind)
    taken = data[places[:, None] + np.arange(dtype.itemsize)]
    return np.ascontiguousarray(taken).view(dtype)[:, 0].astype(np.float64)


def _truncated(source: Source, element: Element, whole: int):
    rows = "vertices" if element.name == "vertex" else f"rows of '{element.name}'"
    return source.fault(f"The header declares {element.count:,} {rows}, the payload ends after {whole:,}.", len(source.data))
