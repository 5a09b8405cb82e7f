"""OFF, Geomview's format, with its variants COFF, NOFF and STOFF: ascii and binary (big-endian). It states no unit."""

from __future__ import annotations

import re

import numpy as np

from scan2nurbs.io.layout import Layout
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source
from scan2nurbs.io.table import read_rows, show, strip_comment, with_newlines

_KEYWORD = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(?=[\s#]|$)")
_HEADER_LINES = 1000


def is_off(head: bytes) -> bool:
    """Tell whether a file begins with a keyword of OFF."""
    return _KEYWORD.match(_first_statement(head)) is not None


def is_bare_off(head: bytes) -> bool:
    """Tell whether a file begins with three counts, as OFF without its keyword does; so may a table of points."""
    words = _first_statement(head).split()
    return len(words) == 3 and all(word.isdigit() for word in words)


def read_off(source: Source) -> Scan:
    """Read the vertices of an OFF file; normals, colours and texture coordinates are passed over.

    Raises
    ------
    InputError
        If the header cannot be understood, the points are not three-dimensional, or there are fewer than declared.
    """
    source = Source(source.path, with_newlines(source.data), source.packed)
    start, line, body = _next_statement(source, 0, 1)
    keyword = _KEYWORD.match(body)
    if keyword is None:
        return _read_text(source, "OFF", start, line, body)
    if keyword[4] or keyword[5]:
        raise source.fault(f"OFF files with points that are not three-dimensional ({keyword[0].decode()}) cannot be read.", line)
    rest = body[keyword.end() :].split()
    if rest[:1] == [b"BINARY"]:
        return _read_binary(source, keyword, start)
    if not rest:
        start, line, body = _next_statement(source, start, line)
        rest = body.split()
    return _read_text(source, keyword[0].decode(), start, line, b" ".join(rest))


def _read_text(source: Source, keyword: str, start: int, line: int, counts: bytes) -> Scan:
    rest = counts.split()
    if not rest or len(rest) > 3 or not all(word.isdigit() and len(word) < 19 for word in rest):
        raise source.fault(f"Line {line - 1}: an OFF header counts vertices, faces and edges, not {show(counts)}.", line - 1)
    if int(rest[0]) == 0:
        raise source.fault("The OFF header declares 0 vertices.", line - 1)
    points = read_rows(source, start, line, Layout(), n_rows=int(rest[0]), what="vertices")
    return Scan(points, None, f"{keyword} (ascii)")


def _read_binary(source: Source, keyword: re.Match[bytes], start: int) -> Scan:
    if start + 12 > len(source.data):
        raise source.fault("The OFF file ends within its header.", len(source.data))
    n = int(np.frombuffer(source.data, ">i4", 1, start)[0])
    width = 3 + 3 * bool(keyword[3]) + 4 * bool(keyword[2]) + 2 * bool(keyword[1])
    held = (len(source.data) - start - 12) // (4 * width)
    if n <= 0 or n > held:
        raise source.fault(f"The header declares {n:,} vertices, the payload can hold {held:,}.", start)
    rows = np.frombuffer(source.data, ">f4", n * width, start + 12).reshape(n, width)
    return Scan(rows[:, :3].astype(np.float64), None, f"{keyword[0].decode()} (binary)")


def _next_statement(source: Source, start: int, line: int) -> tuple[int, int, bytes]:
    """Return where the line behind the next one that says something begins, its number, and what that line says."""
    for _ in range(_HEADER_LINES):
        end = source.data.find(b"\n", start, start + (1 << 16))
        if end < 0:
            break
        body = strip_comment(source.data[start:end])
        start, line = end + 1, line + 1
        if body:
            return start, line, body
    raise source.fault("The OFF header does not end.", line)


def _first_statement(head: bytes) -> bytes:
    return next((body for line in head.splitlines() if (body := strip_comment(line))), b"")
