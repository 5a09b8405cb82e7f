"""Plane points on a raster: their local spacing, the set they cover once gaps are closed, and how far it falls short of the border."""

from __future__ import annotations

import numpy as np
from contourpy import LineType, contour_generator
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

Array = NDArray[np.float64]
Labels = NDArray[np.int32]
Mask = NDArray[np.bool_]

# Spacing is averaged over this many cells of the coarse raster, whose cells hold this many fine ones a side.
_COARSE, _BLUR = 4, 2.0
# Where points are sparser than 3 spacings, they no longer sample the face.
_SPARSEST = 3.0
# The margin, in local spacings, at borders of grids and of random points with up to half a spacing of noise: mean and spread.
_MARGIN, _MARGIN_SPREAD = 0.47, 0.12


class Raster:
    """Points counted in cells, and what follows from the counts."""

    def __init__(self, points: Array, low: Array, cell: Array, shape: tuple[int, int]) -> None:
        column, row = np.round((points - low) / cell).astype(np.int64).T
        flat = np.clip(row, 0, shape[0] - 1) * shape[1] + np.clip(column, 0, shape[1] - 1)
        n = shape[0] * shape[1]
        count = np.bincount(flat, minlength=n)
        share = np.maximum(count, 1)
        self.count = count.reshape(shape)
        self.mean_x = (np.bincount(flat, points[:, 0], n) / share).reshape(shape)
        self.mean_y = (np.bincount(flat, points[:, 1], n) / share).reshape(shape)
        self.points, self.low, self.cell, self.shape = points, low, cell, shape
        self.x = low[0] + cell[0] * np.arange(shape[1])
        self.y = low[1] + cell[1] * np.arange(shape[0])

    def local_spacing(self, h: float) -> Array:
        """Return 1/sqrt(density), the density taken over the covered area only, at least h."""
        reached = _distance(self.count == 0, self.cell) < 1.6 * h  # between two distances of cells
        covered = ndimage.binary_erosion(reached, iterations=2)
        points, area = _blocks(self.count), _blocks(covered) * self.cell.prod()
        mass = ndimage.gaussian_filter(points, _BLUR, mode="constant")
        cover = ndimage.gaussian_filter(area, _BLUR, mode="constant")
        # Beyond the reach of the blur nothing is known, nor asked.
        local = np.sqrt(np.divide(cover, mass, out=np.full_like(mass, h**2), where=mass > 1e-6 * mass.max()))
        return np.clip(_unblock(local, self.shape), h, _SPARSEST * h)

    def regularity(self, spacing: Array) -> float:
        """Return 0 for points as random as rain, 1 for a grid's, from the mean nearest distance (Clark and Evans 1954)."""
        step = max(len(self.points) // 2000, 1)
        some = self.points[np.lexsort(self.points.T)[::step]]
        nearest = KDTree(self.points).query(some, 2)[0][:, 1]
        ratio = float(np.mean(nearest / (0.5 * value_at(spacing, self.low, self.cell, some))))
        return float(np.clip((ratio - 1.1) / 0.4, 0.0, 1.0))

    def closing(self, radius: Array) -> tuple[Array, Array]:
        """Return how deep each cell lies inside the closed set (negative outside), and its distance to the nearest point."""
        place = np.zeros((2, *self.shape), np.int32)
        ndimage.distance_transform_edt(
            self.count == 0, sampling=_ratio(self.cell), return_distances=False, return_indices=True, indices=place
        )
        row, column = place
        void = np.hypot(self.mean_x[row, column] - self.x[None, :], self.mean_y[row, column] - self.y[:, None])
        rim = rim_points(radius - void, self.low, self.cell)
        inside = void < radius
        depth = _distance(inside, self.cell) - radius
        # Exact only where the contour may pass; elsewhere the sign is enough.
        near = np.flatnonzero((np.abs(depth) < 3.0 * self.cell.max()).ravel())
        centres = np.stack([self.x[near % self.shape[1]], self.y[near // self.shape[1]]], axis=1)
        depth.ravel()[near] = KDTree(rim).query(centres)[0] - radius.ravel()[near]
        return np.where(inside, depth, -radius), void

    def border_margin(self, depth: Array, h: float) -> float:
        """Return how far, in local spacings, the border lies outside the contour, from the number of points in a strip inside it.

        The contour runs through the outermost points. A strip inside it holds the points of its own area and those of the area
        between contour and border; the density comes from farther inside. Little evidence leaves the usual margin.
        """
        area = self.cell.prod()
        inner = np.where(depth > 0.0, depth, 0.0)
        signed = _distance(depth > 0.0, self.cell) - 0.5 * self.cell.max()
        deep = signed > 2.0 * h
        mass = ndimage.gaussian_filter(_blocks(np.where(deep, self.count, 0)), _BLUR, mode="constant")
        cover = ndimage.gaussian_filter(_blocks(deep) * area, _BLUR, mode="constant")
        known = cover > 0.02 * area * _COARSE**2
        density = _unblock(np.divide(mass, cover, out=np.zeros_like(mass), where=known), self.shape)
        strip = (signed <= 2.5 * h) & (density > 0.0)
        outer = ndimage.binary_dilation(inner > 0.0, iterations=2)
        found = float(self.count[strip & outer].sum())
        expected = float((density * area)[strip & (inner > 0.0)].sum())
        rim = (signed > 0.0) & (signed <= h) & strip
        per_margin = float((np.sqrt(density) * area)[rim].sum()) / h
        if not per_margin > 0.0:
            return _MARGIN
        margin, variance = (found - expected) / per_margin, max(0.5 * expected, 1.0) / per_margin**2
        blended = (margin / variance + _MARGIN / _MARGIN_SPREAD**2) / (1.0 / variance + 1.0 / _MARGIN_SPREAD**2)
        return float(np.clip(blended, -0.7, 0.8))


def value_at(raster: Array, low: Array, cell: Array, points: Array) -> Array:
    """Return the raster's value in the cell of each (K, 2) point."""
    column, row = np.round((points - low) / cell).astype(np.int64).T
    return raster[np.clip(row, 0, raster.shape[0] - 1), np.clip(column, 0, raster.shape[1] - 1)]


def zero_lines(field: Array) -> list[Array]:
    """Return the lines along which a field is zero, as (column, row); closed ones repeat their first point."""
    generator = contour_generator(z=field, line_type=LineType.Separate)
    return [np.asarray(line, np.float64) for line in generator.lines(0.0)]


def label_regions(mask: Mask, *, corners: bool = False) -> tuple[Labels, int]:
    """Give a number from 1 on to each connected region of a mask; with `corners` cells that only share a corner are connected."""
    labels = np.zeros(mask.shape, np.int32)
    n = ndimage.label(mask, structure=np.ones((3, 3)) if corners else None, output=labels)
    return labels, int(np.asarray(n))


def rim_points(field: Array, low: Array, cell: Array) -> Array:
    """Return points along the zero contours of a field, not farther apart than a quarter of a cell."""
    lines = [line for line in zero_lines(field) if len(line) > 1]
    a = np.concatenate([line[:-1] for line in lines])
    b = np.concatenate([line[1:] for line in lines])
    parts = [a + f * (b - a) for f in (0.0, 0.25, 0.5, 0.75)]
    return low + cell * np.concatenate(parts)


def _distance(mask: Mask, cell: Array) -> Array:
    """Return for each cell of the mask the distance to the nearest cell outside it."""
    return np.asarray(ndimage.distance_transform_edt(mask, sampling=_ratio(cell)), np.float64) * cell[1]


def _ratio(cell: Array) -> tuple[float, float]:
    """Return the cell's height and width relative to its height: 1 for squares, so that ties do not depend on the unit."""
    return 1.0, float(cell[0] / cell[1])


def _blocks(values: NDArray[np.generic]) -> Array:
    """Sum the raster over coarse cells."""
    rows, columns = values.shape
    padded = np.zeros((-(-rows // _COARSE) * _COARSE, -(-columns // _COARSE) * _COARSE))
    padded[:rows, :columns] = values
    return padded.reshape(padded.shape[0] // _COARSE, _COARSE, -1, _COARSE).sum(axis=(1, 3))


def _unblock(coarse: Array, shape: tuple[int, int]) -> Array:
    """Interpolate a coarse raster linearly back to the fine one."""
    at = [(np.arange(n) - 0.5 * (_COARSE - 1)) / _COARSE for n in shape]
    rows = _lerp(coarse, np.clip(at[0], 0.0, coarse.shape[0] - 1.0))
    return _lerp(rows.T, np.clip(at[1], 0.0, coarse.shape[1] - 1.0)).T


def _lerp(values: Array, at: Array) -> Array:
    first = np.minimum(at.astype(np.int64), max(len(values) - 2, 0))
    part = (at - first)[:, None]
    return (1.0 - part) * values[first] + part * values[np.minimum(first + 1, len(values) - 1)]
