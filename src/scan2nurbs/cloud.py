"""The point cloud that every stage works on: finite, distinct points in a local frame."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scan2nurbs.errors import InputError, ParameterError
from scan2nurbs.kernels.cells import extremes
from scan2nurbs.kernels.distinct import distinct_rows

PointSource: TypeAlias = "str | os.PathLike[str] | ArrayLike | PointCloud | Any"
"""What every public function accepts: a path, an (N, 3) array, a `PointCloud`, or an object with ``.points``."""

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 0.001, "in": 25.4, "ft": 304.8}
"""Millimetres in one unit."""

MAGNITUDES = (1e-100, 1e100)
"""Least extent and largest coordinate: squares of lengths must neither vanish nor overflow."""


@dataclass(frozen=True)
class PointCloud:
    """Finite, distinct points about a local origin, and how they relate to the rows of the input.

    Attributes
    ----------
    points : (N, 3) float64
        Coordinates relative to `origin`, in `unit`.
    origin : (3,) float64
        What to add to get the input's coordinates back.
    unit : str
        A key of `UNITS`.
    rows : (M,) int64
        For each row of the input the index of its point here; −1 where the row is no point (NaN or infinite).
    source : str
        The file's path, or "array".
    file_sha256 : str
        Hash of the file's bytes; empty where the points come from no file.
    format : str
        Name of the file's format, or "array".
    notes : tuple of str
        What was guessed or left out on the way, one sentence each.
    """

    points: NDArray[np.float64]
    origin: NDArray[np.float64]
    unit: str
    rows: NDArray[np.int64]
    source: str = "array"
    file_sha256: str = ""
    format: str = "array"
    notes: tuple[str, ...] = field(default=())

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes, or of the points, their origin and their rows; computed when it is first asked for."""
        if self.file_sha256:
            return self.file_sha256
        digest = hashlib.sha256()
        for array in (self.points, self.origin, self.rows):
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    @cached_property
    def _is_plain(self) -> bool:
        """Whether each row is one point, in the same order."""
        return len(self.rows) == len(self.points) and bool(np.array_equal(self.rows, np.arange(len(self.rows))))

    @property
    def n_invalid(self) -> int:
        """Rows of the input that are no point."""
        return int(np.count_nonzero(self.rows < 0))

    @property
    def n_duplicates(self) -> int:
        """Rows of the input whose coordinates stand in an earlier row too."""
        return len(self.rows) - self.n_invalid - len(self.points)

    def to_rows(self, values: NDArray[Any], fill: Any) -> NDArray[Any]:
        """Spread one value a point over the rows of the input; rows that are no point get `fill`."""
        if self._is_plain:
            return np.asarray(values)
        spread = np.asarray(values)[np.maximum(self.rows, 0)]
        spread[self.rows < 0] = fill
        return spread


def as_cloud(source: PointSource, unit: str | None = None) -> PointCloud:
    """Make a `PointCloud` of whatever holds points.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        Coordinates of any magnitude; NaN and infinite rows are kept track of, exact duplicates merged.
    unit : str, optional
        "mm", "cm", "m", "um", "in" or "ft"; overrides what the file says. Without either, millimetres, with a note.

    Raises
    ------
    InputError
        If the file cannot be read, the array is not (N, 3), or fewer than three distinct finite points are left.
    ParameterError
        If the unit is unknown.
    """
    if unit is not None and unit not in UNITS:
        raise ParameterError(f"The 'unit' must be one of {', '.join(UNITS)}. Got {unit!r} instead.")
    if isinstance(source, PointCloud):
        return source if unit is None else replace(source, unit=unit)
    if isinstance(source, str | os.PathLike):
        return _from_file(Path(source), unit)
    rows = _as_rows(getattr(source, "points", source))
    return _from_rows(rows, unit or "mm", source="array")


def _from_file(path: Path, unit: str | None) -> PointCloud:
    from scan2nurbs.io import read_scan  # noqa: PLC0415 - readers only when a file is read

    scan = read_scan(path)
    notes = scan.notes
    if unit is None and scan.unit is None:
        notes = (*notes, "The file carries no unit; millimetres are assumed (say --unit otherwise).")
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    chosen = unit or scan.unit or "mm"
    return _from_rows(scan.points, chosen, source=str(path), file_sha256=digest, format=scan.format, notes=notes)


def _as_rows(points: Any) -> NDArray[np.float64]:
    if np.iscomplexobj(points):
        raise InputError("The points must be real numbers in an (N, 3) array. Got complex ones instead.")
    try:
        if isinstance(points, np.ma.MaskedArray):  # what is masked is no point
            points = np.ma.filled(points.astype(np.float64), np.nan)
        rows = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"The points must be numbers in an (N, 3) array: {error}.") from error
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InputError(f"The points must be an (N, 3) array. Got the shape {rows.shape} instead.")
    return rows


def _from_rows(rows: NDArray[np.float64], unit: str, **about: Any) -> PointCloud:
    rows = np.ascontiguousarray(rows)
    low, high, n_invalid = extremes(rows)
    finite = np.isfinite(rows).all(axis=1) if n_invalid else slice(None)
    points = rows[finite] + 0.0  # −0.0 equals 0.0, and so must its bytes
    first, index = distinct_rows(points)
    if n_invalid:
        spread = np.full(len(rows), -1, np.int64)
        spread[finite] = index
        index = spread
    distinct = points if len(first) == len(points) else points[first]
    path = None if about.get("source", "array") == "array" else about["source"]
    if len(distinct) < 3:
        raise InputError(f"Only {len(distinct)} distinct finite points are left of {len(rows)} rows; at least 3 are needed.", path=path)
    if max(np.abs(low).max(), np.abs(high).max()) > MAGNITUDES[1] or (high - low).max() < MAGNITUDES[0]:
        raise InputError("The coordinates are too large, or their extent too small, to compute with (1e-100 to 1e100).", path=path)
    origin = 0.5 * (low + high)
    # Points that lie about zero already keep their coordinates to the bit.
    if np.all(np.abs(origin) <= high - low):
        origin = np.zeros(3)
    else:
        distinct -= origin
    return PointCloud(points=distinct, origin=origin, unit=unit, rows=index, **about)
