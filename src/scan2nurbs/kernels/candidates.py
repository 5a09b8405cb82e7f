"""Copies of the points that a block of neighbouring points may need: the tables under every sum over a ball."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.cells import runs_in_box
from scan2nurbs.kernels.runner import inlined, summing

LANES = 32
"""Columns of a table come in multiples of this: whole vectors are several times faster than what is left over after the last one."""
COLUMNS = 33 * LANES
"""Columns of a table to begin with."""
RUN = 256
"""Points that are copied at once."""
FAR = 1e9
"""Coordinate of the points that fill up the last vector, in the caller's unit."""


@summing
def gather(cells, low, high, reach, scale, centre, runs, table):
    """Copy the points within reach of a box, as rows x, y, z relative to the box's centre.

    Parameters
    ----------
    cells : Cells
    low, high : (3,) float64
        Corners of the box; they come back moved apart by the reach.
    reach : float
        In the points' unit.
    scale : float
        What the copies are multiplied by.
    centre : (3,) float64
        Receives the centre of the box.
    runs : (K, 2) int64
        Scratch; a larger array is returned where it is too small.
    table : (3, M) float64
        Receives the points; a larger array is returned where it is too small.

    Returns
    -------
    runs, table : arrays
    n : int
        How many columns are filled: a multiple of `LANES`, the last ones with points far away.
    """
    points = cells.points
    half = np.empty(3)
    for k in range(3):
        centre[k] = 0.5 * (low[k] + high[k])
        half[k] = 0.5 * (high[k] - low[k])
        low[k] -= reach
        high[k] += reach
    runs, n_runs, room = runs_in_box(cells, low, high, runs)
    if room + LANES > table.shape[1]:
        # An odd number of vectors a row: rows a power of two apart would share the same few lines of the cache.
        table = np.empty((table.shape[0], (2 * room // LANES | 1) * LANES), table.dtype)
    x, y, z = table[0], table[1], table[2]
    cx, cy, cz, hx, hy, hz = centre[0], centre[1], centre[2], half[0], half[1], half[2]
    limit, n = reach * reach, np.uint64(0)
    for r in range(n_runs):
        run = points[runs[r, 0] : runs[r, 1]]
        for i in range(len(run)):
            dx, dy, dz = run[i, 0] - cx, run[i, 1] - cy, run[i, 2] - cz
            x[n], y[n], z[n] = dx * scale, dy * scale, dz * scale
            gx, gy, gz = abs(dx) - hx, abs(dy) - hy, abs(dz) - hz
            gx, gy, gz = (gx if gx > 0.0 else 0.0), (gy if gy > 0.0 else 0.0), (gz if gz > 0.0 else 0.0)
            n += np.uint64(gx * gx + gy * gy + gz * gz <= limit)
    return runs, table, _fill_up(x, y, z, np.int64(n))


@inlined
def _fill_up(x, y, z, n):
    """Fill up the last vector with points far away; return the number of columns then."""
    filled = -(-n // LANES) * LANES
    for j in range(n, filled):
        x[j], y[j], z[j] = FAR, FAR, FAR
    return filled


@summing
def gather_ball(cells, low, high, inner, reach, scale, centre, runs, table):
    """Copy the points within reach of a box, as rows x, y, z relative to its centre; those that any ball about it holds come last.

    Parameters
    ----------
    cells : Cells
    low, high : (3,) float64
        Corners of the box; they come back moved apart by the reach.
    inner, reach : float
        Radii, in the points' unit: points nearer than `inner` to every point of the box come last, points farther than `reach` from
        all of it are left out.
    scale : float
        What the copies are multiplied by.
    centre : (3,) float64
        Receives the centre of the box.
    runs : (K, 2) int64
        Scratch; a larger array is returned where it is too small.
    table : (R, M) float32
        Its first three rows receive the points; a larger array is returned where it is too small.

    Returns
    -------
    runs, table : arrays
    border, filled : int
        Columns up to `border` hold the points that some balls hold, those from there up to `filled` what all of them hold; both are
        multiples of `LANES`, filled up with points far away.
    """
    points = cells.points
    half = np.empty(3)
    for k in range(3):
        centre[k] = 0.5 * (low[k] + high[k])
        half[k] = 0.5 * (high[k] - low[k])
        low[k] -= reach
        high[k] += reach
    runs, n_runs, room = runs_in_box(cells, low, high, runs)
    if room + 2 * LANES > table.shape[1]:
        # An odd number of vectors a row: rows a power of two apart would share the same few lines of the cache.
        table = np.empty((table.shape[0], (2 * room // LANES + 2 | 1) * LANES), table.dtype)
    x, y, z = table[0], table[1], table[2]
    place = (centre[0], centre[1], centre[2], scale)
    box = (np.float32(half[0] * scale), np.float32(half[1] * scale), np.float32(half[2] * scale))
    outer_limit, inner_limit = np.float32((reach * scale) ** 2), np.float32((inner * scale) ** 2)
    near_x, near_y, near_z = np.empty(RUN, np.float32), np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    kind = np.empty(RUN, np.int32)
    left, right, last = np.uint64(0), np.uint64(table.shape[1] - 1), np.uint64(table.shape[1] - 1)
    for r in range(n_runs):
        for start in range(runs[r, 0], runs[r, 1], RUN):
            run = points[start : min(start + RUN, runs[r, 1])]
            _copy(run, place, near_x, near_y, near_z)
            _sort_out(len(run), near_x, near_y, near_z, box, outer_limit, inner_limit, kind)
            left, right = _split(len(run), near_x, near_y, near_z, kind, left, right, x, y, z)
    border = _fill_up(x, y, z, np.int64(left))
    n = border
    for j in range(np.int64(right) + 1, np.int64(last) + 1):
        x[n], y[n], z[n] = x[j], y[j], z[j]
        n += 1
    return runs, table, border, _fill_up(x, y, z, n)


@inlined
def _copy(run, place, x, y, z):
    """Copy a run of points about a place."""
    cx, cy, cz, scale = place
    for j in range(len(run)):
        x[j] = np.float32((run[j, 0] - cx) * scale)
        y[j] = np.float32((run[j, 1] - cy) * scale)
        z[j] = np.float32((run[j, 2] - cz) * scale)


@inlined
def _sort_out(n, x, y, z, box, outer_limit, inner_limit, kind):
    """Tell the kinds of copied points: 2 inside of all balls about points of the box, 1 inside of some, 0 outside."""
    hx, hy, hz = box
    zero = np.float32(0.0)
    for j in range(n):
        ax, ay, az = abs(x[j]), abs(y[j]), abs(z[j])
        gx, gy, gz, fx, fy, fz = ax - hx, ay - hy, az - hz, ax + hx, ay + hy, az + hz
        gx, gy, gz = (gx if gx > zero else zero), (gy if gy > zero else zero), (gz if gz > zero else zero)
        near = np.int32(1) if gx * gx + gy * gy + gz * gz <= outer_limit else np.int32(0)
        kind[j] = np.int32(2) if fx * fx + fy * fy + fz * fz < inner_limit else near


@inlined
def _split(n, x, y, z, kind, left, right, to_x, to_y, to_z):
    """Append the points of kind 1 at the left of the rows, those of kind 2 at their right."""
    # Unsigned numbers: a signed one might count from the end.
    one = np.uint64(1)
    for j in range(n):
        inner = np.uint64(kind[j]) >> one
        at = right if inner else left
        to_x[at], to_y[at], to_z[at] = x[j], y[j], z[j]
        left += np.uint64(kind[j]) & one
        right -= inner
    return left, right


@summing
def list_near(points, runs, n_runs, centre, half, reach, indices):
    """List the points of the runs that lie within reach of a box; `indices` has room for all of them. Return how many there are."""
    near_x, near_y, near_z = np.empty(RUN, np.float32), np.empty(RUN, np.float32), np.empty(RUN, np.float32)
    kind = np.empty(RUN, np.int32)
    place = (centre[0], centre[1], centre[2], 1.0 / reach)
    box = (np.float32(half[0] / reach), np.float32(half[1] / reach), np.float32(half[2] / reach))
    n = np.uint64(0)
    for r in range(n_runs):
        for start in range(runs[r, 0], runs[r, 1], RUN):
            run = points[start : min(start + RUN, runs[r, 1])]
            _copy(run, place, near_x, near_y, near_z)
            _sort_out(len(run), near_x, near_y, near_z, box, np.float32(1.0), np.float32(0.0), kind)
            for j in range(len(run)):
                indices[n] = start + j
                n += np.uint64(kind[j])
    return np.int64(n)


@summing
def bounds(points, start, stop, low, high):
    """Write the bounding box of ``points[start:stop]`` into `low` and `high`."""
    for k in range(3):
        low[k], high[k] = points[start, k], points[start, k]
    for i in range(start + 1, stop):
        for k in range(3):
            low[k] = min(low[k], points[i, k])
            high[k] = max(high[k], points[i, k])
