"""Where a set of plane points ends: contours of the set closed over its gaps, on a raster.

A disc rolls around the points without touching one: what it cannot reach is the face (a morphological closing, an alpha
shape). Its radius follows the local spacing, so that gaps of uneven sampling close. Distances are to the points themselves
and to the exact arcs around them, not to cells; the raster only says where to look.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from contourpy import LineType, contour_generator
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

Array = NDArray[np.float64]

MAX_CELLS = 1 << 23
# Spacing is averaged over this many cells of the coarse raster, whose cells hold this many fine ones a side.
_COARSE, _BLUR = 4, 2.0
# Where points are sparser than 3 spacings, they no longer sample the face.
_SPARSEST = 3.0


@dataclass(frozen=True)
class Contour:
    """One closed curve around the points, with the face on its left.

    Attributes
    ----------
    points : (K, 2) float64
        The first is not repeated.
    shift : (2,) float64
        What to add to the first point to reach the end: zero, or plus or minus one period.
    """

    points: Array
    shift: Array

    @property
    def area(self) -> float:
        """Signed area: positive around the outside, negative around a hole; zero for a contour around a tube."""
        if self.shift.any():
            return 0.0
        x, y = (self.points - self.points[0]).T
        return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


@dataclass(frozen=True)
class FaceRaster:
    """The largest closed component of a set of points, on a raster, with its contours.

    Attributes
    ----------
    contours : tuple of Contour
        The outside, or the contours around a tube, first; then the holes by falling area.
    spacing : (ny, nx) float64
        Local spacing of the points.
    low : (2,) float64
        Coordinates of the centre of the first cell.
    cell : (2,) float64
        Size of a cell.
    margin : float
        How far the true border lies outside the contours on average, in units of the local spacing.
    n_points : int
        Points of the component.
    n_left_out : tuple of int
        Points of the components that were left out.
    """

    contours: tuple[Contour, ...]
    spacing: Array
    low: Array
    cell: Array
    margin: float
    n_points: int
    n_left_out: tuple[int, ...]

    def spacing_at(self, points: Array) -> Array:
        """Return the local spacing at (K, 2) points."""
        return _at(self.spacing, self.low, self.cell, points)


def trace_contours(points: Array, h: float, period: float | None) -> FaceRaster:
    """Find the contours of the face that points in a plane, or on a tube with a period in x, sample.

    Parameters
    ----------
    points : (N, 2) float64
        Coordinates in units of length; with a period x lies in [0, period).
    h : float
        The spacing of the whole cloud; no gap narrower than 4 h counts, and none that chance may leave.
    period : float, optional
    """
    cell, margin = _cell_size(points, h, period), 6.0 * h
    n_turn = 0 if period is None else round(period / cell[0])
    low = points.min(axis=0) - margin
    high = points.max(axis=0) + margin
    pad = 0
    if period is not None:
        pad = min(int(np.ceil(10.0 * h / cell[0])), n_turn)
        low[0], high[0] = -(pad - 0.5) * cell[0], period + (pad + 0.5) * cell[0]
        wrapped = [points + np.array([turn * period, 0.0]) for turn in (-1, 0, 1)]
        points = np.concatenate([p[(p[:, 0] >= low[0]) & (p[:, 0] < high[0])] for p in wrapped])
    shape = (int((high[1] - low[1]) / cell[1]) + 1, int(round((high[0] - low[0]) / cell[0])) + 1)
    raster = _Raster(points, low, cell, shape)
    spacing = raster.local_spacing(h)
    regular = raster.regularity(spacing)
    # A closing over random points needs a wider disc than one over a grid, whose gaps are all alike.
    radius = (2.5 - 0.5 * regular) * spacing
    depth, void = raster.closing(radius)
    depth = _fill_chance_holes(depth, void, spacing, 2.0 * h, len(points), regular)
    label, n_inside, left_out = _largest(depth, raster.count, pad, n_turn)
    depth = np.where(label, depth, np.minimum(depth, -0.25 * cell[0]))
    margin = raster.border_margin(depth, h)
    if period is None:
        contours = _closed_lines(depth, low, cell)
    else:
        contours = _tube_lines(depth[:, pad : pad + n_turn + 1], low + np.array([pad * cell[0], 0.0]), cell, period)
    return FaceRaster(contours, spacing, low, cell, margin, n_inside, left_out)


def _cell_size(points: Array, h: float, period: float | None) -> Array:
    """Return half a spacing, or more where the raster would grow too large; a whole number of cells goes into the period."""
    extent = np.ptp(points, axis=0) + 12.0 * h
    size = max(0.5 * h, float(np.sqrt(extent[0] * extent[1] / MAX_CELLS)), float(extent.max()) / MAX_CELLS)
    return np.array([size if period is None else period / max(round(period / size), 8), size])


class _Raster:
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
        covered = ndimage.distance_transform_edt(self.count == 0, sampling=self.cell[::-1]) < 1.5 * h
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
        ratio = float(np.mean(nearest / (0.5 * _at(spacing, self.low, self.cell, some))))
        return float(np.clip((ratio - 1.1) / 0.4, 0.0, 1.0))

    def closing(self, radius: Array) -> tuple[Array, Array]:
        """Return how deep each cell lies inside the closed set (negative outside), and its distance to the nearest point."""
        row, column = ndimage.distance_transform_edt(self.count == 0, sampling=self.cell[::-1], return_distances=False, return_indices=True)
        void = np.hypot(self.mean_x[row, column] - self.x[None, :], self.mean_y[row, column] - self.y[:, None])
        rim = _rim(radius - void, self.low, self.cell)
        inside = void < radius
        depth = ndimage.distance_transform_edt(inside, sampling=self.cell[::-1]) - radius
        # Exact only where the contour may pass; elsewhere the sign is enough.
        near = np.flatnonzero((np.abs(depth) < 3.0 * self.cell.max()).ravel())
        centres = np.stack([self.x[near % self.shape[1]], self.y[near // self.shape[1]]], axis=1)
        depth.ravel()[near] = KDTree(rim).query(centres)[0] - radius.ravel()[near]
        return np.where(inside, depth, -radius), void

    def border_margin(self, depth: Array, h: float) -> float:
        """Return how far, in local spacings, the border lies outside the contour, from the number of points in a strip inside it.

        The contour runs through the outermost points. A strip inside it holds the points of its own area and those of the area
        between contour and border; the density comes from farther inside. Little evidence leaves the usual 0.3.
        """
        area = self.cell.prod()
        inner = np.where(depth > 0.0, depth, 0.0)
        signed = ndimage.distance_transform_edt(depth > 0.0, sampling=self.cell[::-1]) - 0.5 * self.cell.max()
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
            return 0.3
        margin, variance = (found - expected) / per_margin, max(0.5 * expected, 1.0) / per_margin**2
        blended = (margin / variance + 0.3 / 0.2**2) / (1.0 / variance + 1.0 / 0.2**2)
        return float(np.clip(blended, -0.7, 0.8))


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


def _at(raster: Array, low: Array, cell: Array, points: Array) -> Array:
    column, row = np.round((points - low) / cell).astype(np.int64).T
    return raster[np.clip(row, 0, raster.shape[0] - 1), np.clip(column, 0, raster.shape[1] - 1)]


def _rim(field: Array, low: Array, cell: Array) -> Array:
    """Return points along the zero contours of a field, not farther apart than a quarter of a cell."""
    lines = [line for line in _zero_lines(field) if len(line) > 1]
    a = np.concatenate([line[:-1] for line in lines])
    b = np.concatenate([line[1:] for line in lines])
    parts = [a + f * (b - a) for f in (0.0, 0.25, 0.5, 0.75)]
    return low + cell * np.concatenate(parts)


def _zero_lines(field: Array) -> list[Array]:
    generator = contour_generator(z=field, line_type=LineType.Separate)
    return [np.asarray(line, np.float64) for line in generator.lines(0.0)]


def _fill_chance_holes(depth: Array, void: Array, spacing: Array, least: float, n: int, regular: float) -> Array:
    """Fill the holes that chance alone would leave, or whose widest disc has less than the least radius."""
    label, count = ndimage.label(depth <= 0.0)
    if count <= 1:
        return depth
    outside = np.unique(np.r_[label[0], label[-1], label[:, 0], label[:, -1]])
    radius = ndimage.maximum(void, label, np.arange(count + 1))
    local = ndimage.mean(spacing, label, np.arange(count + 1))
    # An empty disc between random points: about 2 n triangles, each with a circumcircle beyond r with (1 + a) exp(−a), a = πr²/h².
    # A grid's gaps are so much less likely that its discs count three times.
    a = np.pi * (np.asarray(radius) / np.asarray(local)) ** 2 * (1.0 + 2.0 * regular)
    chance = 2.0 * n * (1.0 + a) * np.exp(-a) > 0.01
    fill = chance | (np.asarray(radius) < least)
    fill[0] = False
    fill[outside] = False
    return np.where(fill[label], np.maximum(-depth, 1e-6 * np.abs(depth).max()), depth)


def _largest(depth: Array, count: NDArray[np.int64], pad: int, n_turn: int) -> tuple[NDArray[np.bool_], int, tuple[int, ...]]:
    """Return the component with most points, how many these are, and how many the other components have."""
    label, n = ndimage.label(depth > 0.0, structure=np.ones((3, 3)))
    # The outermost points lie on the contour, in cells that may just be outside.
    wide = ndimage.maximum_filter(label, 3)
    turn = slice(pad, pad + n_turn) if n_turn else slice(None)
    if n_turn:
        label, wide, n = _join_turns(label, wide, pad, n_turn, n)
    sizes = np.bincount(wide[:, turn].ravel(), count[:, turn].ravel(), n + 1).astype(np.int64)
    sizes[0] = 0
    best = int(sizes.argmax())
    others = np.sort(np.delete(sizes, [0, best]))[::-1]
    return label == best, int(sizes[best]), tuple(int(size) for size in others if size > 0)


def _join_turns(
    label: NDArray[np.int32], wide: NDArray[np.int32], pad: int, n_turn: int, n: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
    """Give one label to components that are the same one turn on."""
    here, there = label[:, : label.shape[1] - n_turn].ravel(), label[:, n_turn:].ravel()
    both = (here > 0) & (there > 0)
    parent = np.arange(n + 1)
    for a, b in np.unique(np.stack([here[both], there[both]], axis=1), axis=0).tolist():
        while parent[a] != a:
            a = parent[a]
        while parent[b] != b:
            b = parent[b]
        parent[max(a, b)] = min(a, b)
    for i in range(n + 1):
        parent[i] = parent[parent[i]]
    return parent[label], parent[wide], n


def _closed_lines(depth: Array, low: Array, cell: Array) -> tuple[Contour, ...]:
    still = np.zeros(2)
    contours = [Contour(low + cell * line[:-1], still) for line in _zero_lines(depth) if len(line) > 4]
    return _sorted(contours)


def _sorted(contours: list[Contour]) -> tuple[Contour, ...]:
    """Put the contours around a tube first, then the outside, then holes by falling area; drop crumbs of the raster."""
    contours = [contour for contour in contours if len(contour.points) >= 4]
    around = [contour for contour in contours if contour.shift.any()]
    others = sorted((contour for contour in contours if not contour.shift.any()), key=lambda contour: -abs(contour.area))
    return (*sorted(around, key=lambda contour: float(contour.points[:, 1].mean())), *others)


def _tube_lines(depth: Array, low: Array, cell: Array, period: float) -> tuple[Contour, ...]:
    """Join the contour lines of one turn across the seam, where both ends of the turn show the same field."""
    depth = depth.copy()
    depth[:, -1] = depth[:, 0]
    contours, open_lines = [], []
    for line in _zero_lines(depth):
        if np.array_equal(line[0], line[-1]):
            contours.append(Contour(low + cell * line[:-1], np.zeros(2)))
        else:
            open_lines.append(low + cell * line)
    left, right = low[0], low[0] + period
    while open_lines:
        line = open_lines.pop(0)
        start, turned = line[0], 0.0
        while True:
            # Having left the turn on one side, the contour comes back in on the other.
            side = right if abs(line[-1, 0] - turned - right) < abs(line[-1, 0] - turned - left) else left
            turned += period if side == right else -period
            entry = np.array([line[-1, 0], line[-1, 1]])
            options = [start, *(other[0] + np.array([turned, 0.0]) for other in open_lines)]
            if abs(start[0] + period * round((entry[0] - start[0]) / period) - entry[0]) < 1e-6 * period:
                options[0] = np.array([entry[0], start[1]])
            else:
                options[0] = np.array([np.inf, np.inf])
            nearest = int(np.argmin([np.abs(entry - option).sum() for option in options]))
            if nearest == 0:
                break
            line = np.concatenate([line, open_lines.pop(nearest - 1)[1:] + np.array([turned, 0.0])])
        turns = round((line[-1, 0] - start[0]) / period)
        contours.append(Contour(line[:-1], np.array([turns * period, 0.0])))
    return _sorted(contours)
