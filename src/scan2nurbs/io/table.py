"""Rows of numbers in text: the engine under every text format.

The careful reader of lines is the specification; compiled readers take the blocks that they understand alike, nearly all.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError
from scan2nurbs.io.layout import COMMENT, Layout
from scan2nurbs.io.quick import Columns, read_quickly
from scan2nurbs.io.source import Buffer, Source

BLOCK = 1 << 22
"""Bytes parsed at a time where lines are looked at; no line may be longer."""

QUICK_BLOCK = 1 << 24
"""Bytes that a compiled reader is given at a time: fewer do not keep all cores busy. A block that it declines is cut into smaller ones."""

_AFTER_ROW = re.compile(rb"(?:^|(?<=[\s,;]))#")  # not within a word: Microsoft's old libraries print NaN as -1.#IND
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
_INFINITE = re.compile(rb"[+-]?(inf|infinity|1\.#INF)", re.IGNORECASE)
_MISSING = re.compile(rb"|[+-]?nan(\(\w*\))?|[+-]?1\.#(QNAN|SNAN|IND)\d*|null|none|n/?a", re.IGNORECASE)


def read_rows(
    source: Source, start: int, line: int, layout: Layout, *, n_rows: int | None = None, what: str = "points"
) -> NDArray[np.float64]:
    """Read x, y and z of the rows that begin at byte `start`.

    Parameters
    ----------
    source : Source
        The file.
    start, line : int
        Byte offset of the first row, and the number of its line, counted from 1.
    layout : Layout
        How the numbers stand in the lines.
    n_rows : int, optional
        How many rows there are; what follows them is not looked at. Without it, all lines are rows.
    what : str
        What the header calls the rows, for messages.

    Returns
    -------
    (N, 3) float64
        Blank lines and comments are no rows. Missing numbers are NaN.

    Raises
    ------
    InputError
        If a row is not numeric or has a wrong number of columns (with the line's number as offset), or rows are missing.
    """
    points = np.empty((0, 3))
    found = read = 0
    size = len(source.data) - start
    for columns, n_bytes in _row_blocks(source, start, line, layout, n_rows):
        read += n_bytes
        end = found + len(columns[0])
        if end > len(points):  # room for all, if the other lines are about as long: parts and their sum would take more
            wider = np.empty((max(end, int(1.02 * end * size / read)), 3))
            wider[:found] = points[:found]
            points = wider
        for axis, column in enumerate(columns):
            points[found:end, axis] = column
        found = end
    if n_rows is not None and found < n_rows:
        raise source.fault(f"The header declares {n_rows:,} {what}, the file ends after {found:,}.", len(source.data))
    points.resize((found, 3), refcheck=False)
    return points


def blocks(source: Source, start: int, line: int) -> Iterator[tuple[bytes, int]]:
    """Yield pieces of the text that end at the end of a line, each with the number of its first line."""
    while start < len(source.data):
        block = _lines_at(source, start, line)
        yield block, line
        start += len(block)
        source.forget(start)
        line += block.count(b"\n")


def skip_rows(source: Source, start: int, line: int, n_rows: int) -> tuple[int, int]:
    """Return the byte offset and line number behind `n_rows` lines that are not blank."""
    while n_rows > 0:
        end = source.data.find(b"\n", start)
        if end < 0:
            raise source.fault("The file ends before the points begin.", len(source.data))
        n_rows -= bool(source.data[start:end].strip())
        start, line = end + 1, line + 1
    return start, line


def with_newlines(data: Buffer) -> Buffer:
    """Return the text with lines ended by a line feed, also where an old Macintosh ended them by a carriage return."""
    return data[:].replace(b"\r", b"\n") if data.find(b"\n") < 0 and data.find(b"\r") >= 0 else data


def strip_comment(line: bytes) -> bytes:
    """Return what a line says, without its comment and white space."""
    line = _AFTER_ROW.split(line, maxsplit=1)[0].strip()
    return b"" if line.startswith(COMMENT) else line


def split_row(line: bytes, separator: bytes | None) -> list[bytes]:
    """Return the columns of a line; an empty one behind a trailing separator counts."""
    if separator is None:
        return line.split()
    return [token.strip().strip(b'"').strip() for token in line.split(separator)]


def number(token: bytes, *, decimal_comma: bool = False) -> float | None:
    """Return the number that a column holds, NaN for the usual words for a missing one, None where it holds something else."""
    if decimal_comma:
        token = token.replace(b",", b".", 1)
    if _NUMBER.fullmatch(token):
        return float(token.upper().replace(b"D", b"E"))
    if _MISSING.fullmatch(token):
        return np.nan
    if _INFINITE.fullmatch(token):
        return -np.inf if token.startswith(b"-") else np.inf
    return None


def _row_blocks(source: Source, start: int, line: int, layout: Layout, n_rows: int | None) -> Iterator[tuple[Columns, int]]:
    """Yield the rows of one block of lines after the other, and how many bytes they took, until there are `n_rows`."""
    counted = start  # where line number `line` begins: lines are counted only where one may have to be named
    looked_at = 0  # up to here, lines are read in small blocks
    long = len(source.data) - start > 2 * BLOCK
    while start < len(source.data) and n_rows != 0:
        block = _first_lines(_whole_lines(source, start, QUICK_BLOCK), n_rows) if long and start >= looked_at else b""
        rows = _quick_rows(block, layout, n_rows, long=long) if block else None
        if rows is None:
            looked_at = max(looked_at, start + len(block))
            line += sum(source.data[i : min(i + BLOCK, start)].count(b"\n") for i in range(counted, start, BLOCK))
            counted = start
            block = _first_lines(_lines_at(source, start, line), n_rows)
            rows = _quick_rows(block, layout, n_rows, long=long)
        if rows is None:
            rows = _parse_lines(source, block, line, layout, n_rows)
        yield rows, len(block)
        start += len(block)
        source.forget(start)
        n_rows = None if n_rows is None else n_rows - len(rows[0])
        del block, rows  # the next ones take their place, on pages that need not be cleared again


def _lines_at(source: Source, start: int, line: int) -> bytes:
    block = _whole_lines(source, start, BLOCK)
    if not block:
        raise source.fault(f"Line {line} is longer than {BLOCK:,} bytes: this is no text with a point a line.", line)
    return block


def _whole_lines(source: Source, start: int, most: int) -> bytes:
    """Return the lines that begin at byte `start`, at most so many bytes of them; none if the first is longer."""
    end = start + most
    if end < len(source.data):
        end = max(start, source.data.rfind(b"\n", start, end) + 1)
    return source.data[start:end]


def _first_lines(block: bytes, n: int | None) -> bytes:
    """Return the first `n` lines: where the rows end if every line is one, so that what follows does not spoil the quick reading."""
    if n is None or block.count(b"\n") <= n:
        return block
    ends = np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n"))
    return block[: int(ends[n - 1]) + 1]


def _quick_rows(block: bytes, layout: Layout, most: int | None, *, long: bool) -> Columns | None:
    if block.isspace():
        return (np.empty(0),) * 3
    rows = read_quickly(block, layout, long=long)
    return None if rows is not None and most is not None and len(rows[0]) > most else rows


def _parse_lines(source: Source, block: bytes, line: int, layout: Layout, wanted: int | None) -> Columns:
    rows: list[tuple[float, ...]] = []
    for number_of_line, text in enumerate(block.split(b"\n"), line):
        if len(rows) == wanted:
            break
        body = strip_comment(text)
        if body and not (body.startswith(b";") and layout.separator != b";"):
            rows.append(_parse_line(source, body, number_of_line, layout))
    x, y, z = np.array(rows, np.float64).reshape(-1, 3).T
    return x, y, z


def _parse_line(source: Source, body: bytes, line: int, layout: Layout) -> tuple[float, ...]:
    tokens = split_row(body, layout.separator)
    n = len(tokens) - (layout.separator is not None and len(tokens) - 1 == layout.width and not tokens[-1])
    if n != layout.width if layout.width is not None else n <= max(layout.columns):
        wanted = f"at least {max(layout.columns) + 1}" if layout.width is None else f"{layout.width}"
        raise source.fault(f"Line {line} has {n} {'column' if n == 1 else 'columns'} instead of {wanted}.", line)
    return tuple(_coordinate(source, tokens[column], line, layout) for column in layout.columns)


def _coordinate(source: Source, token: bytes, line: int, layout: Layout) -> float:
    value = number(token, decimal_comma=layout.decimal_comma)
    if value is None:
        raise InputError(f"Line {line}: {show(token)} is no number.", path=source.path, offset=line)
    return value


def show(token: bytes) -> str:
    """Return a piece of a file as it may stand in a message: short, quoted, without control characters."""
    return repr(token[:40].decode("utf-8", "replace") + ("…" if len(token) > 40 else ""))
