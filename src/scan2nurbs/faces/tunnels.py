"""Part the two sides of a thin wall, or of a narrow gap, where noise made a tunnel between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scan2nurbs.faces.pinholes import cut_out
from scan2nurbs.faces.sheet import Sheet
from scan2nurbs.surfaces.shape import Floats

FOLD = -0.8
"""Cosine between the normals of a triangle's corners below which it leads from one side to the other: sharper edges are none."""


def close_tunnels(sheet: Sheet, points: Floats, outward: Floats, largest: float) -> Sheet:
    """Take away every ring of triangles between two sides that look away from each other, and span both of its ends.

    Parameters
    ----------
    sheet : Sheet
    points, outward : (N, 3) float64
        The points that its vertices come from, and the outward unit normals at them.
    largest : float
        Area within either end up to which it counts as chance, in the points' unit squared: its rim is jagged, and tells less.

    Returns
    -------
    Sheet
        The triangles that are kept, and after them those that span the ends; without tunnels, the sheet as it is.
    """
    normal = outward[sheet.source[sheet.triangles]]
    folded = np.einsum("mkj,mkj->mk", normal, np.roll(normal, 1, axis=1)).min(axis=1) < FOLD
    half = np.flatnonzero(np.repeat(folded, 3))
    twin = sheet.twin[half]
    # Rings, and rims, with a vertex in common count as one: the larger they are, the less chance.
    n = len(folded)
    ring = _pieces(half // 3, n + sheet.triangles.ravel()[half], n + len(sheet.source))[:n]
    outer = (twin < 0) | ~folded[twin // 3]
    rim, twin = half[outer], twin[outer]
    start, end = (corner.ravel()[rim] for corner in (sheet.triangles, np.roll(sheet.triangles, -1, axis=1)))
    loop = _pieces(start, end, len(sheet.source))[start]
    within = np.zeros((len(sheet.source), 3))
    np.add.at(within, loop, 0.5 * np.cross(points[sheet.source[start]], points[sheet.source[end]]))
    of = ring[rim // 3]
    chance = np.bincount(np.unique(np.column_stack([of, loop]), axis=0)[:, 0], minlength=int(ring.max()) + 1) > 1
    chance[of[(np.linalg.norm(within[loop], axis=1) > largest) | (twin < 0) | _two_sided(outward[sheet.source[start]], loop)]] = False
    drop = folded & chance[ring]
    if not drop.any():
        return sheet
    return cut_out(sheet, points, drop)


def _two_sided(normals: Floats, loop: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell which places along rims lie on rims that run on more than one side: what spans these would be folded again."""
    number, rim = np.unique(loop, return_inverse=True)
    mean = np.zeros((len(number), 3))
    np.add.at(mean, rim, normals)
    turned = np.einsum("nk,nk->n", normals, mean[rim]) <= 0.0
    return np.isin(rim, rim[turned])


def _pieces(i: NDArray[np.integer], j: NDArray[np.integer], n: int) -> NDArray[np.int32]:
    """Return the connected piece of each of n things, of which i are linked with j."""
    return connected_components(coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n, n)), directed=False)[1]
