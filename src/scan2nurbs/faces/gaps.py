"""Where a surface spans gaps in the data: which triangles lie in one, and how far it goes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.sheet import Sheet, components, drop_triangles, triangle_areas
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.nearest import nearest_to
from scan2nurbs.surfaces.shape import Floats


def is_covered(sheet: Sheet, points: Floats, spacing: Floats, cells: Cells, reach: float) -> NDArray[np.bool_]:
    """Tell which triangles span no gap in the data.

    Parameters
    ----------
    sheet : Sheet
        The triangles.
    points : (N, 3) float64
        The points that its vertices come from.
    spacing : (N,) float64
        Local spacing at them.
    cells : Cells
        All points of the scan, also those that have no face.
    reach : float
        Most distance from a place of a triangle to the nearest point of the scan, in local spacings.
    """
    corners = sheet.source[sheet.triangles]
    p = points[corners]
    size = spacing[corners].mean(axis=1) * reach
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    covered = np.ones(len(corners), bool)
    # No place of a triangle is farther from its corners than the longest edge over the root of three.
    wide = np.flatnonzero(longest > np.sqrt(3.0) * size)
    if len(wide):
        p = p[wide]
        places = np.stack([p.mean(axis=1), *(0.5 * (p[:, k] + p[:, (k + 1) % 3]) for k in range(3))], axis=1)
        distance = nearest_to(cells, np.ascontiguousarray(places.reshape(-1, 3)), 1)[1].reshape(-1, 4)
        covered[wide] = (distance <= size[wide, None]).all(axis=1)
    return covered


def is_pinhole(sheet: Sheet, points: Floats, label: NDArray[np.int32], covered: NDArray[np.bool_], most: float) -> NDArray[np.bool_]:
    """Tell which triangles lie in small gaps within a single face, or in a quarter of such a gap anywhere.

    Parameters
    ----------
    sheet : Sheet
        The triangles.
    points : (N, 3) float64
        The points that its vertices come from.
    label : (N,) int32
        Their faces.
    covered : (M,) bool
        Triangles that lie in no gap.
    most : float
        Largest area of such a gap.
    """
    n, gap = components(drop_triangles(sheet, ~covered))
    corners = sheet.source[sheet.triangles[~covered]]
    area = np.bincount(gap, triangle_areas(points, corners), minlength=n)
    low, high = np.full(n, np.iinfo(np.int32).max), np.full(n, -1)
    for k in range(3):
        np.minimum.at(low, gap, label[corners[:, k]])
        np.maximum.at(high, gap, label[corners[:, k]])
    out = np.zeros(len(covered), bool)
    out[~covered] = (area < np.where(low == high, most, 0.25 * most))[gap]
    return out


def to_the_rim(sheet: Sheet, points: Floats, spacing: Floats, covered: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """Widen gaps to their rims: tell which of the covered triangles still are.

    Triangles between neighbours on the rim of a gap lie near the points all over, but for their long edge; so they count as covered, and
    cut its corners off.

    Parameters
    ----------
    sheet : Sheet
    points : (N, 3) float64
        The points that its vertices come from.
    spacing : (N,) float64
        Local spacing at them.
    covered : (M,) bool
        Triangles that lie in no gap as far as is known.
    reach : float
        In local spacings: triangles beside a gap belong to it that have a longer edge, and a circle through their corners, which holds no
        other points, of a larger radius.

    Returns
    -------
    (M,) bool

    Notes
    -----
    Alpha shapes (Edelsbrunner, Kirkpatrick and Seidel 1983) leave out the same triangles, everywhere and not from gaps on alone.
    """
    corners = sheet.source[sheet.triangles]
    p, size = points[corners], reach * spacing[corners].mean(axis=1)
    edges = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = edges.prod(axis=1) / (4.0 * triangle_areas(points, corners))
    wide = (radius > size) & (edges.max(axis=1) > size)
    covered, twin = covered.copy(), sheet.twin.reshape(-1, 3)
    beside = np.where(twin >= 0, twin // 3, np.arange(len(twin))[:, None])
    while True:
        reached = covered & wide & ~covered[beside].all(axis=1)
        if not reached.any():
            return covered
        covered &= ~reached
