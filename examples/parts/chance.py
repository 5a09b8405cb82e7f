"""Parts that nobody designed: a blank, a few features in places of their own, rounded and bevelled edges, all drawn by a seed."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps

from .modelling import box, cut, fuse
from .solids import chamfer, cone, cylinder, edges, extrude, fillet, moved, polygon, sphere

CELL, WIDE, DEEP = 20.0, 3, 2
"""Features stand in the middles of so many cells of a blank, as wide as this in millimetres: none overlaps another."""
LONG = 10.0
"""Edges whose ends and middle are closer together than this are not rounded."""
BEVELLED = 0.3
"""Share of the edges that are bevelled and not rounded."""
KEPT = 0.5
"""A feature or blend that leaves less of the volume is not made."""

Feature = Callable[[Random, Any, float, float, float], Any]
"""Changes a part at (x, y) whose top is at a height there."""


def by_chance(seed: int) -> tuple[Any, list[str]]:
    """Make the part of a seed, turned in space; return it and the names of what it has."""
    draw = Random(seed)
    blank = draw.choice(list(BLANKS))
    height = draw.choice((12.0, 16.0, 20.0, 24.0))
    part, names = BLANKS[blank](draw, height), [blank]
    cells = [(CELL * (i + 0.5), CELL * (j + 0.5)) for i in range(WIDE) for j in range(DEEP)]
    for x, y in draw.sample(cells, draw.randint(2, 4)):
        feature = draw.choice(list(FEATURES))
        changed = FEATURES[feature](draw, part, x, y, height)
        if _sound(changed, part):
            part, names = changed, [*names, feature]
    for _ in range(draw.randint(0, 4)):
        name, blended = _blended(draw, part)
        if blended is not None:
            part, names = blended, [*names, name]
    axis = [draw.uniform(0.2, 1.0) for _ in range(3)]
    return moved(part, turn=draw.uniform(20.0, 160.0), along=axis), names


def _plate(_draw: Random, height: float) -> Any:
    return box((0, CELL * WIDE), (0, CELL * DEEP), (0, height))


def _angle(draw: Random, height: float) -> Any:
    return fuse(_plate(draw, height), box((-12, 0), (0, CELL * DEEP), (0, height + draw.choice((16, 24, 32)))))


def _wedge(draw: Random, height: float) -> Any:
    right, foot = CELL * WIDE, draw.choice((8, 12, 20))
    side = polygon([(right, 0, 0), (right + foot, 0, 0), (right, 0, height)])
    return fuse(_plate(draw, height), extrude(side, (0, CELL * DEEP, 0)))


def _disc(_draw: Random, height: float) -> Any:
    return cylinder((CELL * WIDE / 2, CELL * DEEP / 2, 0), CELL * (WIDE + 1) / 2, height)


BLANKS: dict[str, Callable[[Random, float], Any]] = {"plate": _plate, "angle": _angle, "wedge": _wedge, "disc": _disc}


def _hole(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return cut(part, [cylinder((x, y, -1), draw.choice((4, 5, 6)), height + 2)])


def _blind_hole(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return cut(part, [cylinder((x, y, 0.5 * height), draw.choice((5, 6, 7)), height)])


def _countersink(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    depth = draw.choice((3, 4))
    return cut(part, [cylinder((x, y, -1), 4, height + 2), cone((x, y, height - depth), 4, 4 + depth, depth)])


def _boss(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return fuse(part, cylinder((x, y, 0.5 * height), draw.choice((5, 7, 8)), 0.5 * height + draw.choice((6, 10, 14))))


def _dome(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return fuse(part, sphere((x, y, height), draw.choice((6, 8))))


def _pocket(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return cut(part, [box((x - 8, x + 8), (y - 7, y + 7), (height - draw.choice((2, 4, 6)), height + 1))])


def _pad(draw: Random, part: Any, x: float, y: float, height: float) -> Any:
    return fuse(part, box((x - 8, x + 8), (y - 7, y + 7), (0.5 * height, height + draw.choice((2, 4, 8)))))


FEATURES: dict[str, Feature] = {
    "hole": _hole,
    "blind hole": _blind_hole,
    "countersink": _countersink,
    "boss": _boss,
    "dome": _dome,
    "pocket": _pocket,
    "pad": _pad,
}


def _blended(draw: Random, part: Any) -> tuple[str, Any]:
    """Round or bevel an edge of a part; return None for it where the kernel cannot."""
    bevel, size = draw.random() < BEVELLED, draw.choice((1.5, 2.0, 3.0))
    number = draw.randrange(len(edges(part, _long)))
    turns = iter(range(len(edges(part))))
    try:
        blended = (chamfer if bevel else fillet)(part, size, lambda p: _long(p) and next(turns) == number)
    except Exception:  # the kernel's exceptions have no class in common
        return "", None
    return f"{'bevel' if bevel else 'fillet'} {size:g}", blended if _sound(blended, part) else None


def _long(p: np.ndarray) -> bool:
    return bool(max(np.linalg.norm(p[4] - p[0]), np.linalg.norm(p[-1] - p[0])) > LONG)


def _sound(changed: Any, part: Any) -> bool:
    return not changed.IsNull() and BRepCheck_Analyzer(changed).IsValid() and _volume(changed) > KEPT * _volume(part)


def _volume(shape: Any) -> float:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())
