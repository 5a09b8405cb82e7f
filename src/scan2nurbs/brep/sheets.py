"""Feet of the borders of a face that stay on one sheet of its surface, where that comes near itself or crosses itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.project import foot_points

Floats = NDArray[np.float64]

_STEPS = 30
_FARTHER = 0.3
"""How much farther than the nearest foot, in h, one on the sheet may be."""


@dataclass(frozen=True, eq=False)
class Guide:
    """Points of a face's borders and their parameters on one sheet of its surface: where feet of other points are looked for.

    Attributes
    ----------
    points : (K, 3) float64
    uv : (K, 2) float64
    farther : float
        How much farther than the nearest foot one on the sheet may be.
    """

    points: Floats
    uv: Floats
    farther: float
    _tree: KDTree = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Sort the points."""
        object.__setattr__(self, "_tree", KDTree(self.points))

    def led(self, surface: BSplineSurface, points: Floats, uv: Floats) -> Floats:
        """Return the parameters (N, 2) of feet of points (N, 3) on the sheet; those of the nearest feet where it has none."""
        start = self.uv[self._tree.query(points)[1]]
        local = foot_points(surface, points, start, steps=_STEPS).uv
        led = _apart(surface, points, local) <= _apart(surface, points, uv) + self.farther
        return np.where(led[:, None], local, uv)


def guide_along(surface: BSplineSurface, loops: Sequence[Floats], feet: Sequence[Floats], h: float) -> Guide | None:
    """Follow the feet of a face's borders along one sheet of its surface.

    Parameters
    ----------
    surface : BSplineSurface
        Closed in neither parameter.
    loops : sequence of (K, 3) float64
        Points along every loop, close to each other.
    feet : sequence of (K, 2) float64
        Parameters of the nearest foot of each.
    h : float
        Spacing of the cloud.

    Returns
    -------
    Guide or None
        None where the nearest feet do not jump from sheet to sheet.

    Notes
    -----
    A surface that is extended beyond its face, or bent to its borders, may come back to them: a strip of a narrow cylinder after a
    whole turn, a tightly curved one where it folds. The longest stretch of each loop without a jump is believed; from there each foot is
    sought from the one before.
    """
    followed, jumped = [], False
    for points, uv in zip(loops, feet, strict=True):
        jumps = _jumps(surface, points, uv, h)
        jumped = jumped or bool(jumps.any())
        followed.append(_follow(surface, points, uv, jumps, h) if jumps.any() else uv)
    return Guide(np.vstack(list(loops)), np.vstack(followed), _FARTHER * h) if jumped else None


def _apart(surface: BSplineSurface, points: Floats, uv: Floats) -> Floats:
    return np.linalg.norm(surface.evaluate(uv) - points, axis=1)


def _jumps(surface: BSplineSurface, points: Floats, uv: Floats, h: float) -> NDArray[np.bool_]:
    """Tell after which points of a closed loop (K,) the straight way in the parameters leads away from it."""
    after, uv_after = np.roll(points, -1, axis=0), np.roll(uv, -1, axis=0)
    off = _apart(surface, points, uv)
    most = np.linalg.norm(after - points, axis=1) + 2.0 * np.maximum(off, np.roll(off, -1)) + _FARTHER * h
    away = [_apart(surface, points + share * (after - points), uv + share * (uv_after - uv)) for share in (0.25, 0.5, 0.75)]
    return np.max(away, axis=0) > most


def _follow(surface: BSplineSurface, points: Floats, uv: Floats, jumps: NDArray[np.bool_], h: float) -> Floats:
    n = len(points)
    last = np.flatnonzero(jumps)
    # The stretch after the k-th jump runs up to the next one.
    lengths = (np.roll(last, -1) - last - 1) % n + 1
    k = int(np.argmax(lengths))
    begin, size = int(last[k]) + 1, int(lengths[k])
    found, nearest = uv.copy(), _apart(surface, points, uv)
    for i in range(begin + size, begin + n):
        here, there = (i - 1) % n, i % n
        local = foot_points(surface, points[there : there + 1], found[here : here + 1], steps=_STEPS).uv
        if _apart(surface, points[there : there + 1], local)[0] <= nearest[there] + _FARTHER * h:
            found[there] = local[0]
    return found
