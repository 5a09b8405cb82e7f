"""Surface that lies upon itself: triangles on both sides of the points of one face, which enclose nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.sheet import Sheet
from scan2nurbs.surfaces.shape import Floats

NET = 0.25
"""Share of a region's area by which what faces outward exceeds what faces inward, where it is a surface and no fold."""


def folds(sheet: Sheet, points: Floats, outward: Floats, region: NDArray[np.int32], largest: float) -> NDArray[np.bool_]:
    """Tell which triangles belong to regions that are folded upon themselves.

    Parameters
    ----------
    sheet : Sheet
    points, outward : (n, 3) float64
        Its vertices, and the outward unit normals there.
    region : (n,) int32
        Of each vertex.
    largest : float
        Area, in the points' unit squared, of the gap that such a region may leave: with a larger one it stays.

    Returns
    -------
    (M,) bool
    """
    corners = points[sheet.triangles]
    half = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    first = region[sheet.triangles[:, 0]]
    inner = (region[sheet.triangles] == first[:, None]).all(axis=1)
    n = int(region.max(initial=-1)) + 1
    facing = np.einsum("mk,mk->m", half, outward[sheet.triangles[:, 0]])
    net, whole = (np.bincount(first[inner], value[inner], minlength=n) for value in (facing, np.linalg.norm(half, axis=1)))
    drop = np.zeros(len(sheet.triangles), np.bool_)
    for folded in np.flatnonzero(net < NET * whole):
        touching = (region[sheet.triangles] == folded).any(axis=1)
        # The gap has the area, seen along any direction, of what is taken away from it.
        if np.linalg.norm(half[touching].sum(axis=0)) <= largest:
            drop |= touching
    return drop
