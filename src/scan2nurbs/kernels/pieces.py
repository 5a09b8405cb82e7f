"""Connected pieces by union-find: the smallest index of a piece is its root, so that the result has one form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel


@kernel
def root_of(parent, i):
    """Return the root of the tree that `i` hangs in, and halve the way to it."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def join(parent, i, j):
    """Make one tree of those that `i` and `j` hang in."""
    a, b = root_of(parent, i), root_of(parent, j)
    parent[max(a, b)] = min(a, b)


def label_pieces(
    points: NDArray[np.float64], label: NDArray[np.int32], neighbours: NDArray[np.int32], longest: float, *, strips: bool = False
) -> NDArray[np.int32]:
    """Find the connected pieces of every label.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        −1 for none.
    neighbours : (N, k) int32
        −1, or the point itself, where there is none.
    longest : float
        Points at least so far apart are not connected.
    strips : bool
        Whether points of a label are connected by a common neighbour, too: strips may be too narrow for their points to be neighbours.

    Returns
    -------
    (N,) int32
        The lowest point of each point's piece; for a point without a label itself.

    Notes
    -----
    Union-find with path halving (Tarjan and van Leeuwen 1984). O(N k), in one thread.
    """
    parent = np.arange(len(label), dtype=np.int32)
    _join_pieces(points, label, neighbours, float(longest), strips, parent)
    return parent


@kernel
def _join_pieces(points, label, neighbours, longest, strips, parent):
    for i in range(len(label)):
        for a in range(neighbours.shape[1]):
            j = neighbours[i, a]
            if j < 0 or label[j] < 0:
                continue
            if label[j] == label[i] and _near(points, i, j, longest):
                join(parent, i, j)
            if not strips:
                continue
            for b in range(a - 1, -1, -1):  # the last neighbour of its label before it will do
                other = neighbours[i, b]
                if other >= 0 and label[other] == label[j]:
                    if _near(points, other, j, longest):
                        join(parent, other, j)
                    break
    for i in range(len(label)):
        parent[i] = root_of(parent, i)


@kernel
def _near(points, i, j, longest):
    square = 0.0
    for k in range(3):
        square += (points[i, k] - points[j, k]) ** 2
    return square < longest * longest
