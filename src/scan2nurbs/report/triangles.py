"""Triangles seen from one side, pixel by pixel: every pixel within them is covered, and the nearest triangle stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.report.view import Raster, View, lit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_PAD = 0.02
"""Pixels by which triangles are wider than they are, so that faces whose triangles meet within rounding show no seam."""

_AT_ONCE = 1 << 21
"""Pixels of triangles at a time: bounds the memory where many lie behind each other."""

_CREASE = np.cos(np.radians(50.0))
"""Facets of a face that meet more sharply are shaded each for itself."""


def rasterise_triangles(corners: Array, face: NDArray[np.int32], view: View, *, width: int, height: int) -> Raster:
    """Draw triangles, nearer ones over farther ones; of two at the same place the first stays.

    Parameters
    ----------
    corners : (T, 3, 3) float64
        The triangles.
    face : (T,) int32
        The face of each: within a face the shading is smooth.

    Returns
    -------
    Raster
        `index` holds triangles.
    """
    seen = view.project(corners.reshape(-1, 3)).reshape(-1, 3, 3)
    seen[:, :, :2] = (seen[:, :, :2] - view.low) / ((view.high - view.low) / (width, height))
    first, second = seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0]
    twice = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    drawn = np.abs(twice) > 1e-9  # the others are seen from their edge
    inverse = np.divide(1.0, twice, out=np.zeros(len(seen)), where=drawn)
    across = (first[:, 2] * second[:, 1] - second[:, 2] * first[:, 1]) * inverse
    upwards = (first[:, 0] * second[:, 2] - second[:, 0] * first[:, 2]) * inverse
    bottom, top = seen[:, :, 2].min(axis=1), seen[:, :, 2].max(axis=1)

    nearness = np.full(width * height, -np.inf)
    index = np.full(width * height, -1, np.int64)
    owner, row, column, count = _spans(seen, np.flatnonzero(drawn), width, height)
    depth = seen[owner, 0, 2] + across[owner] * (column + 0.5 - seen[owner, 0, 0]) + upwards[owner] * (row + 0.5 - seen[owner, 0, 1])
    slope, low, high, start = across[owner], bottom[owner], top[owner], row * width + column
    total = np.cumsum(count)
    cuts = np.searchsorted(total, np.arange(_AT_ONCE, total[-1] if len(total) else 0, _AT_ONCE))
    for piece in np.split(np.arange(len(owner)), cuts):
        span, step = _repeat(count[piece])
        span += piece[0] if len(piece) else 0
        place = start[span] + step
        # A pixel's centre may lie a little outside its triangle.
        near = np.clip(depth[span] + slope[span] * step, low[span], high[span])
        before = nearness[place]
        np.maximum.at(nearness, place, near)
        ahead = np.flatnonzero((near == nearness[place]) & (near > before))[::-1]  # of equals the first is written last
        index[place[ahead]] = owner[span[ahead]]

    known = np.flatnonzero(index >= 0)
    triangle = index[known]
    away = np.stack([known % width, known // width], axis=1) + 0.5 - seen[triangle, 0, :2]
    weight = np.empty((len(known), 3))
    weight[:, 1] = (away[:, 0] * second[triangle, 1] - away[:, 1] * second[triangle, 0]) * inverse[triangle]
    weight[:, 2] = (away[:, 1] * first[triangle, 0] - away[:, 0] * first[triangle, 1]) * inverse[triangle]
    weight[:, 0] = 1.0 - weight[:, 1] - weight[:, 2]
    normal = np.einsum("ni,nij->nj", np.clip(weight, 0.0, 1.0), _corner_normals(corners, face)[triangle]) @ view.axes.T
    shade = np.ones(width * height)
    shade[known] = lit(normal)
    size = (height, width)
    return Raster(index.reshape(size), nearness.reshape(size), shade.reshape(size), slack=0.004 * float(view.high[0] - view.low[0]))


def _spans(seen: Array, chosen: Ints, width: int, height: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Return the pixels whose centres lie in triangles, row by row: triangle, row, first column, and how many."""
    order = np.argsort(seen[chosen, :, 1], axis=1, kind="stable")
    corner = np.take_along_axis(seen[chosen, :, :2], order[:, :, None], axis=1)
    start = np.maximum(np.ceil(corner[:, 0, 1] - 0.5 - _PAD), 0).astype(np.int64)
    stop = np.minimum(np.floor(corner[:, 2, 1] - 0.5 + _PAD), height - 1).astype(np.int64)
    which, step = _repeat(np.maximum(stop - start + 1, 0))
    row = start[which] + step
    low, mid, high = corner[which].transpose(1, 0, 2)
    y: Array = np.clip(row + 0.5, low[:, 1], high[:, 1]).astype(np.float64)
    upper = y >= mid[:, 1]
    # The same edge of two triangles runs from the same end to the same end.
    ends = _along(low, high, y), _along(np.where(upper[:, None], mid, low), np.where(upper[:, None], high, mid), y)
    left = np.maximum(np.ceil(np.minimum(*ends) - 0.5 - _PAD), 0).astype(np.int64)
    right = np.minimum(np.floor(np.maximum(*ends) - 0.5 + _PAD), width - 1).astype(np.int64)
    count = np.maximum(right - left + 1, 0)
    some = count > 0
    return chosen[which[some]], row[some], left[some], count[some]


def _along(start: Array, end: Array, y: Array) -> Array:
    rise = end[:, 1] - start[:, 1]
    share = np.divide(y - start[:, 1], rise, out=np.zeros(len(y)), where=rise > 0.0)
    return start[:, 0] + share * (end[:, 0] - start[:, 0])


def _repeat(count: Ints) -> tuple[Ints, Ints]:
    """Return each index as often as `count` says, and which of its repetitions each is."""
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)


def _corner_normals(corners: Array, face: NDArray[np.int32]) -> Array:
    """Return a unit normal at each corner (T, 3, 3): the mean of those of the face's facets there, where they meet smoothly."""
    facet = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = corners.reshape(-1, 3)
    extent = float(np.ptp(flat, axis=0).max(initial=0.0)) if len(flat) else 0.0
    whole = np.round((flat - flat.min(axis=0, initial=np.inf)) / (extent or 1.0) * 1e9).astype(np.int64)
    key = np.column_stack([np.repeat(face, 3), whole])
    order = np.lexsort(key.T)
    new = np.ones(len(key), np.bool_)
    new[1:] = np.any(key[order[1:]] != key[order[:-1]], axis=1)
    node = np.empty(len(key), np.int64)
    node[order] = np.cumsum(new) - 1
    weights = np.repeat(facet, 3, axis=0)  # as long as twice the area
    total: Array = np.stack([np.bincount(node, weights[:, axis]) for axis in range(3)], axis=1, dtype=np.float64)
    mean, own = _unit(total)[node], _unit(weights)
    return np.where((np.einsum("ni,ni->n", mean, own) > _CREASE)[:, None], mean, own).reshape(-1, 3, 3)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
