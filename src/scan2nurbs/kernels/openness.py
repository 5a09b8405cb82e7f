"""How open the surface ends at each point: whether a whole quarter of the directions about it holds no neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.candidates import COLUMNS, bounds, gather
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges

CELLS_PER_RANGE = 128
SECTORS = 16
QUARTER = 4
# At a border the mean of a ball lies 0.3 to 0.4 of its radius aside; where it lies less aside than this nothing is counted.
ASIDE = 0.15
# A quarter that is to be compared must hold so many points.
LEAST = 5.0


def openness(
    cells: Cells, normals: NDArray[np.float64], radius: float, thickness: float, *, progress: Progress | None = None
) -> NDArray[np.float32]:
    """Measure by how much the emptiest quarter about each point is emptier than the fullest.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals as lines, in sorted order; NaN where unknown.
    radius : float
        Of the ball about each point, in the points' unit.
    thickness : float
        Points farther than this from a point's tangent plane are on another face.
    progress : callable, optional
        Called with (cells done, cells).

    Returns
    -------
    (N,) float32
        1 − (points in the emptiest quarter) / (points in the fullest), in [0, 1]: near 1 at a border. 0 where there are too few to say.

    Notes
    -----
    At a crease the other face leaves the tangent plane, and its points would not be seen in the direction in which it goes on. So
    points off the plane are unfolded into it: their distance from the plane is added to how far they are in the empty direction.
    """
    out = np.zeros(len(cells.points), np.float32)
    means = ball_planes(cells, radius, progress=progress).mean
    run_ranges(
        lambda start, stop: _openness(cells, normals, means, float(radius), float(thickness), start, stop, out),
        len(cells.cell_key),
        size=CELLS_PER_RANGE,
        progress=progress,
    )
    return out


@kernel
def _openness(cells, normals, means, radius, thickness, start, stop, out):
    points = cells.points
    low, high, centre = np.empty(3), np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    table = np.empty((3, COLUMNS))
    local = np.empty((COLUMNS, 3))
    count = np.empty(SECTORS)
    scale = 1.0 / radius
    for cell in range(start, stop):
        first, end = cells.cell_start[cell], cells.cell_start[cell + 1]
        n = 0
        for i in range(first, end):
            if _aside(means[i], normals[i]) <= ASIDE * radius:
                continue
            if n == 0:
                bounds(points, first, end, low, high)
                runs, table, n = gather(cells, low, high, radius, scale, centre, runs, table)
                if n > len(local):
                    local = np.empty((2 * n, 3))
            px, py, pz = (points[i, 0] - centre[0]) * scale, (points[i, 1] - centre[1]) * scale, (points[i, 2] - centre[2]) * scale
            m = _local(table, n, px, py, pz, 1.0, normals[i], local)
            out[i] = _emptiness(local, m, thickness * scale, count)


@kernel
def _aside(mean, normal):
    """Return how far the mean of a ball lies aside of its point, along the tangent plane; 0 where its normal is unknown."""
    off = mean[0] * normal[0] + mean[1] * normal[1] + mean[2] * normal[2]
    square = mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2] - off * off
    return np.sqrt(square) if square > 0.0 else 0.0


@kernel
def _local(table, n, px, py, pz, square, normal, local):
    """Write the points of the ball, but for its own, in a frame whose third axis is the normal; return how many there are."""
    # Duff et al. (2017): a frame from a normal without branches but for its sign.
    n0, n1, n2 = normal[0], normal[1], normal[2]
    s = 1.0 if n2 >= 0.0 else -1.0
    a = -1.0 / (s + n2)
    b = n0 * n1 * a
    ux, uy, uz = 1.0 + s * n0 * n0 * a, s * b, -s * n0
    vx, vy, vz = b, s + n1 * n1 * a, -n1
    kept = 0
    for j in range(n):
        dx, dy, dz = table[0, j] - px, table[1, j] - py, table[2, j] - pz
        far = dx * dx + dy * dy + dz * dz
        if 0.0 < far < square:
            local[kept, 0] = dx * ux + dy * uy + dz * uz
            local[kept, 1] = dx * vx + dy * vy + dz * vz
            local[kept, 2] = dx * n0 + dy * n1 + dz * n2
            kept += 1
    return kept


@kernel
def _emptiness(local, n, thickness, count):
    """Compare the emptiest quarter with the fullest, other faces unfolded into the plane."""
    count[:] = 0.0
    for j in range(n):
        if abs(local[j, 2]) <= thickness:
            turn = np.arctan2(local[j, 1], local[j, 0]) / (2.0 * np.pi) + 0.5
            count[min(int(turn * SECTORS), SECTORS - 1)] += 1.0
    emptiest, fullest, where = _quarters(count)
    if fullest < LEAST or emptiest > 0.5 * fullest:
        return 0.0
    a = 2.0 * np.pi * ((where + 0.5 * QUARTER) / SECTORS - 0.5)
    gx, gy = np.cos(a), np.sin(a)
    for j in range(n):
        if abs(local[j, 2]) > thickness:
            ahead = local[j, 0] * gx + local[j, 1] * gy + abs(local[j, 2])
            if abs(local[j, 1] * gx - local[j, 0] * gy) < ahead:
                emptiest += 1.0
    return max(1.0 - emptiest / fullest, 0.0)


@kernel
def _quarters(count):
    """Return the counts of the emptiest and the fullest quarter, and the first sector of the emptiest."""
    least, most, where = np.inf, 0.0, 0
    for s in range(SECTORS):
        total = 0.0
        for k in range(QUARTER):
            total += count[(s + k) % SECTORS]
        most = max(most, total)
        if total < least:
            least, where = total, s
    return least, most, where
