"""Where the scan ends: points at the border of a sheet or of a hole in the data, told from creases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, build_cells, unsorted
from scan2nurbs.kernels.openness import openness
from scan2nurbs.kernels.thinning import join_groups

# Radius of the balls, in spacings and standard deviations of the noise.
REACH, NOISE_REACH = 4.0, 2.0
# A quarter of the directions is empty where it holds less than this part of the fullest quarter: one point of a dozen.
OPEN = 0.88
# Borders are long: groups joined over GAP spacings that are shorter than LENGTH are chance.
GAP, LENGTH = 3.0, 8.0
# A hole narrower than this, in spacings, is a gap in the data and no border of the part. Where no border reaches over half the
# scan the part is closed, and so is one narrower than this part of the scan.
HOLE, SHEET, GAP_SHARE = 24.0, 0.5, 0.2


@dataclass(frozen=True)
class Borders:
    """Points at the border of the scan.

    Attributes
    ----------
    mask : (N,) bool
        All of them.
    outline : (N,) bool
        Those of borders too long to be a hole in the data: there a sheet ends.
    openness : (N,) float32
        How much emptier the emptiest quarter about the point is than the fullest, in [0, 1].
    """

    mask: NDArray[np.bool_]
    outline: NDArray[np.bool_]
    openness: NDArray[np.float32]

    def sorted(self, cells: Cells) -> Borders:
        """Return them in the order of the sorted points, if they stand in that of the points that the cells were built from."""
        order = cells.order
        return Borders(self.mask[order], self.outline[order], self.openness[order])

    def unsorted(self, cells: Cells) -> Borders:
        """Return them in the order of the points that the cells were built from, if they stand in that of the sorted points."""
        return Borders(unsorted(cells, self.mask), unsorted(cells, self.outline), unsorted(cells, self.openness))


def find_borders(cells: Cells, normals: NDArray[np.float64], h: float, noise: float) -> Borders:
    """Find the points beside which the surface is not scanned.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals as lines, in sorted order; NaN where unknown.
    h : float
        The spacing.
    noise : float
        Standard deviation of the points across the surface.

    Notes
    -----
    The largest angular gap between neighbours (as in Bendels, Schnabel and Klein 2006) is looked for in counts, not in angles: noise and
    single outliers then change little. Borders come in chains, which chance does not make.
    """
    found = openness(cells, normals, REACH * h + NOISE_REACH * noise, 0.35 * h + 3.0 * noise)
    candidate = np.flatnonzero(found >= OPEN)
    mask, outline = np.zeros(len(found), bool), np.zeros(len(found), bool)
    if len(candidate):
        points = cells.points[candidate]
        index = build_cells(np.ascontiguousarray(points), GAP * h)
        first = np.empty(len(points), np.int64)
        first[index.order] = join_groups(index, GAP * h)
        _, group = np.unique(first, return_inverse=True)
        extent = _extent(points, group)
        whole = 2.0 * np.linalg.norm(cells.points - cells.points.mean(axis=0), axis=1).max()
        hole = HOLE * h if extent.max() > SHEET * whole else max(HOLE * h, GAP_SHARE * whole)
        mask[candidate] = extent[group] >= LENGTH * h
        outline[candidate] = extent[group] >= hole
    return Borders(mask, outline, found)


def _extent(points: NDArray[np.float64], group: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return twice the largest distance of each group's points from their mean."""
    size = np.bincount(group)
    mean = np.stack([np.bincount(group, column) for column in points.T], axis=1) / size[:, None]
    reach = np.zeros(len(size))
    np.maximum.at(reach, group, np.linalg.norm(points - mean[group], axis=1))
    return 2.0 * reach
