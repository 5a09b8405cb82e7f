"""The graph along the curves that points lie on: a greedy spanner, which keeps long loops and no short ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel


def greedy_spanner(n: int, pairs: NDArray[np.int64], length: NDArray[np.float64], loop: float) -> NDArray[np.bool_]:
    """Choose edges so that points stay connected and every loop is at least `loop` long.

    Parameters
    ----------
    n : int
        Number of nodes.
    pairs : (E, 2) int64
        Edges by ascending length.
    length : (E,) float64
    loop : float
        An edge is left out where a path of the edges chosen before would close a shorter loop with it.

    Returns
    -------
    (E,) bool

    Notes
    -----
    The greedy spanner of Althöfer et al. (1993) with an absolute bound in place of a stretch factor: it holds the minimum
    spanning forest, and of the other edges those that close long loops.
    """
    chosen = np.zeros(len(pairs), np.bool_)
    _greedy_spanner(n, pairs, length, float(loop), chosen)
    return chosen


@kernel
def _greedy_spanner(n, pairs, length, loop, chosen):
    # Edges leaving a node are a linked list: head of the node, then from edge to next.
    head, following = np.full(n, -1), np.full(2 * len(pairs), -1)
    best, seen = np.empty(n), np.full(n, -1)
    queue = np.empty(256, np.int64)
    for e in range(len(pairs)):
        a, b = pairs[e, 0], pairs[e, 1]
        limit = loop - length[e]
        queue[0], best[a], seen[a] = a, 0.0, e
        done, end = 0, 1
        while done < end:
            i = queue[done]
            done += 1
            half = head[i]
            while half >= 0:
                j = pairs[half // 2, 1 - half % 2]
                far = best[i] + length[half // 2]
                if far < limit and (seen[j] != e or far < best[j]):
                    best[j], seen[j] = far, e
                    if end == len(queue):
                        larger = np.empty(2 * end, np.int64)
                        larger[:end] = queue
                        queue = larger
                    queue[end] = j
                    end += 1
                half = following[half]
        if seen[b] == e:
            continue
        chosen[e] = True
        for side in range(2):
            node = pairs[e, side]
            following[2 * e + side] = head[node]
            head[node] = 2 * e + side
