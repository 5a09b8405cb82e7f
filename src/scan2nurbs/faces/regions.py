"""Which face each vertex of a mesh belongs to: connected regions, none of them a speck."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from scan2nurbs.faces.sheet import Sheet

ISLAND = 12
"""Fewest vertices of a piece of a face that is not its largest one."""
SHARE = 0.02
"""Least part of the largest piece."""
SPECK = 3
"""Fewest vertices of a face."""


def find_regions(sheet: Sheet, label: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Part the vertices of a mesh into connected regions.

    Parameters
    ----------
    sheet : Sheet
        The mesh.
    label : (V,) int32
        Label of each vertex.

    Returns
    -------
    region : (V,) int32
        Number of the region of each vertex, by label, and by falling size within a label.
    label : (R,) int32
        Label of each region.

    Notes
    -----
    Pieces of a label that are small beside its largest one take the label that most of their neighbours have, the smallest first.
    """
    start = sheet.triangles.ravel()
    end = np.roll(sheet.triangles, -1, axis=1).ravel()
    label = _smooth(label.copy(), start, end)
    for _ in range(10):
        piece, n = _pieces(label, start, end)
        if not _absorb(label, piece, n, start, end):
            break
    piece, n = _pieces(label, start, end)
    of = np.empty(n, np.int32)
    of[piece] = label
    order = np.lexsort((-np.bincount(piece, minlength=n), of))
    rank = np.empty(n, np.int32)
    rank[order] = np.arange(n, dtype=np.int32)
    return rank[piece], of[order]


def _smooth(label: NDArray[np.int32], start: NDArray[np.int32], end: NDArray[np.int32]) -> NDArray[np.int32]:
    """Give vertices that have at most one neighbour of their label the label of most neighbours."""
    for _ in range(3):
        alike = np.bincount(start, label[start] == label[end], minlength=len(label))
        lone = np.flatnonzero(alike <= 1)
        if not len(lone):
            break
        label[lone] = _majority(label, lone, start, end)
    return label


def _majority(label: NDArray[np.int32], rows: NDArray[np.int64], start: NDArray[np.int32], end: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the label that most neighbours of each row have, the lowest of equals; the own one where there is no neighbour."""
    place = np.full(len(label), -1)
    place[rows] = np.arange(len(rows))
    edge = np.flatnonzero(place[start] >= 0)
    count = coo_matrix((np.ones(len(edge)), (place[start[edge]], label[end[edge]])), shape=(len(rows), int(label.max()) + 1)).tocsr()
    best = np.asarray(count.argmax(axis=1)).ravel().astype(np.int32)
    return np.where(np.diff(count.indptr) > 0, best, label[rows])


def _pieces(label: NDArray[np.int32], start: NDArray[np.int32], end: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
    same = label[start] == label[end]
    n = len(label)
    graph = coo_matrix((np.ones(int(same.sum()), np.int8), (start[same], end[same])), shape=(n, n))
    count, piece = connected_components(graph, directed=False)
    return piece.astype(np.int32), int(count)


def _absorb(label: NDArray[np.int32], piece: NDArray[np.int32], n: int, start: NDArray[np.int32], end: NDArray[np.int32]) -> bool:
    """Give specks to their neighbours; tell whether there were any."""
    size = np.bincount(piece, minlength=n)
    of = np.empty(n, np.int32)
    of[piece] = label
    largest = np.zeros(int(label.max()) + 1, np.int64)
    np.maximum.at(largest, of, size)
    whole = size == largest[of]
    # Of two equals the first one counts as the largest.
    first = np.full(len(largest), n)
    np.minimum.at(first, of[whole], np.flatnonzero(whole))
    whole &= first[of] == np.arange(n)
    small = np.where(whole, size < SPECK, size < np.maximum(ISLAND, SHARE * largest[of]))
    across = (piece[start] != piece[end]) & small[piece[start]]
    if not across.any():
        return False
    a, b = piece[start[across]], piece[end[across]]
    shared = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)).tocsr()
    changed = label.copy()
    taken = np.zeros(n, bool)
    for p in sorted(np.unique(a), key=lambda p: (size[p], p)):
        row = slice(shared.indptr[p], shared.indptr[p + 1])
        others, weight = shared.indices[row], shared.data[row]
        # A piece that goes itself in this round is no home.
        stay = ~taken[others]
        if stay.any():
            changed[piece == p] = of[others[stay][np.argmax(weight[stay])]]
            taken[p] = True
    label[:] = changed
    return bool(taken.any())
