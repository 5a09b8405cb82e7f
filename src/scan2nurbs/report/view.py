"""From which side to look at points, and what is seen from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, generate_binary_structure, maximum_filter, minimum_filter

_GAP, _BEHIND = 1.5, 3.0
"""Radii of a point's disc: how wide on either side gaps between discs are closed, and how far behind something seen in one must lie."""


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Attributes
    ----------
    axes : (3, 3) float64
        Rows: right, up, and towards the eye; orthonormal, right-handed.
    low, high : (2,) float64
        Corners of the picture along right and up, in the points' unit.
    """

    axes: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return right, up and nearness of (N, 3) points."""
        return points @ self.axes.T

    def framed(self, points: NDArray[np.float64]) -> View:
        """Return the same direction of view with `points` filling the picture, strays aside."""
        flat = _without_strays(points) @ self.axes[:2].T
        low, high = flat.min(axis=0), flat.max(axis=0)
        margin = 0.04 * float((high - low).max()) or 1.0
        return View(self.axes, low - margin, high + margin)


def choose_view(points: NDArray[np.float64]) -> View:
    """Look at points from where their shape shows: on their broad side, from a little aside, more so the bulkier they are.

    Parameters
    ----------
    points : (N, 3) float64
        A few stray points do not matter: the frame leaves out the outermost thousandth.
    """
    inner = _without_strays(points)
    values, vectors = np.linalg.eigh(np.cov(inner.T))
    long, broad, thin = vectors[:, ::-1].T
    bulk = np.sqrt(max(values[0], 0.0) / values[1]) if values[1] > 0 else 0.0
    thin = thin * _sign(thin[[2, 1, 0]])
    if abs(long[2]) > 0.8:  # what stands upright is shown so
        long, broad = broad, long
    long = long * _sign(long)
    broad = np.cross(thin, long)
    eye = thin + (0.2 + 0.35 * bulk) * long - (0.3 + 0.35 * bulk) * broad
    eye /= np.linalg.norm(eye)
    up = broad - (broad @ eye) * eye
    up /= np.linalg.norm(up)
    return View(np.stack([np.cross(up, eye), up, eye]), np.zeros(2), np.zeros(2)).framed(points)


def _without_strays(points: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = np.quantile(points, [0.001, 0.999], axis=0)
    margin = 0.05 * (high - low).max()
    inner = points[((points >= low - margin) & (points <= high + margin)).all(axis=1)]
    return inner if len(inner) >= 3 else points


def _sign(vector: NDArray[np.float64]) -> float:
    """Return the sign of the first component that is not small, so that views do not flip between runs."""
    return float(np.sign(vector[np.argmax(np.abs(vector) > 0.3)])) or 1.0


@dataclass(frozen=True)
class Raster:
    """What is seen, pixel by pixel.

    Attributes
    ----------
    index : (height, width) int64
        The point or triangle that is seen, −1 where none is; row 0 is the lowest.
    nearness : (height, width) float64
        Of what is seen there to the eye, in the points' unit; −inf where nothing is.
    shade : (height, width) float64
        Brightness in [0, 1] of a surface lit from the upper left.
    slack : float
        How far behind what is seen something may lie, in the points' unit, and count as lying on it.
    """

    index: NDArray[np.int64]
    nearness: NDArray[np.float64]
    shade: NDArray[np.float64]
    slack: float


def places(raster: Raster, view: View) -> NDArray[np.float64]:
    """Return the place in space (N, 3) that is seen at each pixel with something, row by row."""
    height, width = raster.index.shape
    row, column = np.nonzero(raster.index >= 0)
    across = (np.stack([column, row], axis=1) + 0.5) * ((view.high - view.low) / (width, height)) + view.low
    return np.column_stack([across, raster.nearness[row, column]]) @ view.axes


def rasterise(points: NDArray[np.float64], view: View, *, width: int, height: int) -> Raster:
    """Draw points as discs that just touch, nearer ones over farther ones; what lies behind them does not show in gaps."""
    seen = view.project(points)
    pixel = (view.high - view.low) / (width, height)
    column, row = ((seen[:, :2] - view.low) / pixel).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    # Sorted from far to near: where several points fall on a pixel, the last, that is the nearest, stays.
    order = np.argsort(seen[:, 2], kind="stable")
    order = order[inside[order]]
    column, row = column[order].astype(np.int64), row[order].astype(np.int64)
    rank = np.full((height, width), -1, np.int64)
    radius = _radius(column, row)
    for across, upwards in _disc(radius):
        x, y = np.clip(column + across, 0, width - 1), np.clip(row + upwards, 0, height - 1)
        layer = np.full((height, width), -1, np.int64)
        layer[y, x] = np.arange(len(order))
        np.maximum(rank, layer, out=rank)
    depth = np.append(seen[order, 2], -np.inf)  # −1 is no point
    closed = _close(rank, int(np.ceil(_GAP * radius)))
    rank = np.where((rank < 0) | (depth[closed] > depth[rank] + _BEHIND * radius * pixel[0]), closed, rank)
    nearness = depth[rank]
    index = np.append(order, -1)[rank]
    return Raster(index, nearness, _shade(nearness, float(pixel[0])), slack=0.03 * float(view.high[0] - view.low[0]))


def _radius(column: NDArray[np.int64], row: NDArray[np.int64]) -> float:
    """Return the radius in pixels of discs as wide as the points lie apart on the picture."""
    tile = 8
    covered = len(np.unique((column // tile) * 100_000 + row // tile)) * tile**2
    return float(min(max(1.15 * np.sqrt(covered / max(len(column), 1)), 0.8), 8.0))


def _disc(radius: float) -> list[tuple[int, int]]:
    reach = range(-int(radius), int(radius) + 1)
    return [(x, y) for x in reach for y in reach if x * x + y * y <= radius * radius]


def _close(rank: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Close what is no wider than an octagon of `reach` pixels on either side: one is a square grown by crosses, which is quicker."""
    edge, cross = 2 * (reach - reach // 2) + 1, generate_binary_structure(2, 1)
    grown = maximum_filter(rank, edge)
    for _ in range(reach // 2):
        grown = maximum_filter(grown, footprint=cross)
    for _ in range(reach // 2):
        grown = minimum_filter(grown, footprint=cross)
    return np.asarray(minimum_filter(grown, edge), np.int64)


def _shade(nearness: NDArray[np.float64], pixel: float) -> NDArray[np.float64]:
    """Light the smoothed surface behind the pixels; smoothing keeps noise from looking like relief."""
    known = np.isfinite(nearness)
    weight = gaussian_filter(known.astype(np.float64), 3.0)
    base = float(nearness[known].mean()) if known.any() else 0.0
    smooth = base + gaussian_filter(np.where(known, np.where(known, nearness, base) - base, 0.0), 3.0) / np.maximum(weight, 1e-6)
    slope_up, slope_right = np.gradient(smooth, pixel)
    normal = np.stack([-slope_right, -slope_up, np.ones_like(smooth)], axis=-1)
    return np.where(known, lit(normal), 1.0)


def lit(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how bright surfaces are, from 0 to 1, by their normals (..., 3) along right, up and towards the eye; they have no back."""
    light = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([0.45, 0.55, 0.7])
    length = np.maximum(np.linalg.norm(normal, axis=-1), 1e-300)
    facing = np.where(normal[..., 2] < 0.0, -1.0, 1.0) * (normal @ light) / length
    darkest = -np.hypot(light[0], light[1])  # what turns away from the light keeps its relief too
    return np.clip((facing - darkest) / (1.0 - darkest), 0.0, 1.0)
