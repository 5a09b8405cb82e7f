"""Points with one value a point and column, as PLY, NPZ or CSV by the suffix."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scan2nurbs.errors import ParameterError
from scan2nurbs.io.atomic import atomic_path
from scan2nurbs.io.units import unit_of

_PLY_TYPES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint", "f4": "float", "f8": "double"}
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_CHUNK = 1 << 16

Columns = Mapping[str, NDArray[Any]]


def write_points(
    path: str | os.PathLike[str],
    points: ArrayLike,
    columns: Mapping[str, ArrayLike],
    *,
    unit: str | None = None,
    comments: Iterable[str] = (),
) -> None:
    """Write points and their columns; the file appears whole or not at all.

    Parameters
    ----------
    path : path
        Ends in ``.ply`` (binary little-endian), ``.npz`` (arrays ``points`` and one a column) or ``.csv`` (a header, numbers that read
        back exactly).
    points : (N, 3) array-like
        Written as float64, NaN rows included.
    columns : mapping of str to (N,) array-like
        Written in their types: integers of up to 32 bits, float32, float64; bool as uint8.
    unit : str, optional
        Unit of the points, e.g. "mm"; written into PLY and NPZ, where `read_scan` finds it. CSV has no place for it.
    comments : iterable of str
        One line each; written into the header of PLY, and into NPZ as the array ``comments``.

    Raises
    ------
    ParameterError
        If the suffix, the shape of the points, or a column's name, length or type is none of these.
    OutputError
        If the file cannot be written there.
    """
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ParameterError(f"The suffix of a file of points must be one of {', '.join(_WRITERS)}. Got {path.suffix!r} instead.")
    if unit is not None and unit_of(unit) != unit:
        raise ParameterError(f"The 'unit' parameter of write_points must be a unit such as 'mm'. Got {unit!r} instead.")
    rows = np.asarray(points, np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ParameterError(f"The 'points' parameter of write_points must be an (N, 3) array. Got the shape {rows.shape} instead.")
    typed = {name: _typed(name, values, len(rows)) for name, values in columns.items()}
    lines = [" ".join(comment.split()) for comment in comments]
    with atomic_path(path) as temporary:
        writer(temporary, rows, typed, unit, lines)


def _typed(name: str, values: ArrayLike, n: int) -> NDArray[Any]:
    column = np.asarray(values)
    if column.dtype == bool:
        column = column.view(np.uint8)
    reserved = {"x", "y", "z", "points", "unit", "comments", "file"}
    if not _NAME.fullmatch(name) or name in reserved:
        raise ParameterError(f"A column's name must be a plain word, none of {', '.join(sorted(reserved))}. Got {name!r} instead.")
    if column.shape != (n,):
        raise ParameterError(f"The column {name!r} must hold one value for each of the {n:,} points. Got the shape {column.shape} instead.")
    if column.dtype.str[1:] not in _PLY_TYPES:
        known = "int8 to int32, uint8 to uint32, float32, float64 or bool"
        raise ParameterError(f"The column {name!r} must be of {known}. Got {column.dtype} instead.")
    return column


def _write_ply(path: Path, points: NDArray[np.float64], columns: Columns, unit: str | None, comments: list[str]) -> None:
    comments = comments if unit is None else [*comments, f"length unit = {unit}"]
    kinds = {**dict.fromkeys("xyz", "f8"), **{name: column.dtype.str[1:] for name, column in columns.items()}}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(points)}",
        *(f"property {_PLY_TYPES[kind]} {name}" for name, kind in kinds.items()),
        "end_header",
    ]
    rows = np.empty(min(len(points), _CHUNK), [(name, "<" + kind) for name, kind in kinds.items()])
    with path.open("wb") as stream:
        stream.write(("\n".join(header) + "\n").encode())
        for start in range(0, len(points), _CHUNK):
            part = slice(start, start + _CHUNK)
            chunk = rows[: len(points[part])]
            for axis, name in enumerate("xyz"):
                chunk[name] = points[part, axis]
            for name, column in columns.items():
                chunk[name] = column[part]
            stream.write(chunk.tobytes())


def _write_npz(path: Path, points: NDArray[np.float64], columns: Columns, unit: str | None, comments: list[str]) -> None:
    about: dict[str, Any] = {} if unit is None else {"unit": np.array(unit)}
    if comments:
        about["comments"] = np.array(comments)
    with path.open("wb") as stream:
        np.savez_compressed(stream, points=points, **columns, **about)


def _write_csv(path: Path, points: NDArray[np.float64], columns: Columns, _unit: str | None, _comments: list[str]) -> None:
    # Neither unit nor comments: most readers of CSV take the first line for the header, whatever it begins with.
    formats = [_text_of(column.dtype) for column in columns.values()]
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(",".join(["x", "y", "z", *columns]) + "\n")
        for start in range(0, len(points), _CHUNK):
            part = slice(start, start + _CHUNK)
            texts = [map(repr, points[part, axis].tolist()) for axis in range(3)]
            texts += [map(text, column[part].tolist()) for text, column in zip(formats, columns.values(), strict=True)]
            stream.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))


def _text_of(dtype: np.dtype[Any]) -> Callable[[Any], str]:
    """Return what makes the text of a value: nine digits tell every float32 apart, Python's repr every float64."""
    return "{:.9g}".format if dtype == np.float32 else repr


_WRITERS = {".ply": _write_ply, ".npz": _write_npz, ".csv": _write_csv}
