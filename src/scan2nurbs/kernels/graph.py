"""Connected parts of a graph of nearest neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel


def components(neighbours: NDArray[np.int32], keep: NDArray[np.bool_], linked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Find the connected parts of the kept points, following links in both directions.

    Parameters
    ----------
    neighbours : (N, k) int32
        Neighbours of every point; −1 where there is none.
    keep : (N,) bool
        Points that take part.
    linked : (N, k) bool
        Which of the links may be followed.

    Returns
    -------
    (N,) int32
        Part of each point, numbered by its first point; −1 for points that take no part.

    Notes
    -----
    Union by the lower index, with path halving; O(N k) in effect, and the numbering is independent of the order of links.
    """
    parent = np.arange(len(neighbours)).astype(np.int32)
    _join(neighbours, keep, linked, parent)
    labels = np.full(len(neighbours), -1, np.int32)
    _number(keep, parent, labels)
    return labels


@kernel
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _join(neighbours, keep, linked, parent):
    for i in range(len(neighbours)):
        if not keep[i]:
            continue
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j >= 0 and keep[j] and linked[i, k]:
                a, b = _root(parent, i), _root(parent, j)
                if a != b:
                    parent[max(a, b)] = min(a, b)


@kernel
def _number(keep, parent, labels):
    n = 0
    for i in range(len(parent)):
        if keep[i]:
            root = _root(parent, i)
            if root == i:
                labels[i] = n
                n += 1
            else:
                labels[i] = labels[root]
