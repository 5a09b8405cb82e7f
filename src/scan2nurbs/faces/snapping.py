"""A rough contour drawn onto the crease points beside it: sides smoothed one by one, corners where sides meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.spatial import KDTree

from scan2nurbs.edges.polyline import find_corners, smooth

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Wavelengths, in h, below which the contour and its distance from the creases are taken for noise.
_CONTOUR_WAVE, _OFFSET_WAVE = 8.0, 14.0
# A crease point counts for the contour this far, in h, along it.
_COVER = 3.0
# Crease points inside the contour by more than this, in h, do not belong to it.
_INSIDE = 1.5
# Crease points this much farther out, in h, than others nearby belong to another crease.
_FRONT = 2.0
_ROUNDS = 2


class Creases(NamedTuple):
    """Crease points in the plane of the contour, and how far from it they count."""

    points: Array
    reach: float


class _Side(NamedTuple):
    """The even rows of a contour between two corners, and which of them lie clear of the corners."""

    rough: Array
    trusted: Mask
    closed: bool
    shift: Array


def snap_contour(
    rough: Array, shift: Array, *, h: float, margin: Array, creases: Creases, corner_angle: float, stiffness: float = 1.0
) -> tuple[Array, Rows, Mask]:
    """Draw a contour onto its creases, or outwards by a margin where there are none.

    Parameters
    ----------
    rough : (K, 2) float64
        A closed contour with the face on its left, about half a spacing apart evenly.
    shift : (2,) float64
        From its first point to its end: zero or one period.
    h : float
    margin : (K,) float64
        How far the border lies outside the contour where there is no crease.
    creases : Creases
    corner_angle : float
        Degrees.
    stiffness : float
        How many times longer than usual are the waves of the contour that are taken for noise.

    Returns
    -------
    points : (L, 2) float64
    corners : (C,) int64
        Rows of `points` that are sharp corners.
    covered : (L,) bool
        Rows drawn onto a crease.
    """
    step = float(np.linalg.norm(np.diff(rough, axis=0), axis=1).mean())
    corners = find_corners(rough, closed=True, arm=5.0 * h, blunt=1.0 * h, min_angle=corner_angle, shift=shift)
    while True:
        sides, margins = _sides(rough, shift, margin, corners, blunt=round(h / step))
        lines = [_baseline(side, stiffness * _CONTOUR_WAVE * h / step) for side in sides]
        covers = [np.zeros(len(line), np.bool_) for line in lines]
        for _ in range(_ROUNDS):
            hits = _assign(lines, sides, creases, step, h)
            for i, side in enumerate(sides):
                lines[i], covers[i] = _draw(lines[i], side, margins[i], hits[i], step, h)
        if len(corners) == 0:
            return lines[0], corners, covers[0]
        # The rough contour is full of corners; those that its smoothed sides do not show are none.
        blunt = _turns(lines, reach=max(round(4.0 * h / step), 2)) < corner_angle
        if not blunt.any():
            return _join(lines, covers, rough[corners], shift, creases, step, h)
        corners = corners[~blunt]


def _turns(lines: list[Array], reach: int) -> Array:
    """Return by how many degrees the outline turns where each side begins."""
    turns = np.empty(len(lines))
    for i, after in enumerate(lines):
        before = lines[i - 1][-reach:]
        u, v = before[-1] - before[0], after[:reach][-1] - after[0]
        turns[i] = abs(np.degrees(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)))
    return turns


def _sides(rough: Array, shift: Array, margin: Array, corners: Rows, blunt: int) -> tuple[list[_Side], list[Array]]:
    """Cut the contour at its corners; both neighbours of a corner hold its row."""
    k = len(rough)
    if len(corners) == 0:
        return [_Side(rough, np.ones(k, np.bool_), True, shift)], [margin]
    sides, margins = [], []
    for a, b in zip(corners, np.r_[corners[1:], corners[:1] + k], strict=True):
        rows = np.arange(a, b + 1)
        points = rough[rows % k] + np.where((rows >= k)[:, None], shift, 0.0)
        trusted = np.ones(len(rows), np.bool_)
        spoilt = min(blunt, (len(rows) - 3) // 2)
        if spoilt > 0:
            trusted[:spoilt] = trusted[-spoilt:] = False
        sides.append(_Side(points, trusted, False, np.zeros(2)))
        margins.append(margin[rows % k])
    return sides, margins


def _baseline(side: _Side, wave: float) -> Array:
    return _smooth(side, side.rough, side.trusted.astype(np.float64), wave)


def _smooth(side: _Side, values: Array, weight: Array, wave: float) -> Array:
    if not side.closed:
        return smooth(values, weight, wave, closed=False)
    # Around a tube the values rise by the period: without this slope they are periodic.
    slope = np.arange(len(values))[:, None] / len(values) * (side.shift if values.shape[1] == 2 else 0.0)
    return smooth(values - slope, weight, wave, closed=True) + slope


def _frame(line: Array, side: _Side) -> tuple[Array, Array]:
    """Return unit tangents, and normals that point out of the face."""
    if side.closed:
        extended = np.concatenate([line[-1:] - side.shift, line, line[:1] + side.shift])
        tangent = extended[2:] - extended[:-2]
    else:
        tangent = np.gradient(line, axis=0)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.maximum(length, np.finfo(np.float64).tiny)
    return tangent, np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)


def _assign(lines: list[Array], sides: list[_Side], creases: Creases, step: float, h: float) -> list[tuple[Rows, Array]]:
    """Give each crease point to the row nearest to it; return for each side the rows and the distances outwards."""
    if len(creases.points) == 0:
        return [(np.empty(0, np.int64), np.empty(0)) for _ in lines]
    of_side = np.concatenate([np.full(len(line), i) for i, line in enumerate(lines)])
    of_row = np.concatenate([np.arange(len(line)) for line in lines])
    found = KDTree(np.concatenate(lines)).query(creases.points, distance_upper_bound=creases.reach + h)
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    near = np.isfinite(distance)
    hits = []
    for i, (line, side) in enumerate(zip(lines, sides, strict=True)):
        mine = np.flatnonzero(near)[of_side[nearest[near]] == i]
        row = of_row[nearest[mine]]
        tangent, normal = _frame(line, side)
        off: Array = creases.points[mine] - line[row]
        out, along = (off * normal[row]).sum(axis=1), (off * tangent[row]).sum(axis=1)
        good = (np.abs(along) <= 1.5 * step) & (out <= creases.reach) & (out >= -_INSIDE * h)
        hits.append(_front(row[good], out[good], len(line), round(_COVER * h / step), h))
    return hits


def _front(row: Rows, out: Array, k: int, by: int, h: float) -> tuple[Rows, Array]:
    """Keep the first crease outside the contour: behind it another one may run, of the neighbouring face."""
    nearest = np.full(k, np.inf)
    np.minimum.at(nearest, row, out)
    front = np.asarray(minimum_filter1d(nearest, 2 * by + 1, mode="nearest"))
    first = out <= front[row] + _FRONT * h
    return row[first], out[first]


def _draw(line: Array, side: _Side, margin: Array, hits: tuple[Rows, Array], step: float, h: float) -> tuple[Array, Mask]:
    """Move one side outwards: onto its crease points where it has any, else by the margin from the rough contour."""
    k = len(line)
    _, normal = _frame(line, side)
    row, out = hits
    number = np.bincount(row, minlength=k)
    covered = _widened(number > 0, round(_COVER * h / step), side.closed)
    free = ~covered & side.trusted
    rough = ((side.rough - line) * normal).sum(axis=1) + margin
    trust = np.ones(len(out))
    wave = _OFFSET_WAVE * h / step
    offset, weight, target = np.zeros(k), np.zeros(k), np.zeros(k)
    for _ in range(4):
        weight = np.bincount(row, trust, k) + np.where(free, 0.3, 0.0).astype(np.float64)
        total = np.bincount(row, trust * out, k) + np.where(free, 0.3 * rough, 0.0)
        target = np.divide(total, weight, out=np.zeros(k), where=weight > 0.0)
        offset = _smooth(side, target[:, None], weight, wave)[:, 0]
        residual = np.abs(out - offset[row])
        scale = 4.0 * max(1.4826 * float(np.median(residual)) if len(out) else 0.0, 0.15 * h)
        # Tukey's biweight: points of another edge that ends here lose all say.
        trust = np.clip(1.0 - (residual / scale) ** 2, 0.0, None) ** 2
    # Without data at an end the offset is an extrapolation, which must stay near what the data say.
    if weight.any():
        known = target[weight > 0.0]
        offset = np.clip(offset, known.min() - 0.5 * h, known.max() + 0.5 * h)
    return line + offset[:, None] * normal, covered


def _widened(mask: Mask, by: int, closed: bool) -> Mask:
    result = mask.copy()
    for shift in range(1, by + 1):
        for sign in (-1, 1):
            moved = np.roll(mask, sign * shift)
            if not closed:
                moved[: shift if sign > 0 else 0] = False
                moved[len(mask) - shift if sign < 0 else len(mask) :] = False
            result |= moved
    return result


def _join(
    lines: list[Array],
    covers: list[Mask],
    rough_corners: Array,
    shift: Array,
    creases: Creases,
    step: float,
    h: float,
) -> tuple[Array, Rows, Mask]:
    """Prolong neighbouring sides until they meet, and put their corner there."""
    n = len(lines)
    reach = max(round(3.0 * h / step), 2)
    meets = []
    for i in range(n):
        before, back = (lines[i - 1], np.zeros(2)) if i > 0 else (lines[-1], shift)
        meets.append(_meet(before[-reach:] - back, lines[i][:reach], rough_corners[i], creases.points, h))
    points, covered, corners = [], [], []
    row = 0
    for i in range(n):
        start, end = meets[i], meets[i + 1] if i + 1 < n else meets[0] + shift
        body = _between(lines[i], start, end, step)
        corners.append(row)
        points += [start[None, :], lines[i][body]]
        covered += [covers[i][:1], covers[i][body]]
        row += 1 + int(np.count_nonzero(body))
    return np.concatenate(points), np.array(corners, np.int64), np.concatenate(covered)


def _meet(before: Array, after: Array, rough: Array, creases: Array, h: float) -> Array:
    """Intersect the lines in which two sides end and begin; where these are nearly parallel or meet far off, the middle of the ends."""
    p, q = before.mean(axis=0), after.mean(axis=0)
    u, v = before[-1] - before[0], after[-1] - after[0]
    cross = u[0] * v[1] - u[1] * v[0]
    middle = 0.5 * (before[-1] + after[0])
    if abs(cross) <= 0.2 * np.linalg.norm(u) * np.linalg.norm(v):
        return middle
    d = q - p
    meet = p + u * ((d[0] * v[1] - d[1] * v[0]) / cross)
    # A sharp tip lies the farther out, the sharper it is.
    sine = abs(cross) / (np.linalg.norm(u) * np.linalg.norm(v))
    far = float(np.linalg.norm(meet - rough))
    supported = len(creases) > 0 and float(np.linalg.norm(creases - meet, axis=1).min()) <= 2.0 * h
    return meet if far <= 4.0 * h / sine or (supported and far <= 12.0 * h / sine) else middle


def _between(line: Array, start: Array, end: Array, step: float) -> Mask:
    """Tell which rows of a side lie between its two corners: those near an end that are drawn past its corner do not."""
    keep = np.ones(len(line), np.bool_)
    for corner, backwards in ((start, False), (end, True)):
        ahead, kept = (line[::-1], keep[::-1]) if backwards else (line, keep)  # views
        # A side may run all around the face: far from its end, "behind the corner" means nothing.
        reach = min(int(2.0 * np.linalg.norm(ahead[0] - corner) / step) + 4, len(line) // 2)
        direction = ahead[reach] - ahead[0]
        size = np.linalg.norm(direction)
        if size > 0.0:
            kept[:reach] &= (ahead[:reach] - corner) @ (direction / size) > 0.3 * step
    return keep
