"""The two sides of a crease, from the one-sided planes about a point: where they meet, and how much the surface turns there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.moments import BallPlanes
from scan2nurbs.kernels.runner import kernel, run_ranges

PLACES_PER_RANGE = 512
# The plane that differs from the point's own more than this share of its neighbours' do leads the other side.
QUANTILE = 0.9
# Sides that turn by less do not meet in a line.
LEAST_SINE = 0.05


class Meetings(NamedTuple):
    """Where the two sides about each place meet; NaN where they do not.

    Attributes
    ----------
    foot : (M, 3) float64
        The point of the line in which they meet that is nearest to the place.
    direction : (M, 3) float64
        Unit direction of that line.
    across : (M, 3) float64
        Unit vector across it, from the one side to the other: it halves the turn.
    turn : (M,) float64
        By how much the surface turns there, in radians in (0, pi).
    """

    foot: NDArray[np.float64]
    direction: NDArray[np.float64]
    across: NDArray[np.float64]
    turn: NDArray[np.float64]


def meeting_sides(cells: Cells, balls: BallPlanes, chosen: NDArray[np.int32], places: NDArray[np.int64], radius: float) -> Meetings:
    """Average the one-sided planes about some points into two sides and intersect these.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    balls : BallPlanes
        Planes of balls about every point.
    chosen : (N,) int32
        The ball that each point took its one-sided plane from; −1 for none.
    places : (M,) int64
        Sorted points to do it for.
    radius : float
        Planes of the points closer than that are averaged.
    """
    m = len(places)
    out = Meetings(np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.full(m, np.nan))
    run_ranges(lambda start, stop: _meeting_sides(cells, balls, chosen, places, float(radius), start, stop, *out), m, size=PLACES_PER_RANGE)
    return out


@kernel
def _meeting_sides(cells, balls, chosen, places, radius, start, stop, foot, direction, across, turn):
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    cosine = np.empty(1024)
    side = np.empty((2, 7))  # sums of the normals, of the planes' offsets, and of the points
    for m in range(start, stop):
        p = places[m]
        if chosen[p] < 0:
            continue
        own = balls.normal[chosen[p]]
        for k in range(3):
            low[k], high[k] = cells.points[p, k] - radius, cells.points[p, k] + radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices, cosine = np.empty(2 * room, np.int64), np.empty(2 * room)
        n = _with_plane(cells.points, chosen, p, radius, indices, points_in_box(cells.points, runs, n_runs, low, high, indices))
        for j in range(n):
            cosine[j] = abs(_dot(balls.normal[chosen[indices[j]]], own))
        leader = np.argsort(cosine[:n])[int((1.0 - QUANTILE) * n)]
        other = balls.normal[chosen[indices[leader]]]
        side[:] = 0.0
        number = np.zeros(2, np.int64)
        for j in range(n):
            ball = chosen[indices[j]]
            normal = balls.normal[ball]
            mine, theirs = _dot(normal, own), _dot(normal, other)
            s = 0 if abs(mine) >= abs(theirs) else 1
            sign = 1.0 if (mine if s == 0 else theirs) >= 0.0 else -1.0
            for k in range(3):
                side[s, k] += sign * normal[k]
                side[s, 3] += sign * normal[k] * (cells.points[ball, k] + balls.mean[ball, k] - cells.points[p, k])
                side[s, 4 + k] += cells.points[indices[j], k] - cells.points[p, k]
            number[s] += 1
        if number[0] > 0 and number[1] > 0:
            for s in range(2):
                size = np.sqrt(side[s, 0] ** 2 + side[s, 1] ** 2 + side[s, 2] ** 2)
                side[s, 0:4] /= size
                side[s, 4:7] /= number[s]
            turn[m] = _meet(side, cells.points[p], foot[m], direction[m], across[m])


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _with_plane(points, chosen, p, radius, indices, n):
    """Keep of the candidates those in the ball about p that have a one-sided plane; return how many."""
    kept = 0
    for j in range(n):
        i = indices[j]
        dx, dy, dz = points[i, 0] - points[p, 0], points[i, 1] - points[p, 1], points[i, 2] - points[p, 2]
        if chosen[i] >= 0 and dx * dx + dy * dy + dz * dz < radius * radius:
            indices[kept] = i
            kept += 1
    return kept


@kernel
def _meet(side, origin, foot, direction, across):
    """Intersect the planes of two sides: fill foot, direction and across; return the turn, NaN where they are nearly parallel."""
    a, b = side[0], side[1]
    tx, ty, tz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine = np.sqrt(tx * tx + ty * ty + tz * tz)
    if sine < LEAST_SINE:
        return np.nan
    tx, ty, tz = tx / sine, ty / sine, tz / sine
    c = _dot(a, b)
    f, g = (a[3] - c * b[3]) / (sine * sine), (b[3] - c * a[3]) / (sine * sine)
    # Directions in the planes, away from the line on the side of their own points.
    u = np.array((a[1] * tz - a[2] * ty, a[2] * tx - a[0] * tz, a[0] * ty - a[1] * tx))
    v = np.array((b[1] * tz - b[2] * ty, b[2] * tx - b[0] * tz, b[0] * ty - b[1] * tx))
    gap = a[4:7] - b[4:7]
    if _dot(u, gap) < 0.0:
        u = -u
    if _dot(v, gap) > 0.0:
        v = -v
    size = np.sqrt(((u - v) ** 2).sum())
    if not size > 1e-6:
        return np.nan
    direction[0], direction[1], direction[2] = tx, ty, tz
    for k in range(3):
        foot[k] = origin[k] + f * a[k] + g * b[k]
        across[k] = (u[k] - v[k]) / size
    return np.arccos(min(max(-_dot(u, v), -1.0), 1.0))
