"""Choosing among models point by point, with neighbours inclined to agree: mean-field inference of a Potts model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.growth import NONE_COST, cost_of
from scan2nurbs.kernels.runner import kernel, run_ranges

_RANGE = 4096
STILL = 1e-6
"""Beliefs that change by less, as those of all neighbours do, are not renewed in the next sweep: with a thousandth, faces were lost."""


def candidate_costs(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    models: NDArray[np.float64],
    candidates: NDArray[np.int32],
    sigma: float,
    tilt: float,
) -> NDArray[np.float32]:
    """Return the cost of every point under each of its candidates (N, K); infinite where there is none."""
    out = np.full(candidates.shape, np.inf, np.float32)
    run_ranges(lambda a, b: _costs(points, normals, models, candidates, sigma, tilt, a, b, out), len(points), size=_RANGE)
    return out


@kernel
def _costs(points, normals, models, candidates, sigma, tilt, start, stop, out):
    for i in range(start, stop):
        for k in range(candidates.shape[1]):
            if candidates[i, k] >= 0:
                out[i, k] = cost_of(models[candidates[i, k]], points, normals, i, sigma, tilt)


def choose_labels(
    candidates: NDArray[np.int32],
    costs: NDArray[np.float32],
    neighbours: NDArray[np.int32],
    weights: NDArray[np.float32],
    *,
    rounds: int = 20,
) -> NDArray[np.int32]:
    """Choose a candidate for every point, or none.

    Parameters
    ----------
    candidates : (N, K) int32
        Models that a point may take; −1 pads.
    costs : (N, K) float32
        Their costs.
    neighbours : (N, k) int32
    weights : (N, k) float32
        What it costs a point to differ from each neighbour.
    rounds : int
        Sweeps; the first ones soften the choice, so that it depends less on where it began.

    Returns
    -------
    (N,) int32
        −1 where every candidate is dearer than none.
    """
    belief = np.zeros((len(candidates), candidates.shape[1] + 1), np.float32)
    other = np.zeros_like(belief)
    nobody = np.zeros_like(weights)
    moved, moves = np.ones(len(candidates), np.bool_), np.ones(len(candidates), np.bool_)
    for step in range(rounds):
        beta = np.float32(min(1.0, 0.3 + 0.1 * step))
        links = nobody if step == 0 else weights
        moved[:] |= step == 1  # neighbours count from here on
        now, then, stirred, stirs = belief, other, moved, moves

        def work(a: int, b: int, s=now, t=then, m=stirred, n=stirs, w=links, f=beta) -> None:
            _sweep(candidates, costs, neighbours, w, f, s, m, a, b, t, n)

        run_ranges(work, len(candidates), size=_RANGE)
        belief, other, moved, moves = other, belief, moves, moved
    choice = np.argmax(belief, axis=1)
    k = candidates.shape[1]
    picked = candidates[np.arange(len(candidates)), np.minimum(choice, k - 1)]
    return np.where(choice < k, picked, -1).astype(np.int32)


@kernel
def _sweep(candidates, costs, neighbours, weights, beta, belief, moved, start, stop, out, moves):
    """Renew the beliefs, but where neither a point nor its neighbours moved in the last sweep."""
    room = candidates.shape[1]
    for i in range(start, stop):
        if not _near_moved(moved, neighbours, i):
            out[i] = belief[i]
            moves[i] = False
            continue
        for k in range(room + 1):
            out[i, k] = -NONE_COST if k == room else (-costs[i, k] if candidates[i, k] >= 0 else -1e9)
        for n in range(neighbours.shape[1]):
            j = neighbours[i, n]
            w = weights[i, n]
            if j < 0 or w == 0.0:
                continue
            for q in range(room):
                label = candidates[j, q]
                if label < 0 or belief[j, q] < 1e-3:
                    continue
                for k in range(room):
                    if candidates[i, k] == label:
                        out[i, k] += w * belief[j, q]
        top = out[i, 0]
        for k in range(1, room + 1):
            top = max(top, out[i, k])
        total = np.float32(0.0)
        for k in range(room + 1):
            out[i, k] = np.exp(beta * (out[i, k] - top))
            total += out[i, k]
        moves[i] = False
        for k in range(room + 1):
            out[i, k] /= total
            moves[i] |= abs(out[i, k] - belief[i, k]) > STILL


@kernel
def _near_moved(moved, neighbours, i):
    near = moved[i]
    for n in range(neighbours.shape[1]):
        near |= neighbours[i, n] >= 0 and moved[neighbours[i, n]]
    return near


@kernel
def nearby_labels(labels, neighbours, rings, candidates):
    """List for each point the labels within so many rings of neighbours, nearest first; −1 pads."""
    n, room = candidates.shape
    queue = np.empty(4096, np.int32)
    for i in range(n):
        candidates[i, :] = -1
        found = 0
        if labels[i] >= 0:
            candidates[i, 0] = labels[i]
            found = 1
        queue[0] = i
        begin, end = 0, 1
        for _ in range(rings):
            last = end
            for h in range(begin, last):
                for k in range(neighbours.shape[1]):
                    j = neighbours[queue[h], k]
                    if j < 0:
                        continue
                    known = labels[j] < 0
                    for c in range(found):
                        known |= candidates[i, c] == labels[j]
                    if not known and found < room:
                        candidates[i, found] = labels[j]
                        found += 1
                    if end < len(queue):
                        queue[end] = j
                        end += 1
            begin = last
