"""Formats whose vertices are lines that begin with a keyword: OBJ, and STL as text."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError
from scan2nurbs.io.layout import Layout
from scan2nurbs.io.source import Source
from scan2nurbs.io.table import blocks, read_rows, with_newlines

_NOTHING = b"?"
"""Stands for the numbers that a line lacks: no number, so that it is found to be at fault and not taken for blank."""


def read_keyword_rows(source: Source, keyword: bytes) -> NDArray[np.float64]:
    """Read the first three numbers of every line that begins with `keyword`, whatever its case.

    Returns
    -------
    (N, 3) float64
        In the order of the lines.

    Raises
    ------
    InputError
        If one of these lines has fewer than three numbers; `offset` is the line's number.
    """
    source = Source(source.path, with_newlines(source.data), source.packed)
    pattern = re.compile(rb"^[ \t]*" + keyword + rb"(?=[ \t\r\n]|\Z)([^\r\n]*)", re.MULTILINE | re.IGNORECASE)
    parts = [np.empty((0, 3))]
    for block, line in blocks(source, 0, 1):
        rows = [row.strip() or _NOTHING for row in pattern.findall(block)]
        try:
            parts.append(read_rows(Source(source.path, b"\n".join(rows)), 0, 1, Layout()))
        except InputError:
            # The fault is in one of these lines; read them again in their places, so that the message names the right one.
            found = (pattern.match(text) for text in block.split(b"\n"))
            places = b"\n".join(b"" if match is None else match[1].strip() or _NOTHING for match in found)
            read_rows(Source(source.path, places), 0, line, Layout())
            raise
    return np.concatenate(parts)
