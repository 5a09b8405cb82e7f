"""Blocks of rows of numbers, read by the compiled readers of others.

The careful reader of lines in `table` is the specification: a block that a reader here might understand otherwise, it declines. polars is
many times as fast as NumPy, but takes as long to import as NumPy takes for eight megabytes, so only longer texts are read by it.
"""

from __future__ import annotations

import io
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.io.layout import COMMENT, Layout

Columns: TypeAlias = tuple[NDArray[np.float64], ...]
"""x, y and z of the rows, an array each."""

_TAKEN_FOR_A_FILE = (b"\x1f", b"(", b"x", b"\xef")
"""First bytes of what polars unpacks (gzip, zstd, zlib), and of a byte order mark, which it passes over."""

_SEEN = 1 << 12
"""Bytes at the beginning of a block that tell how its columns are parted."""

_BLANK_TO_NUMPY = (b"\x1c", b"\x1d", b"\x1e", b"\x1f", b"\x85", b"\xa0")
"""What NumPy passes over as white space, and nobody else."""


def read_quickly(block: bytes, layout: Layout, *, long: bool) -> Columns | None:
    """Read a block of whole lines.

    Parameters
    ----------
    block : bytes
        Not only white space.
    layout : Layout
        How the numbers stand in the lines.
    long : bool
        Whether the text is long enough for the reader that is slow to start.

    Returns
    -------
    (3,) tuple of (N,) float64 or None
        x, y and z, so that they are copied only once, into the rows of the caller. None where the block holds, or may hold, anything
        but rows of numbers.
    """
    if layout.decimal_comma:
        block = block.replace(b",", b".")
    block = _without_trailing_separators(block, layout)
    return _by_polars(block, layout) if long else _by_numpy(block, layout)


def _without_trailing_separators(block: bytes, layout: Layout) -> bytes:
    """Leave out the separators behind the last column, where the first row has one; a row that lacks a column lacks it still."""
    separator, width = layout.separator, layout.width
    first = block[: block.find(b"\n") + 1].rstrip(b"\r\n")
    if separator is None or not first.endswith(separator) or first.count(separator) != width:
        return block
    for end in (b"\n", b"\r\n"):
        block = block.replace(separator + end, end)
    return block.removesuffix(separator)


def _by_polars(block: bytes, layout: Layout) -> Columns | None:
    if layout.separator is not None:
        return _separated(block.strip(b"\r\n"), layout)
    # Where two spaces stand side by side, an empty column seems to lie between them, and the block is declined: rows of `width` columns
    # have none to spare. Other white space makes part of a number, and no number of it, or stands before one and is passed over.
    if layout.width is not None and not _pads(block):
        rows = _separated(_trimmed(block), layout)
        if rows is not None:
            return rows
    return _separated(_squeezed(block), layout)


def _trimmed(block: bytes) -> bytes:
    """Leave out white space before the first row and behind the last; not the end of its line, since that would copy the whole block."""
    return block if not block[:1].isspace() and not block[-2:-1].isspace() and block.endswith(b"\n") else block.strip()


def _pads(block: bytes) -> bool:
    """Tell, by what is seen at the beginning, whether columns are parted by more than a space each, or by white space of another kind."""
    seen = block[:_SEEN]
    return any(blank in seen for blank in (b"  ", b"\t", b"\r", b"\v", b"\f"))


def _separated(block: bytes, layout: Layout) -> Columns | None:
    import polars as pl  # noqa: PLC0415 - only for long texts

    separator = layout.separator or b" "
    end = block.find(b"\n")
    width = block.count(separator, 0, len(block) if end < 0 else end) + 1
    # Behind the very last column polars passes over a separator, behind the others it does not.
    if block.endswith(separator) or block.startswith(_TAKEN_FOR_A_FILE) or width <= max(layout.columns) or width != (layout.width or width):
        return None
    wanted = [f"{column}" for column in layout.columns]
    # Columns that are not wanted may hold words, and polars would not see a comment among them.
    if width > len(wanted) and _may_hold_comments(block, layout):
        return None
    schema = {f"{column}": pl.Float64 if column in layout.columns else pl.String for column in range(width)}
    try:
        frame = pl.read_csv(
            block,
            has_header=False,
            separator=separator.decode(),
            quote_char=None,
            schema=schema,
            truncate_ragged_lines=layout.width is None,
        )
    except (pl.exceptions.PolarsError, OSError, ValueError):
        return None
    # Columns that a row lacks are null, and empty ones too.
    lacking = {name for name in schema if frame[name].null_count()}
    if lacking & set(wanted) or (lacking and layout.width is not None and not _has_width(block, layout)):
        return None
    if separator.isspace():
        # Blanks at either end of a row are about it, with the tab beside them, and no column.
        words = [frame[name] for name in {"0", f"{width - 1}"} - set(wanted)]
        if any((column.str.strip_chars() == "").any() for column in words):
            return None
    return tuple(frame[name].to_numpy() for name in wanted)


def _squeezed(block: bytes) -> bytes:
    """Leave single spaces between columns and single line feeds between rows, and nothing before or behind them."""
    block = block.strip()
    codes = np.frombuffer(block, np.uint8)
    white = (codes == ord(" ")) | (codes - np.uint8(9) <= 4)  # from tab to carriage return
    if not np.any(white[1:] & white[:-1]) and not any(blank in block for blank in (b"\t", b"\r", b"\v", b"\f")):
        return block
    keep = ~white | (codes == ord("\n"))
    keep[1:] |= ~white[:-1]  # the first blank behind a word
    codes = codes[keep]
    white = codes - np.uint8(9) <= 4
    codes[white & (codes != ord("\n"))] = ord(" ")
    keep = np.ones(len(codes), np.bool_)
    keep[:-1] = (codes[1:] != ord("\n")) | ~(white | (codes == ord(" ")))[:-1]  # no white space before an end of line
    return codes[keep].tobytes()


def _by_numpy(block: bytes, layout: Layout) -> Columns | None:
    if any(blank in block for blank in _BLANK_TO_NUMPY):
        return None
    if layout.width is None:
        return None if _may_hold_comments(block, layout) else _load_wanted(block, layout)
    rows = _load(block, layout, None)
    if rows is not None:
        return tuple(rows.T[column] for column in layout.columns) if rows.shape[1] == layout.width else None
    # There may be words in columns that are not wanted, as long as no row lacks a column.
    if _may_hold_comments(block, layout) or not _has_width(block, layout):
        return None
    return _load_wanted(block, layout)


def _load_wanted(block: bytes, layout: Layout) -> Columns | None:
    rows = _load(block, layout, layout.columns)
    return None if rows is None else tuple(rows.T)


def _load(block: bytes, layout: Layout, columns: tuple[int, ...] | None) -> NDArray[np.float64] | None:
    separator = None if layout.separator is None else layout.separator.decode()
    try:
        return np.loadtxt(io.BytesIO(block), delimiter=separator, comments=None, ndmin=2, usecols=columns)
    except ValueError:
        return None


def _may_hold_comments(block: bytes, layout: Layout) -> bool:
    return any(mark in block for mark in COMMENT) or (layout.separator != b";" and b";" in block)


def _has_width(block: bytes, layout: Layout) -> bool:
    """Tell whether every line has the separators of a whole row; not where they may be white space about a row, which is no column."""
    if layout.separator is None or layout.width is None or layout.separator.isspace():
        return False
    codes = np.frombuffer(block, np.uint8)
    ends = np.append(np.flatnonzero(codes == ord("\n")), len(block))
    marks = np.searchsorted(np.flatnonzero(codes == ord(layout.separator)), ends)
    n_marks = np.diff(marks[: -1 if block.endswith(b"\n") else None], prepend=0)
    return bool(np.all(n_marks == layout.width - 1))
