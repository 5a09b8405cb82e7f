"""A rough contour drawn onto the crease points beside it: sides smoothed one by one, corners where sides meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.polyline import find_corners, smooth

Array = NDArray[np.float64]

# Wavelengths, in h, below which the contour and its distance from the creases are taken for noise.
_CONTOUR_WAVE, _OFFSET_WAVE = 8.0, 14.0
# A crease point counts for the contour this far, in h, along it.
_COVER = 3.0
# Crease points inside the contour by more than this, in h, do not belong to it.
_INSIDE = 1.5
_ROUNDS = 2


class Creases(NamedTuple):
    """Crease points in the plane of the contour, and how far from it they count."""

    points: Array
    reach: float


class _Side(NamedTuple):
    """The even rows of a contour between two corners, and how many at either end are spoilt by the corner."""

    rough: Array
    trusted: NDArray[np.bool_]
    closed: bool
    shift: Array


def snap_contour(
    rough: Array, shift: Array, *, h: float, margin: Array, creases: Creases, corner_angle: float
) -> tuple[Array, NDArray[np.int64], Array]:
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

    Returns
    -------
    points : (L, 2) float64
    corners : (C,) int64
        Rows of `points` that are sharp corners.
    covered : (L,) bool
        Rows drawn onto a crease.
    """
    k = len(rough)
    step = float(np.linalg.norm(np.diff(rough, axis=0), axis=1).mean())
    corners = find_corners(rough, closed=True, arm=5.0 * h, blunt=1.0 * h, min_angle=corner_angle, shift=shift)
    sides, margins = _sides(rough, shift, margin, corners, blunt=round(h / step))
    lines = [_baseline(side, _CONTOUR_WAVE * h / step) for side in sides]
    covers = [np.zeros(len(line), np.bool_) for line in lines]
    for _ in range(_ROUNDS):
        hits = _assign(lines, sides, creases, step, h)
        for i, side in enumerate(sides):
            lines[i], covers[i] = _draw(lines[i], side, margins[i], hits[i], step, h)
    if len(corners) == 0:
        return lines[0][:k], np.empty(0, np.int64), covers[0]
    return _join(lines, covers, rough[corners], shift, step, h)


def _sides(rough: Array, shift: Array, margin: Array, corners: NDArray[np.int64], blunt: int) -> tuple[list[_Side], list[Array]]:
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


def _assign(lines: list[Array], sides: list[_Side], creases: Creases, step: float, h: float) -> list[tuple[Array, Array]]:
    """Give each crease point to the row nearest to it; return for each side the rows and the distances outwards."""
    if len(creases.points) == 0:
        return [(np.empty(0, np.int64), np.empty(0)) for _ in lines]
    of_side = np.concatenate([np.full(len(line), i) for i, line in enumerate(lines)])
    of_row = np.concatenate([np.arange(len(line)) for line in lines])
    distance, nearest = KDTree(np.concatenate(lines)).query(creases.points, distance_upper_bound=creases.reach + h)
    near = np.isfinite(distance)
    hits = []
    for i, (line, side) in enumerate(zip(lines, sides, strict=True)):
        mine = np.flatnonzero(near)[of_side[nearest[near]] == i]
        row = of_row[nearest[mine]]
        tangent, normal = _frame(line, side)
        off = creases.points[mine] - line[row]
        out, along = (off * normal[row]).sum(axis=1), (off * tangent[row]).sum(axis=1)
        good = (np.abs(along) <= 1.5 * step) & (out <= creases.reach) & (out >= -_INSIDE * h)
        hits.append((row[good], out[good]))
    return hits


def _draw(line: Array, side: _Side, margin: Array, hits: tuple[Array, Array], step: float, h: float) -> tuple[Array, NDArray[np.bool_]]:
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
    offset = np.zeros(k)
    for _ in range(4):
        weight = np.bincount(row, trust, k) + np.where(free, 0.3, 0.0)
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


def _widened(mask: NDArray[np.bool_], by: int, closed: bool) -> NDArray[np.bool_]:
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
    lines: list[Array], covers: list[NDArray[np.bool_]], rough_corners: Array, shift: Array, step: float, h: float
) -> tuple[Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Prolong neighbouring sides until they meet, and put their corner there."""
    n = len(lines)
    reach = max(round(3.0 * h / step), 2)
    meets = []
    for i in range(n):
        before, back = (lines[i - 1], np.zeros(2)) if i > 0 else (lines[-1], shift)
        meets.append(_meet(before[-reach:] - back, lines[i][:reach], rough_corners[i], h))
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


def _meet(before: Array, after: Array, rough: Array, h: float) -> Array:
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
    return meet if np.linalg.norm(meet - rough) <= 4.0 * h / sine else middle


def _between(line: Array, start: Array, end: Array, step: float) -> NDArray[np.bool_]:
    """Tell which rows of a side lie between its two corners."""
    keep = np.ones(len(line), np.bool_)
    third = max(len(line) // 2, 1)
    ahead = line[min(third, len(line) - 1)] - line[0]
    behind = line[-1] - line[max(len(line) - 1 - third, 0)]
    for rows, corner, direction in ((slice(0, third), start, ahead), (slice(len(line) - third, None), end, -behind)):
        size = np.linalg.norm(direction)
        if size > 0.0:
            keep[rows] &= (line[rows] - corner) @ (direction / size) > 0.3 * step
    return keep
