"""How open the surface ends at each point: whether a whole quarter of the directions about it holds no neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import Progress, kernel, run_ranges

POINTS_PER_RANGE = 4096
SECTORS = 16
QUARTER = 4
# A quarter that is to be compared must hold so many points.
LEAST = 5.0


def openness(
    cells: Cells, normals: NDArray[np.float64], radius: NDArray[np.float64], thickness: float, *, progress: Progress | None = None
) -> NDArray[np.float64]:
    """Measure by how much the emptiest quarter about each point is emptier than the fullest.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals as lines, in sorted order; NaN where unknown.
    radius : (N,) float64
        Of the ball about each point.
    thickness : float
        Points farther than this from a point's tangent plane are on another face.
    progress : callable, optional
        Called with (points done, points).

    Returns
    -------
    (N,) float64
        1 − (points in the emptiest quarter) / (points in the fullest), in [0, 1]: near 1 at a border. 0 where there are too few to say.

    Notes
    -----
    At a crease the other face leaves the tangent plane, and its points would not be seen in the direction in which it goes on. So
    points off the plane are unfolded into it: their distance from the plane is added to how far they are in the empty direction.
    """
    out = np.zeros(len(cells.points))
    run_ranges(
        lambda start, stop: _openness(cells, normals, radius, float(thickness), start, stop, out),
        len(cells.points),
        size=POINTS_PER_RANGE,
        progress=progress,
    )
    return out


@kernel
def _openness(cells, normals, radius, thickness, start, stop, out):
    points = cells.points
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    local = np.empty((1024, 3))
    count = np.empty(SECTORS)
    for i in range(start, stop):
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        if np.isnan(n0):
            continue
        for k in range(3):
            low[k], high[k] = points[i, k] - radius[i], points[i, k] + radius[i]
        runs, n_runs, room = runs_in_box(cells, low, high, runs)
        if room > len(indices):
            indices, local = np.empty(2 * room, np.int64), np.empty((2 * room, 3))
        n = points_in_box(points, runs, n_runs, low, high, indices)
        n = _local(points, indices, n, i, n0, n1, n2, radius[i], local)
        count[:] = 0.0
        for j in range(n):
            if abs(local[j, 2]) <= thickness:
                turn = np.arctan2(local[j, 1], local[j, 0]) / (2.0 * np.pi) + 0.5
                count[min(int(turn * SECTORS), SECTORS - 1)] += 1.0
        emptiest, fullest, where = _quarters(count)
        if fullest < LEAST or emptiest > 0.5 * fullest:
            continue
        a = 2.0 * np.pi * ((where + 0.5 * QUARTER) / SECTORS - 0.5)
        gx, gy = np.cos(a), np.sin(a)
        for j in range(n):
            if abs(local[j, 2]) > thickness:
                ahead = local[j, 0] * gx + local[j, 1] * gy + abs(local[j, 2])
                if abs(local[j, 1] * gx - local[j, 0] * gy) < ahead:
                    emptiest += 1.0
        out[i] = max(1.0 - emptiest / fullest, 0.0)


@kernel
def _local(points, indices, n, i, n0, n1, n2, radius, local):
    """Write the points of the ball in a frame whose third axis is the normal."""
    # Duff et al. (2017): a frame from a normal without branches but for its sign.
    s = 1.0 if n2 >= 0.0 else -1.0
    a = -1.0 / (s + n2)
    b = n0 * n1 * a
    ux, uy, uz = 1.0 + s * n0 * n0 * a, s * b, -s * n0
    vx, vy, vz = b, s + n1 * n1 * a, -n1
    kept = 0
    for j in range(n):
        dx, dy, dz = points[indices[j], 0] - points[i, 0], points[indices[j], 1] - points[i, 1], points[indices[j], 2] - points[i, 2]
        if indices[j] != i and dx * dx + dy * dy + dz * dz < radius * radius:
            local[kept, 0] = dx * ux + dy * uy + dz * uz
            local[kept, 1] = dx * vx + dy * vy + dz * vz
            local[kept, 2] = dx * n0 + dy * n1 + dz * n2
            kept += 1
    return kept


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
