"""Rows of points along a curve, in any dimension: arc length, resampling, smoothing, and the corners that smoothing must spare."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

Points = NDArray[np.float64]


def arc_length(points: Points, *, closed: bool, shift: Points | None = None) -> NDArray[np.float64]:
    """Return the arc length up to each point, and with `closed` one more value: the whole length.

    `shift` is what to add to the first point to reach the end of the loop: zero, or one period of a closed surface's parameter.
    """
    if closed:
        last = points[:1] if shift is None else points[:1] + shift
        points = np.concatenate([points, last])
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]


def resample(points: Points, step: float, *, closed: bool, shift: Points | None = None) -> Points:
    """Return points about `step` apart along the polyline, evenly by arc length; an open one keeps its ends."""
    length = arc_length(points, closed=closed, shift=shift)
    if closed:
        points = np.concatenate([points, points[:1] if shift is None else points[:1] + shift])
    n = max(round(float(length[-1]) / step), 4 if closed else 1)
    at = np.linspace(0.0, length[-1], n + 1)[: n if closed else n + 1]
    return np.stack([np.interp(at, length, column) for column in points.T], axis=1)


def smooth(values: Points, weight: NDArray[np.float64], wavelength: float, *, closed: bool) -> Points:
    """Smooth evenly spaced values by penalised least squares (Whittaker 1923): Σ w |x − y|² + λ Σ |Δ²x|².

    Parameters
    ----------
    values : (K, d) float64
        y; where the weight is zero the value does not matter.
    weight : (K,) float64
        w >= 0. Rows without weight are interpolated, and beyond the ends extrapolated along a straight line.
    wavelength : float
        The wave, in numbers of rows, whose height is halved at weight one.
    closed : bool
        Whether the last row is a neighbour of the first.

    Returns
    -------
    (K, d) float64
    """
    k = len(values)
    if k < 4 or np.count_nonzero(weight) < 3:
        return values.copy()
    # The squared second difference of a wave of L rows is (2 sin(π/L))^4 of its square.
    penalty = 1.0 / max(2.0 * np.sin(np.pi / max(wavelength, 2.0)), 1e-3) ** 4
    # With weights far below one the matrix must still stand above rounding.
    data = np.where(weight[:, None] > 0.0, weight[:, None] * values, 0.0)
    if not closed:
        band = np.zeros((3, k))
        band[2, :] = weight
        for offset, factor in ((0, 1.0), (1, -2.0), (2, 1.0)):
            for other, by in ((0, 1.0), (1, -2.0), (2, 1.0)):
                if other >= offset:
                    band[2 - (other - offset), other : k - 2 + other] += penalty * factor * by
        return solveh_banded(band, data)
    row = np.arange(k)
    places = np.r_[row, row], np.r_[(row + 1) % k, (row - 1) % k]
    second = csc_array((np.ones(2 * k), places), shape=(k, k)) - 2.0 * csc_array(eye_array(k))
    weights = csc_array((weight, (row, row)), shape=(k, k))
    return splu(csc_array(weights + penalty * (second.T @ second))).solve(data)


def find_corners(
    points: Points, *, closed: bool, arm: float, blunt: float, min_angle: float, shift: Points | None = None
) -> NDArray[np.int64]:
    """Find the sharp corners of an evenly spaced polyline.

    A corner is where lines fitted to the arms before and after it turn by at least an angle, more than the curve turns just
    beyond the arms, and meet so near to the polyline that no rounding lies between.

    Parameters
    ----------
    points : (K, d) float64
        Evenly spaced by arc length.
    closed : bool
        Whether the last point is a neighbour of the first.
    arm : float
        Length of the arms; sides shorter than this may lose their corners.
    blunt : float
        Scatter of the points about the curve: the arms begin this far from the corner, and as far may the polyline cut it off.
    min_angle : float
        Degrees.
    shift : (d,) float64, optional
        See `arc_length`.

    Returns
    -------
    (C,) int64
        Ascending indices of the points nearest to the corners.
    """
    k = len(points)
    step = float(arc_length(points, closed=closed, shift=shift)[-1]) / max(k if closed else k - 1, 1)
    if not step > 0.0:
        return np.empty(0, np.int64)
    first, last = max(round(blunt / step), 1), max(round((blunt + arm) / step), 3)
    if k < (2 * last + 1 if closed else last + 2):
        return np.empty(0, np.int64)
    before, after = _arm_lines(points, first, last, closed, shift)
    turn = np.degrees(np.arccos(np.clip((before[1] * after[1]).sum(axis=1), -1.0, 1.0)))
    turn[~np.isfinite(turn)] = 0.0
    beyond = 0.5 * (_shifted(turn, last, closed) + _shifted(turn, -last, closed))
    gap = _corner_gap(points, before, after)
    interior = np.radians(np.clip(180.0 - turn, 10.0, 180.0))
    near = gap / (blunt * (0.3 + 0.7 / np.sin(0.5 * interior)))
    # A curve that turns as much beyond the arms is round, unless it hugs the corner: then there is another corner beyond.
    sharp = (turn - np.minimum(beyond, 30.0) >= min_angle) & (near <= np.where(turn >= 2.0 * beyond, 1.0, 0.5))
    return _strongest(turn - beyond, sharp, max(last // 2, 1), closed)


def _arm_lines(
    points: Points, first: int, last: int, closed: bool, shift: Points | None
) -> tuple[tuple[Points, Points], tuple[Points, Points]]:
    """Fit a line to the points `first` to `last` rows before, and after, each point: mean and unit direction along the curve."""
    k = len(points)
    turn = np.zeros(points.shape[1]) if shift is None else shift
    if closed:
        padded = np.concatenate([points[k - last :] - turn, points, points[:last] + turn])
    else:
        padded = np.concatenate([np.full((last, points.shape[1]), np.nan), points, np.full((last, points.shape[1]), np.nan)])
    offsets = np.arange(first, last + 1)
    lines = []
    for sign in (-1, 1):
        rows = padded[last + np.arange(k)[:, None] + sign * offsets[None, :]]
        mean = rows.mean(axis=1)
        centred = sign * (offsets - offsets.mean())
        # Rows are evenly spaced by arc length, so that the regression on their number gives the direction.
        slope = np.einsum("j,kjd->kd", centred, rows)
        length = np.linalg.norm(slope, axis=1, keepdims=True)
        lines.append((mean, np.divide(slope, length, out=np.full_like(slope, np.nan), where=length > 0.0)))
    return lines[0], lines[1]


def _corner_gap(points: Points, before: tuple[Points, Points], after: tuple[Points, Points]) -> NDArray[np.float64]:
    """Return how far each point is from where the lines of its arms pass nearest to each other."""
    (p, u), (q, v) = before, after
    cosine = (u * v).sum(axis=1)
    sine_square = np.maximum(1.0 - cosine**2, 1e-12)
    d = q - p
    s = ((d * u).sum(axis=1) - cosine * (d * v).sum(axis=1)) / sine_square
    t = (cosine * (d * u).sum(axis=1) - (d * v).sum(axis=1)) / sine_square
    meet = 0.5 * (p + s[:, None] * u + q + t[:, None] * v)
    gap = np.linalg.norm(points - meet, axis=1)
    return np.where(np.isfinite(gap), gap, np.inf)


def _shifted(values: NDArray[np.float64], by: int, closed: bool) -> NDArray[np.float64]:
    """Return the values so many rows on; beyond the ends of an open curve zero."""
    moved = np.roll(values, -by)
    if not closed:
        moved[len(values) - by if by > 0 else 0 : len(values) if by > 0 else -by] = 0.0
    return moved


def _strongest(strength: NDArray[np.float64], among: NDArray[np.bool_], apart: int, closed: bool) -> NDArray[np.int64]:
    """Choose rows by falling strength, none nearer than `apart` rows to a stronger one."""
    k = len(strength)
    chosen: list[int] = []
    blocked = ~among
    for i in np.argsort(-strength, kind="stable"):
        if blocked[i]:
            continue
        chosen.append(int(i))
        rows = np.arange(i - apart, i + apart + 1)
        blocked[rows % k if closed else rows[(rows >= 0) & (rows < k)]] = True
    return np.array(sorted(chosen), np.int64)
