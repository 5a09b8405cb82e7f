"""The two faces that meet in a crease: their directions, how well these are known, and which way known normals point there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import kernel, run_ranges

CREASES_PER_RANGE = 512
BISECTORS = 72
ROUNDS = 3
# Fewer points than this do not tell a face's direction.
LEAST = 4


class WedgeSides(NamedTuple):
    """Both faces at each crease; NaN or −1 where a face is not seen.

    Attributes
    ----------
    turn : (M,) float64
        Radians by which the surface turns from one face to the other, in [0, π].
    turn_error : (M,) float64
        Its standard deviation.
    towards : (M, 2) float64
        Mean cosine, in [−1, 1], between the given normals on a face and that normal of the face which points to the other face's side:
        −1 on both where outward normals meet in a convex edge, +1 where in a concave one.
    component : (M, 2) int32
        The component that most of the points on each face belong to.
    """

    turn: NDArray[np.float64]
    turn_error: NDArray[np.float64]
    towards: NDArray[np.float64]
    component: NDArray[np.int32]


def wedge_sides(
    cells: Cells,
    normals: NDArray[np.float64],
    component: NDArray[np.int32],
    foot: NDArray[np.float64],
    direction: NDArray[np.float64],
    turn: NDArray[np.float64],
    radius: float,
    noise: float,
) -> WedgeSides:
    """Look at both faces of every crease.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals in sorted order, oriented alike within each component; NaN where unknown.
    component : (N,) int32
        Component of each sorted point; −1 for those whose normals do not count.
    foot, direction : (M, 3) float64
        A point of each crease and its unit direction.
    turn : (M,) float64
        First guess of the turn in radians.
    radius : float
        Of the balls about the feet.
    noise : float
        Standard deviation of the points; farther than a few of them from both faces they lose weight.

    Notes
    -----
    Seen along the crease the faces are two half-lines. The best of 72 bisectors starts an alternation between giving points to
    half-lines and fitting lines to both groups. Nothing is kept of a neighbourhood but its sums.
    """
    m = len(foot)
    result = WedgeSides(np.full(m, np.nan), np.full(m, np.nan), np.full((m, 2), np.nan), np.full((m, 2), -1, np.int32))
    run_ranges(
        lambda start, stop: _wedge_sides(
            cells, normals, component, foot, direction, turn, float(radius), float(noise) / float(radius), start, stop, *result
        ),
        m,
        size=CREASES_PER_RANGE,
    )
    return result


@kernel
def _wedge_sides(cells, normals, component, foot, direction, turn, radius, noise, start, stop, out_turn, out_error, towards, majority):
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    flat = np.empty((1024, 2))
    frame, lines, error = np.empty((2, 3)), np.empty((2, 2)), np.empty(2)
    for i in range(start, stop):
        if not (turn[i] > 0.0):
            continue
        for k in range(3):
            low[k], high[k] = foot[i, k] - radius, foot[i, k] + radius
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices, flat = np.empty(2 * room, np.int64), np.empty((2 * room, 2))
        n = points_in_box(cells.points, runs, n_runs, low, high, indices)
        _across(direction[i], frame)
        n = _flatten(cells.points, indices, n, foot[i], frame, radius, flat)
        if n < 2 * LEAST:
            continue
        _start_lines(flat, n, turn[i], lines)
        good = True
        for _ in range(ROUNDS):
            good = good and _fit_lines(flat, n, noise, lines, error)
        if not good:
            continue
        cosine = lines[0, 0] * lines[1, 0] + lines[0, 1] * lines[1, 1]
        out_turn[i] = np.pi - np.arccos(min(max(cosine, -1.0), 1.0))
        out_error[i] = np.sqrt(error[0] ** 2 + error[1] ** 2)
        _look(normals, component, indices, flat, n, noise, frame, lines, towards[i], majority[i])


@kernel
def _across(t, frame):
    """Fill two unit vectors across a direction."""
    k = 0
    for c in range(1, 3):
        if abs(t[c]) < abs(t[k]):
            k = c
    axis = np.zeros(3)
    axis[k] = 1.0
    u = np.cross(t, axis)
    frame[0] = u / np.sqrt((u * u).sum())
    frame[1] = np.cross(t, frame[0])


@kernel
def _flatten(points, indices, n, foot, frame, radius, flat):
    """Keep the points of the ball, seen along the crease, in units of its radius."""
    kept = 0
    for j in range(n):
        x, y, square = 0.0, 0.0, 0.0
        for k in range(3):
            d = (points[indices[j], k] - foot[k]) / radius
            square += d * d
            x += d * frame[0, k]
            y += d * frame[1, k]
        if square < 1.0:
            indices[kept] = indices[j]
            flat[kept, 0], flat[kept, 1] = x, y
            kept += 1
    return kept


@kernel
def _off(x, y, wx, wy):
    """Return the distance from a half-line through the origin."""
    along = x * wx + y * wy
    return abs(x * wy - y * wx) if along > 0.0 else np.sqrt(x * x + y * y)


@kernel
def _start_lines(flat, n, turn, lines):
    half, best = 0.5 * (np.pi - turn), np.inf
    for b in range(BISECTORS):
        a = 2.0 * np.pi * b / BISECTORS
        ux, uy, vx, vy = np.cos(a + half), np.sin(a + half), np.cos(a - half), np.sin(a - half)
        total = 0.0
        for j in range(n):
            total += min(_off(flat[j, 0], flat[j, 1], ux, uy), _off(flat[j, 0], flat[j, 1], vx, vy))
        if total < best:
            best = total
            lines[0, 0], lines[0, 1], lines[1, 0], lines[1, 1] = ux, uy, vx, vy


@kernel
def _fit_lines(flat, n, noise, lines, error):
    """Give each point to the nearer half-line, fit both anew, and tell how far their directions are known."""
    sums = np.zeros((2, 6))
    scale = 2.5 * max(noise, 0.02)
    for j in range(n):
        x, y = flat[j, 0], flat[j, 1]
        a, b = _off(x, y, lines[0, 0], lines[0, 1]), _off(x, y, lines[1, 0], lines[1, 1])
        k = 0 if a <= b else 1
        w = 1.0 / (1.0 + (min(a, b) / scale) ** 2) ** 2
        sums[k, 0] += w
        sums[k, 1] += w * x
        sums[k, 2] += w * y
        sums[k, 3] += w * x * x
        sums[k, 4] += w * x * y
        sums[k, 5] += w * y * y
    for k in range(2):
        mass = sums[k, 0]
        if mass < LEAST:
            return False
        mx, my = sums[k, 1] / mass, sums[k, 2] / mass
        xx, xy, yy = sums[k, 3] - mass * mx * mx, sums[k, 4] - mass * mx * my, sums[k, 5] - mass * my * my
        a = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        c, s = np.cos(a), np.sin(a)
        along, across = xx * c * c + 2.0 * xy * c * s + yy * s * s, xx * s * s - 2.0 * xy * c * s + yy * c * c
        if not along > 2.0 * across:
            return False  # a heap of points has no direction
        if c * mx + s * my < 0.0:
            c, s = -c, -s
        lines[k, 0], lines[k, 1] = c, s
        error[k] = np.sqrt(max(max(across, 0.0) / max(mass - 2.0, 1.0), 1e-8) / along)
    return True


@kernel
def _look(normals, component, indices, flat, n, noise, frame, lines, towards, majority):
    """Find the component of each face and how its normals lie to the other face."""
    near = 3.0 * max(noise, 0.03)
    for k in range(2):
        wx, wy, ox, oy = lines[k, 0], lines[k, 1], lines[1 - k, 0], lines[1 - k, 1]
        # The normal of this face on the side of the other one.
        nx, ny = -wy, wx
        if nx * ox + ny * oy < 0.0:
            nx, ny = -nx, -ny
        chosen, lead = -1, 0
        for j in range(n):
            if _off(flat[j, 0], flat[j, 1], wx, wy) < near and component[indices[j]] >= 0:
                if lead == 0:
                    chosen = component[indices[j]]
                lead += 1 if component[indices[j]] == chosen else -1
        total, count = 0.0, 0
        for j in range(n):
            i = indices[j]
            if component[i] == chosen and chosen >= 0 and _off(flat[j, 0], flat[j, 1], wx, wy) < near:
                cosine = 0.0
                for c in range(3):
                    cosine += normals[i, c] * (nx * frame[0, c] + ny * frame[1, c])
                total += cosine
                count += 1
        if count > 0:
            majority[k] = chosen
            towards[k] = total / count
