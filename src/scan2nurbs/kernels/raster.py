"""The depth buffer of a scan simulator: which triangle does the ray of each pixel meet first.

Triangles come as (T, 3, 3) corners in the frame of a view: x and y in pixels, z the distance from the scanner in any unit. The ray of
pixel (row, column) is parallel to z and passes through its centre, moved by a reproducible share of a pixel (`jitter` times a number in
[−1, 1) drawn from `seed` and the pixel), so that the measured points do not stand in perfect rows.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel

_EDGE = 1e-9
"""How far outside a triangle, in barycentric weight, a ray still meets it: no ray falls between two neighbours."""


@kernel
def _wobble(seed: int, row: int, column: int, axis: int) -> float:
    """Return a number in [−1, 1) that depends on its arguments only (SplitMix64, Steele et al. 2014)."""
    z = np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15) * (
        np.uint64(1) + np.uint64(row) * np.uint64(0x100000001B3) + np.uint64(column) * np.uint64(2) + np.uint64(axis)
    )
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.float64(z >> np.uint64(11)) * (2.0 / 9007199254740992.0) - 1.0


@kernel
def _ray(seed: int, jitter: float, row: int, column: int) -> tuple[float, float]:
    x = column + 0.5 + jitter * _wobble(seed, row, column, 0)
    y = row + 0.5 + jitter * _wobble(seed, row, column, 1)
    return x, y


@kernel
def _weights(triangle: NDArray[np.float64], x: float, y: float) -> tuple[float, float, float]:
    """Return the barycentric weights of (x, y) in the plane of the pixels; NaN or infinite where the triangle is seen edge-on."""
    ax, ay = triangle[0, 0], triangle[0, 1]
    bx, by = triangle[1, 0] - ax, triangle[1, 1] - ay
    cx, cy = triangle[2, 0] - ax, triangle[2, 1] - ay
    determinant = bx * cy - cx * by
    w1 = ((x - ax) * cy - cx * (y - ay)) / determinant
    w2 = (bx * (y - ay) - (x - ax) * by) / determinant
    return 1.0 - w1 - w2, w1, w2


@kernel
def depth_range(
    triangles: NDArray[np.float64],
    seed: int,
    jitter: float,
    start: int,
    stop: int,
    depth: NDArray[np.float64],
    hit: NDArray[np.int32],
) -> None:
    """Find the nearest triangle for the pixels in rows [start, stop).

    Parameters
    ----------
    triangles : (T, 3, 3) float64
    seed, jitter : int, float
        Of the rays.
    depth : (rows, columns) float64
        In: infinity; out: z of the nearest triangle. Of two at the same depth the earlier wins.
    hit : (rows, columns) int32
        In: −1; out: the nearest triangle.
    """
    columns = depth.shape[1]
    for t in range(len(triangles)):
        corners = triangles[t]
        low_y = min(corners[0, 1], corners[1, 1], corners[2, 1])
        high_y = max(corners[0, 1], corners[1, 1], corners[2, 1])
        first_row = max(start, math.floor(low_y - 0.5 - jitter))
        last_row = min(stop - 1, math.ceil(high_y - 0.5 + jitter))
        if first_row > last_row:
            continue
        low_x = min(corners[0, 0], corners[1, 0], corners[2, 0])
        high_x = max(corners[0, 0], corners[1, 0], corners[2, 0])
        first_column = max(0, math.floor(low_x - 0.5 - jitter))
        last_column = min(columns - 1, math.ceil(high_x - 0.5 + jitter))
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                x, y = _ray(seed, jitter, row, column)
                w0, w1, w2 = _weights(corners, x, y)
                # NaN and infinity, the weights of an edge-on triangle, fail this.
                if w0 >= -_EDGE and w1 >= -_EDGE and w2 >= -_EDGE:
                    z = w0 * corners[0, 2] + w1 * corners[1, 2] + w2 * corners[2, 2]
                    if z < depth[row, column]:
                        depth[row, column] = z
                        hit[row, column] = t


@kernel
def weights_range(
    triangles: NDArray[np.float64],
    seed: int,
    jitter: float,
    columns: int,
    pixel: NDArray[np.int64],
    triangle: NDArray[np.int64],
    start: int,
    stop: int,
    weight: NDArray[np.float64],
) -> None:
    """Write the barycentric weights, (N, 3), at which the rays of pixels (flat indices) meet triangles."""
    for k in range(start, stop):
        x, y = _ray(seed, jitter, pixel[k] // columns, pixel[k] % columns)
        w0, w1, w2 = _weights(triangles[triangle[k]], x, y)
        w0, w1, w2 = max(w0, 0.0), max(w1, 0.0), max(w2, 0.0)
        total = w0 + w1 + w2
        weight[k, 0], weight[k, 1], weight[k, 2] = w0 / total, w1 / total, w2 / total


@kernel
def count_range(triangles: NDArray[np.float64], seed: int, jitter: float, start: int, stop: int, count: NDArray[np.int64]) -> None:
    """Count the rays that meet each triangle, occluded or not."""
    for t in range(start, stop):
        count[t] = _collect(triangles[t], seed, jitter, np.empty((0, 3)), 0, False)


@kernel
def collect_range(
    triangles: NDArray[np.float64],
    seed: int,
    jitter: float,
    first: NDArray[np.int64],
    start: int,
    stop: int,
    weight: NDArray[np.float64],
) -> None:
    """Write the weights of all rays that meet triangle t to the rows of `weight` from ``first[t]`` on."""
    for t in range(start, stop):
        _collect(triangles[t], seed, jitter, weight, first[t], True)


@kernel
def _collect(corners: NDArray[np.float64], seed: int, jitter: float, weight: NDArray[np.float64], row_out: int, write: bool) -> int:
    low_y = min(corners[0, 1], corners[1, 1], corners[2, 1])
    high_y = max(corners[0, 1], corners[1, 1], corners[2, 1])
    low_x = min(corners[0, 0], corners[1, 0], corners[2, 0])
    high_x = max(corners[0, 0], corners[1, 0], corners[2, 0])
    found = 0
    for row in range(math.floor(low_y - 0.5 - jitter), math.ceil(high_y - 0.5 + jitter) + 1):
        for column in range(math.floor(low_x - 0.5 - jitter), math.ceil(high_x - 0.5 + jitter) + 1):
            x, y = _ray(seed, jitter, row, column)
            w0, w1, w2 = _weights(corners, x, y)
            # Exact at the edges: a point on two triangles' common edge is an event of probability zero.
            if w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
                if write:
                    weight[row_out + found, 0], weight[row_out + found, 1], weight[row_out + found, 2] = w0, w1, w2
                found += 1
    return found


@kernel
def lit(
    point: NDArray[np.float64],
    slope: float,
    view: int,
    frames: NDArray[np.float64],
    low: NDArray[np.float64],
    shape: NDArray[np.int64],
    offset: NDArray[np.int64],
    depth: NDArray[np.float32],
    pitch: float,
) -> bool:
    """Tell whether a view sees a point: whether it lies no deeper than what the ray of its pixel meets.

    Along a border the answer errs by up to half a pixel, to either side alike. `slope` is the tangent of the incidence, which says how
    far the depth may differ between the point and that ray.
    """
    x = (frames[view, 0, 0] * point[0] + frames[view, 0, 1] * point[1] + frames[view, 0, 2] * point[2] - low[view, 0]) / pitch
    y = (frames[view, 1, 0] * point[0] + frames[view, 1, 1] * point[1] + frames[view, 1, 2] * point[2] - low[view, 1]) / pitch
    z = -(frames[view, 2, 0] * point[0] + frames[view, 2, 1] * point[1] + frames[view, 2, 2] * point[2])
    column, row = math.floor(x), math.floor(y)
    if row < 0 or column < 0 or row >= shape[view, 0] or column >= shape[view, 1]:
        return False
    # A ray strays from the middle of its pixel, and the point too: up to a pixel apart in both directions.
    return z - pitch * (1.5 * slope + 0.5) <= depth[offset[view] + row * shape[view, 1] + column] < np.inf


@kernel
def measured_range(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    sheet: NDArray[np.bool_],
    view: int,
    limit: float,
    eyes: int,
    projectors: bool,
    thin: bool,
    frames: NDArray[np.float64],
    low: NDArray[np.float64],
    shape: NDArray[np.int64],
    offset: NDArray[np.int64],
    depth: NDArray[np.float32],
    pitch: float,
    start: int,
    stop: int,
    out: NDArray[np.bool_],
) -> None:
    """Tell which points that the eye of `view` sees are measured from there.

    Parameters
    ----------
    points, normals : (N, 3) float64
        The normals point to the side that the eye sees.
    sheet : (N,) bool
        Whether a point lies on a face with nothing behind it, so that a view from the other side measures the same place.
    view : int
        The view that sees them.
    limit : float
        Cosine of the largest incidence.
    eyes : int
        Number of views; where `projectors`, the maps from there on are those of the views' projectors.
    thin : bool
        Whether a point is left to the view that sees it most squarely.
    frames, low, shape, offset, depth, pitch :
        The depth maps, one after the other in `depth`: rows of the frame, lower corner, size, start.
    out : (N,) bool
    """
    for k in range(start, stop):
        own = _cosine(normals[k], frames[view])
        taken = own >= limit
        if taken and projectors:
            cosine = _cosine(normals[k], frames[eyes + view])
            taken = cosine > 0.02 and lit(points[k], _slope(cosine), eyes + view, frames, low, shape, offset, depth, pitch)
        if taken and thin:
            for other in range(eyes):
                cosine = _cosine(normals[k], frames[other])
                if sheet[k]:
                    cosine = abs(cosine)
                if other == view or cosine < own or (cosine == own and other > view):
                    continue
                if not lit(points[k], _slope(cosine), other, frames, low, shape, offset, depth, pitch):
                    continue
                if projectors:
                    facing = math.copysign(1.0, _cosine(normals[k], frames[other]))
                    cosine = facing * _cosine(normals[k], frames[eyes + other])
                    if cosine <= 0.02 or not lit(points[k], _slope(cosine), eyes + other, frames, low, shape, offset, depth, pitch):
                        continue
                taken = False
                break
        out[k] = taken


@kernel
def _cosine(normal: NDArray[np.float64], frame: NDArray[np.float64]) -> float:
    return normal[0] * frame[2, 0] + normal[1] * frame[2, 1] + normal[2] * frame[2, 2]


@kernel
def _slope(cosine: float) -> float:
    return math.sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine
