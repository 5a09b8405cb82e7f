"""Corrections by hand that can be replayed: points named by index, box or lasso, kept or dropped.

A selection file is either plain text, row numbers of the input counted from 0 and separated by blanks, commas or line ends
(``#`` begins a comment), or JSON. The JSON is a list of row numbers, or an object with any of these keys; a point is selected
where any part names it::

    {
      "indices": [17, 18, 240],
      "boxes": [{"min": [0, 0, 0], "max": [10, 5, 2]}],
      "lassos": [
        {"view": "xy", "polygon": [[0, 0], [8, 0], [4, 6]], "depth": [-1, 3]},
        {"origin": [0, 0, 0], "u": [1, 0, 0], "v": [0, 0.8, 0.6], "polygon": [[0, 0], [8, 0], [4, 6]]}
      ]
    }

Coordinates are those of the input file, in its unit. A box includes its faces; ``null`` for one of its numbers leaves that
side open. A lasso's polygon lies in a view plane, in coordinates along `u` and `v` from `origin`; ``"xy"``, ``"xz"`` and
``"yz"`` name the planes of the axes through zero. `u` and `v` are made unit length, and `v` upright to `u`. `depth`, along
u × v, is optional and open on both sides without; the polygon closes by itself and may not be convex (even-odd rule).
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError

Vector = tuple[float, float, float]

_VIEWS: dict[str, tuple[Vector, Vector]] = {
    "xy": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "xz": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "yz": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}


@dataclass(frozen=True)
class Box:
    """A box along the axes of the input's coordinates; infinite numbers leave a side open."""

    low: Vector
    high: Vector

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which of the (N, 3) points lie in the box or on its faces."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))


@dataclass(frozen=True)
class Lasso:
    """A polygon in a view plane, and everything before and behind it within a range of depth.

    Attributes
    ----------
    origin : 3 floats
        A point of the plane.
    u, v : 3 floats each
        Unit vectors of the plane, at right angles.
    polygon : tuple of (float, float)
        At least three corners, along u and v from the origin.
    depth : (float, float)
        Lowest and highest coordinate along u × v from the origin.
    """

    origin: Vector
    u: Vector
    v: Vector
    polygon: tuple[tuple[float, float], ...]
    depth: tuple[float, float] = (-math.inf, math.inf)

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which of the (N, 3) points the lasso catches."""
        relative = points - np.array(self.origin)
        depth = relative @ np.cross(self.u, self.v)
        # NaN compares as false, so that rows that are no point are never caught.
        inside = (depth >= self.depth[0]) & (depth <= self.depth[1])
        view = np.stack([relative @ np.array(self.u), relative @ np.array(self.v)], axis=1)
        inside[inside] = in_polygon(view[inside], np.array(self.polygon))
        return inside


@dataclass(frozen=True)
class Selection:
    """Rows of the input named by index, box or lasso; see the module's text for the file.

    Attributes
    ----------
    indices : tuple of int
        Row numbers of the input, from 0.
    boxes : tuple of Box
    lassos : tuple of Lasso
    source : Path or None
        The file it was read from, which errors name.
    """

    indices: tuple[int, ...] = ()
    boxes: tuple[Box, ...] = ()
    lassos: tuple[Lasso, ...] = ()
    source: Path | None = None

    def of(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which of the (N, 3) points, in the input's coordinates and order, are selected.

        Raises
        ------
        InputError
            If an index names a row that the input does not have.
        """
        selected = np.zeros(len(points), np.bool_)
        if self.indices:
            highest = max(self.indices)
            if highest >= len(points):
                raise InputError(f"The index {highest} names no row: the input has {len(points)} rows, counted from 0.", path=self.source)
            selected[list(self.indices)] = True
        for shape in (*self.boxes, *self.lassos):
            selected |= shape.contains(points)
        return selected


def in_polygon(points: NDArray[np.float64], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which (N, 2) points lie in the (M, 2) polygon by the even-odd rule.

    Each side looks only at the points of its own heights, found in sorted order: a polygon of many short sides costs little more
    than one of few long ones.
    """
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order, 0], points[order, 1]
    after = np.roll(polygon, -1, axis=0)
    first = np.searchsorted(y, np.minimum(polygon[:, 1], after[:, 1]))
    last = np.searchsorted(y, np.maximum(polygon[:, 1], after[:, 1]))
    crossed = np.zeros(len(points), np.bool_)
    for a, b, i, j in zip(polygon, after, first.tolist(), last.tolist(), strict=True):
        if i < j:
            crossed[i:j] ^= x[i:j] < a[0] + (y[i:j] - a[1]) * ((b[0] - a[0]) / (b[1] - a[1]))
    inside = np.empty(len(points), np.bool_)
    inside[order] = crossed
    return inside


def read_selection(path: Path | str) -> Selection:
    """Read a selection from a text or JSON file, whose form the module's text describes.

    Raises
    ------
    InputError
        If the file cannot be read or says something that is no selection; the message names the file and the fault.
    """
    path = Path(path)
    text = read_text(path, "selection")
    if not text.strip():
        raise InputError("The selection is empty.", path=path)
    if text.lstrip()[0] not in "[{":
        return Selection(indices=_indices_from_text(text, path), source=path)
    return selection_from(parse_json(text, path, "selection"), path)


def read_text(path: Path, what: str) -> str:
    """Read a text file, or say why it cannot be read; `what` names its content."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"The {what} cannot be read: {reason}.", path=path) from error


def parse_json(text: str, path: Path, what: str) -> Any:
    """Parse JSON, or say where it is wrong; `what` names the content of the file at `path`."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"The {what} is not valid JSON in line {error.lineno}: {error.msg}.", path=path, offset=error.lineno) from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, a thousand brackets
        raise InputError(f"The {what} is JSON beyond any use.", path=path) from error


def selection_from(content: Any, path: Path) -> Selection:
    """Make a selection of parsed JSON; errors name the file that it comes from.

    Raises
    ------
    InputError
        If it is no selection.
    """
    return _Parser(path).selection(content)


def _indices_from_text(text: str, path: Path) -> tuple[int, ...]:
    indices: list[int] = []
    for number, line in enumerate(text.splitlines(), start=1):
        for word in re.split(r"[\s,;]+", line.partition("#")[0].strip()):
            if not word:
                continue
            # Eighteen digits fit into 64 bits; no input has more rows.
            if not re.fullmatch(r"[0-9]{1,18}", word):
                raise InputError(f"Line {number} of the selection holds {word[:40]!r}, which is no row number.", path=path, offset=number)
            indices.append(int(word))
    if not indices:
        raise InputError("The selection names no row.", path=path)
    return tuple(indices)


@dataclass(frozen=True)
class _Parser:
    """Turns parsed JSON into a `Selection`; every complaint names the file and the place in it."""

    path: Path

    def selection(self, content: Any) -> Selection:
        if isinstance(content, list):
            return Selection(indices=self._indices(content, "the list"), source=self.path)
        self._keys(content, "the selection", {"indices", "boxes", "lassos"})
        if not content:
            raise self._error('the selection names nothing; it may hold "indices", "boxes" and "lassos"')
        boxes = self._list(content.get("boxes", []), '"boxes"')
        lassos = self._list(content.get("lassos", []), '"lassos"')
        return Selection(
            indices=self._indices(content.get("indices", []), '"indices"'),
            boxes=tuple(self._box(box, f"boxes[{i}]") for i, box in enumerate(boxes)),
            lassos=tuple(self._lasso(lasso, f"lassos[{i}]") for i, lasso in enumerate(lassos)),
            source=self.path,
        )

    def _error(self, fault: str) -> InputError:
        return InputError(f"The selection is not usable: {fault}.", path=self.path)

    def _keys(self, content: Any, where: str, allowed: set[str]) -> None:
        if not isinstance(content, dict):
            raise self._error(f"{where} must be an object")
        unknown = sorted(set(content) - allowed)
        if unknown:
            raise self._error(f"{where} holds the unknown key {unknown[0]!r}; known are {', '.join(sorted(allowed))}")

    def _list(self, content: Any, where: str) -> list[Any]:
        if not isinstance(content, list):
            raise self._error(f"{where} must be a list")
        return content

    def _indices(self, content: Any, where: str) -> tuple[int, ...]:
        for value in self._list(content, where):
            if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**63:
                raise self._error(f"{where} holds {str(value)[:40]!r}, which is no row number")
        return tuple(content)

    def _numbers(self, content: Any, n: int, where: str, null: tuple[float, ...] = ()) -> tuple[float, ...]:
        """Read n finite numbers; with `null`, its values stand for the places that hold null."""
        if not isinstance(content, list) or len(content) != n:
            raise self._error(f"{where} must be a list of {n} numbers")
        numbers = []
        for i, value in enumerate(content):
            if value is None and null:
                numbers.append(null[i])
            elif isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300:
                numbers.append(float(value))
            else:
                raise self._error(f"{where} must be a list of {n} finite numbers, but holds {str(value)[:40]!r}")
        return tuple(numbers)

    def _vector(self, content: Any, where: str, null: float | None = None) -> Vector:
        x, y, z = self._numbers(content, 3, where, () if null is None else (null,) * 3)
        return x, y, z

    def _box(self, content: Any, where: str) -> Box:
        self._keys(content, where, {"min", "max"})
        low = self._vector(content.get("min"), f"{where}.min", -math.inf)
        high = self._vector(content.get("max"), f"{where}.max", math.inf)
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise self._error(f"{where} has a min above its max")
        return Box(low, high)

    def _lasso(self, content: Any, where: str) -> Lasso:
        self._keys(content, where, {"view", "origin", "u", "v", "polygon", "depth"})
        corners = self._list(content.get("polygon"), f"{where}.polygon")
        if len(corners) < 3:
            raise self._error(f"{where}.polygon must have at least 3 corners")
        pairs = [self._numbers(corner, 2, f"{where}.polygon[{i}]") for i, corner in enumerate(corners)]
        low, high = self._numbers(content.get("depth", [None, None]), 2, f"{where}.depth", (-math.inf, math.inf))
        if low > high:
            raise self._error(f"{where}.depth has its lower end above its upper one")
        origin, u, v = self._plane(content, where)
        return Lasso(origin, u, v, tuple((a, b) for a, b in pairs), (low, high))

    def _plane(self, content: dict[str, Any], where: str) -> tuple[Vector, Vector, Vector]:
        if "view" in content:
            if content["view"] not in tuple(_VIEWS):
                raise self._error(f"{where}.view must be one of {', '.join(_VIEWS)}")
            if {"origin", "u", "v"} & set(content):
                raise self._error(f"{where} holds both a named view and a plane of its own")
            return (0.0, 0.0, 0.0), *_VIEWS[content["view"]]
        origin, u, v = (self._vector(content.get(key), f"{where}.{key}") for key in ("origin", "u", "v"))
        first = np.array(u) / max(math.hypot(*u), 1e-300)
        second = np.array(v) / max(math.hypot(*v), 1e-300)
        second = second - (second @ first) * first
        length = math.hypot(*second)
        if math.hypot(*first) < 0.5 or length < 1e-6:
            raise self._error(f"{where}.u and {where}.v must span a plane")
        second = second / length
        return origin, _triple(first), _triple(second)


def _triple(vector: NDArray[np.float64]) -> Vector:
    return float(vector[0]), float(vector[1]), float(vector[2])
