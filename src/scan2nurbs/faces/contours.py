"""Where a set of plane points ends: contours of the set closed over its gaps, on a raster.

A disc rolls around the points without touching one: what it cannot reach is the face (a morphological closing, an alpha
shape). Its radius follows the local spacing, so that gaps of uneven sampling close. Distances are to the points themselves
and to the exact arcs around them, not to cells; the raster only says where to look.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scan2nurbs.faces.raster import Array, Labels, Mask, Raster, label_regions, value_at, zero_lines

MAX_CELLS = 1 << 23


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
        return value_at(self.spacing, self.low, self.cell, points)


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
    shape = (int((high[1] - low[1]) / cell[1]) + 1, round(float((high[0] - low[0]) / cell[0])) + 1)
    raster = Raster(points, low, cell, shape)
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
        contours = _closed_lines(depth, low, cell, h)
    else:
        contours = _tube_lines(depth[:, pad : pad + n_turn + 1], low + np.array([pad * cell[0], 0.0]), cell, period, h)
    return FaceRaster(contours, spacing, low, cell, margin, n_inside, left_out)


def _cell_size(points: Array, h: float, period: float | None) -> Array:
    """Return half a spacing, or more where the raster would grow too large; a whole number of cells goes into the period."""
    extent = np.ptp(points, axis=0) + 12.0 * h
    size = max(0.5 * h, float(np.sqrt(extent[0] * extent[1] / MAX_CELLS)), float(extent.max()) / MAX_CELLS)
    return np.array([size if period is None else period / max(round(period / size), 8), size])


def _fill_chance_holes(depth: Array, void: Array, spacing: Array, least: float, n: int, regular: float) -> Array:
    """Fill the holes that chance alone would leave, or whose widest disc has less than the least radius."""
    label, count = label_regions(depth <= 0.0)
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


def _largest(depth: Array, count: NDArray[np.int64], pad: int, n_turn: int) -> tuple[Mask, int, tuple[int, ...]]:
    """Return the component with most points, how many these are, and how many the other components have."""
    label, n = label_regions(depth > 0.0, corners=True)
    # The outermost points lie on the contour, in cells that may just be outside.
    wide = np.asarray(ndimage.maximum_filter(label, 3), np.int32)
    turn = slice(pad, pad + n_turn) if n_turn else slice(None)
    if n_turn:
        label, wide, n = _join_turns(label, wide, pad, n_turn, n)
    sizes = np.bincount(wide[:, turn].ravel(), count[:, turn].ravel(), n + 1).astype(np.int64)
    sizes[0] = 0
    best = int(sizes.argmax())
    others = np.sort(np.delete(sizes, [0, best]))[::-1]
    return label == best, int(sizes[best]), tuple(int(size) for size in others if size > 0)


def _join_turns(label: Labels, wide: Labels, pad: int, n_turn: int, n: int) -> tuple[Labels, Labels, int]:
    """Give one label to components that are the same one turn on."""
    here, there = label[:, : label.shape[1] - n_turn].ravel(), label[:, n_turn:].ravel()
    both = (here > 0) & (there > 0)
    links = np.unique(np.stack([here[both], there[both]], axis=1), axis=0)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n + 1, n + 1))
    _, joined = connected_components(graph, directed=False)
    # Zero, the outside, stands alone; so its new number can be exchanged with whoever got zero.
    if joined[0] != 0:
        joined = np.where(joined == joined[0], 0, np.where(joined == 0, joined[0], joined))
    return joined[label].astype(np.int32), joined[wide].astype(np.int32), n


def _closed_lines(depth: Array, low: Array, cell: Array, h: float) -> tuple[Contour, ...]:
    still = np.zeros(2)
    contours = [Contour(low + cell * line[:-1], still) for line in zero_lines(depth) if len(line) > 4]
    return _sorted(contours, h)


def _sorted(contours: list[Contour], h: float) -> tuple[Contour, ...]:
    """Put the contours around a tube first, or else the outside, then holes by falling area; drop crumbs of the raster.

    The set is connected: it has one outside, or none around a tube. Around every hole a disc of more than 2 h has room.
    """
    around = [contour for contour in contours if contour.shift.any()]
    areas = [contour.area for contour in contours]
    outer = [] if around else [contours[int(np.argmax(areas))]] if contours else []
    holes = [(area, contour) for area, contour in zip(areas, contours, strict=True) if area < -4.0 * h**2]
    holes.sort(key=lambda hole: hole[0])
    return (*sorted(around, key=lambda contour: float(contour.points[:, 1].mean())), *outer, *(hole for _, hole in holes))


def _tube_lines(depth: Array, low: Array, cell: Array, period: float, h: float) -> tuple[Contour, ...]:
    """Join the contour lines of one turn across the seam, where both ends of the turn show the same field."""
    depth = depth.copy()
    depth[:, -1] = depth[:, 0]
    contours, open_lines = [], []
    for line in zero_lines(depth):
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
    return _sorted(contours, h)
