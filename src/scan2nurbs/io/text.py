"""Points as text, a row a point: XYZ, TXT, CSV, ASC, PTS, PWN, XYZN and whatever else scanners and spreadsheets write.

Nothing in such a file says how it is meant, so the first rows are looked at and what was concluded is noted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import islice

import numpy as np

from scan2nurbs.io.layout import Layout
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Buffer, Source
from scan2nurbs.io.table import number, read_rows, show, split_row, strip_comment, with_newlines
from scan2nurbs.io.units import unit_in, unit_of

_HEAD = 1 << 16
_SAMPLE = 20
_NAMES = tuple(
    {axis, f"p{axis}", f"{axis}coord", f"{axis}coordinate", f"coord{axis}", f"coordinate{axis}", f"point{axis}", f"pos{axis}", *others}
    for axis, others in (
        ("x", ("positionx", "points0", "easting")),
        ("y", ("positiony", "points1", "northing")),
        ("z", ("positionz", "points2", "elevation", "height")),
    )
)
_SEPARATORS = {None: "white space", b",": "commas", b";": "semicolons", b"\t": "tabs"}
_COMMA_IN_QUOTES = re.compile(rb'(?:^|,)\s*"[^"]*,[^"]*"\s*(?:,|$)')
_UNIT_IN_NAME = re.compile(r"[\[(_ ]\s*(\w+)\s*[\])]?\s*$")


@dataclass(frozen=True)
class _Head:
    """What stands before the rows, and the first of them."""

    start: int
    line: int
    count: int | None
    header: bytes | None
    comments: tuple[str, ...]
    sample: tuple[bytes, ...]


def read_text(source: Source) -> Scan:
    """Read a table of points.

    Raises
    ------
    InputError
        If there are no rows, a row is not numeric or has another number of columns than the first (the message and
        `offset` name the line), or a leading count promises more points than there are.
    """
    source = Source(source.path, with_newlines(_as_utf8(source.data)), source.packed)
    head = _read_head(source)
    if not head.sample:
        raise source.fault("The text holds no points.")
    separator, decimal_comma = _guess_separator(head.sample)
    if separator == b"," and any(_COMMA_IN_QUOTES.search(body) for body in head.sample):
        raise source.fault(f"Line {head.line} ({show(head.sample[0])}) has commas within quotes: write it without quotes.", head.line)
    columns, width, unit, guess = _choose_columns(source, head, separator, _widths(head.sample, separator), decimal_comma)
    layout = Layout(columns=columns, width=width, separator=separator, decimal_comma=decimal_comma)
    points = read_rows(source, head.start, head.line, layout)
    notes = [f"Taken as text of {width} columns separated by {_SEPARATORS[separator]}; {guess}."]
    if decimal_comma:
        notes.append("Commas were taken for decimal points.")
    if head.count is not None:
        if len(points) < head.count:
            raise source.fault(f"The first line declares {head.count:,} points, the file ends after {len(points):,}.")
        if len(points) > head.count:
            notes.append(f"The first line declares {head.count:,} points, but {len(points):,} follow; all were read.")
    unit = unit or next((u for u in map(unit_in, head.comments) if u), None)
    return Scan(points, unit, f"text ({_SEPARATORS[separator]})", tuple(notes))


def _as_utf8(data: Buffer) -> Buffer:
    """Return the text without its byte order mark, and in an encoding in which digits are single bytes."""
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return data[:].decode("utf-16", "replace").encode()
    return data[3:] if data[:3] == b"\xef\xbb\xbf" else data


def _read_head(source: Source) -> _Head:
    start, line, count, header = 0, 1, None, None
    comments: list[str] = []
    while start < len(source.data):
        end = source.data.find(b"\n", start, start + _HEAD)
        if end < 0 and start + _HEAD < len(source.data):
            raise source.fault(f"Line {line} is longer than {_HEAD:,} bytes: this is no text with a point a line.", line)
        end = len(source.data) if end < 0 else end
        text = source.data[start:end]
        body = strip_comment(text)
        if not body or body.startswith(b";"):
            comments.append(text.decode("utf-8", "replace").strip().lstrip("#/%!; "))
        elif count is None and header is None and body.isdigit():
            count = int(body) if len(body) < 19 else None
        elif header is None and not _looks_numeric(body):
            header = body
        else:
            return _Head(start, line, count, header, tuple(comments), _sample(source, start))
        start, line = end + 1, line + 1
    return _Head(start, line, count, header, tuple(comments), ())


def _sample(source: Source, start: int) -> tuple[bytes, ...]:
    lines = source.data[start : start + _HEAD].split(b"\n")
    whole = lines if start + _HEAD >= len(source.data) or len(lines) == 1 else lines[:-1]
    bodies = (strip_comment(text) for text in whole)
    return tuple(islice((body for body in bodies if body and not body.startswith(b";")), _SAMPLE))


def _looks_numeric(body: bytes) -> bool:
    """Tell whether a line is a row of the table, whatever separates its columns, and not its header."""
    tokens = re.split(rb"[\s;,]+", body.strip(b" \t;,"))
    # One number is enough: a row with a fault in it must be reported, not taken for names and passed over.
    return any(number(token.strip(b'"')) is not None for token in tokens)


def _guess_separator(sample: tuple[bytes, ...]) -> tuple[bytes | None, bool]:
    """Return what separates the columns, and whether commas are decimal points."""
    first = sample[0]
    comma_numbers = all(re.search(rb"\d,\d", body) and b"." not in body for body in sample)
    for separator in (b";", b"\t"):
        if first.rstrip(separator).count(separator) >= 2:
            has_comma = any(b"," in body for body in sample)
            return separator, has_comma and not any(b"." in body for body in sample)
    if b"," not in first:
        return None, False
    tokens = first.split()
    if comma_numbers and len(tokens) >= 3 and all(re.fullmatch(rb"[+-]?\d*,?\d+([eE][+-]?\d+)?", token) for token in tokens):
        return None, True
    return b",", False


def _widths(sample: tuple[bytes, ...], separator: bytes | None) -> tuple[int, ...]:
    """Return how many columns rows may have, the likelier number first: behind a separator at the end of all there may be an empty one."""
    n = len(split_row(sample[0], separator))
    return (n - 1, n) if separator is not None and all(body.endswith(separator) for body in sample) else (n,)


def _choose_columns(
    source: Source, head: _Head, separator: bytes | None, widths: tuple[int, ...], decimal_comma: bool
) -> tuple[tuple[int, int, int], int, str | None, str]:
    """Return the columns of x, y and z, the number of columns, the unit that their names state, and how they were found."""
    misfit = None
    for title in (head.header, *(comment.encode() for comment in reversed(head.comments))):
        if title is None:
            continue
        # A header may be separated otherwise than the rows, but must name as many columns.
        for tokens in (split_row(title, separator), re.split(rb"[\s,;]+", title.strip(b" \t,;"))):
            names = [token.decode("utf-8", "replace") for token in tokens]
            columns = _columns_named(names)
            width = len(names) - (names[-1:] == [""])
            if columns is not None and width in widths:
                shown = ", ".join(names[c] for c in columns)
                return columns, width, _unit_of(source, head, [names[c] for c in columns]), f"the header names the coordinates {shown}"
            if columns is not None and title is head.header:
                misfit = f"The header ({show(title)}) names {len(names)} columns, the rows below it have {widths[0]}."
    if misfit is not None:
        raise source.fault(misfit, head.line)
    values = [number(token, decimal_comma=decimal_comma) for token in split_row(head.sample[0], separator)]
    numeric = [column for column, value in enumerate(values) if value is not None]
    if len(numeric) < 3:
        raise source.fault(f"Line {head.line} ({show(head.sample[0])}) does not hold three numbers.", head.line)
    if numeric[:3] == [0, 1, 2]:
        return (0, 1, 2), widths[0], None, "the first three were taken for x, y and z"
    x, y, z = numeric[:3]
    return (x, y, z), widths[0], None, f"columns {x + 1}, {y + 1} and {z + 1}, the first with numbers, were taken for x, y and z"


def _columns_named(names: list[str]) -> tuple[int, int, int] | None:
    plain = [_plain_name(name) for name in names]
    found = [[column for column, name in enumerate(plain) if name in known] for known in _NAMES]
    if all(found):
        return found[0][0], found[1][0], found[2][0]
    return None


def _plain_name(name: str) -> str:
    stated = _UNIT_IN_NAME.search(name.strip())
    if stated and unit_of(stated[1]):
        name = name.strip()[: stated.start()]
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _unit_of(source: Source, head: _Head, names: list[str]) -> str | None:
    """Return the unit that the names of the coordinates state, if one of them does."""
    stated = (_UNIT_IN_NAME.search(name.strip()) for name in names)
    units = sorted({unit for found in stated if found and (unit := unit_of(found[1]))})
    if len(units) > 1:
        raise source.fault(f"The header gives the coordinates in different units: {', '.join(names)}.", head.line)
    return units[0] if units else None


def is_text(head: bytes) -> bool:
    """Tell whether bytes look like text: no zero bytes and hardly any control characters (or a UTF-16 byte order mark)."""
    if head[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return True
    codes = np.frombuffer(head, np.uint8)
    control = (codes < 9) | ((codes > 13) & (codes < 32) & (codes != 26)) | (codes == 127)
    return bool(codes.all()) and int(np.count_nonzero(control)) <= len(codes) // 100
