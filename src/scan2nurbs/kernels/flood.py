"""Normals of one sign: components of points whose neighbours' normals are nearly parallel, each oriented alike throughout."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges


def flood_signs(
    neighbours: NDArray[np.int32], normals: NDArray[np.float64], member: NDArray[np.bool_], cosine: float
) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
    """Spread a sign from point to point wherever normals are nearly parallel.

    Parameters
    ----------
    neighbours : (N, k) int32
        Neighbours of every point; −1 where there is none.
    normals : (N, 3) float64
        Unit normals as lines.
    member : (N,) bool
        Points that take part.
    cosine : float
        Two neighbours are linked where |n·n'| is at least this.

    Returns
    -------
    component : (N,) int32
        Numbered by their first points; −1 for points that take no part.
    sign : (N,) int8
        +1 or −1: what to multiply each normal with, so that all of a component agree. 0 for points that take no part.

    Notes
    -----
    O(N k), in one thread. Every link used is a safe one, so that the order of the visits does not matter but where noise turns
    normals by more than the links allow in all.
    """
    n = len(normals)
    component, sign = np.full(n, -1, np.int32), np.zeros(n, np.int8)
    _flood_signs(neighbours, normals, member, float(cosine), component, sign)
    return component, sign


def between_components(component: NDArray[np.int32], neighbours: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the points, rising, of which a neighbour belongs to another component."""
    found = np.zeros(len(component), np.bool_)
    run_ranges(lambda start, stop: _between(component, neighbours, start, stop, found), len(component), size=1 << 14)
    return np.flatnonzero(found)


@kernel
def _between(component, neighbours, start, stop, found):
    for i in range(start, stop):
        for a in range(neighbours.shape[1]):
            j = neighbours[i, a]
            if component[i] >= 0 and j >= 0 and component[j] >= 0 and component[j] != component[i]:
                found[i] = True


def turn_rows(normals: NDArray[np.float64], sign: NDArray[np.float64]) -> None:
    """Multiply each of the normals (N, 3) with its sign (N,), in place."""
    run_ranges(lambda start, stop: _turn_rows(normals, sign, start, stop), len(normals), size=1 << 14)


@kernel
def _turn_rows(normals, sign, start, stop):
    for i in range(start, stop):
        for k in range(3):
            normals[i, k] *= sign[i]


@kernel
def _flood_signs(neighbours, normals, member, cosine, component, sign):
    queue = np.empty(len(member), np.int32)
    count = 0
    for seed in range(len(member)):
        if not member[seed] or component[seed] >= 0:
            continue
        component[seed], sign[seed] = count, 1
        queue[0] = seed
        done, end = 0, 1
        while done < end:
            i = queue[done]
            done += 1
            for a in range(neighbours.shape[1]):
                j = neighbours[i, a]
                if j < 0 or not member[j] or component[j] >= 0:
                    continue
                dot = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
                if abs(dot) >= cosine:
                    component[j] = count
                    sign[j] = sign[i] if dot > 0.0 else -sign[i]
                    queue[end] = j
                    end += 1
        count += 1
