"""Offering fitted models to all connected points that follow them: candidates for the next labelling."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.growth import FAR, cost_of, flood
from scan2nurbs.kernels.runner import kernel


@kernel
def offer_models(points, normals, neighbours, order, starts, models, sigma, tilt, candidates, offers):
    """Flood every model from its region, order[starts[l]:starts[l + 1]], and list each point's cheapest models.

    Parameters
    ----------
    points, normals, neighbours : arrays
    order, starts : (N,) int32, (M + 1,) int64
    models : (M, SIZE) float64
    sigma, tilt : float
    candidates : (N, K) int32
        Receives the cheapest models of each point; −1 pads.
    offers : (N, K) float64
        Receives their costs; infinite pads.
    """
    stamp = np.zeros(len(points), np.int32)
    queue = np.empty(len(points), np.int32)
    candidates[:] = -1
    offers[:] = np.inf
    for label in range(len(models)):
        a, b = starts[label], starts[label + 1]
        if a == b:
            continue
        n = flood(models[label], points, normals, neighbours, order[a:b], b - a, FAR * sigma, len(points), stamp, label + 1, queue)
        for k in range(a, b):
            # A region keeps its own model as a candidate where noise carries a point off it, too.
            if n < len(queue) and stamp[order[k]] != label + 1:
                stamp[order[k]] = label + 1
                queue[n] = order[k]
                n += 1
        for k in range(n):
            i = queue[k]
            cost = cost_of(models[label], points, normals, i, sigma, tilt)
            remember(candidates, offers, i, label, cost)


@kernel
def remember(candidates, offers, i, model, cost):
    """Put a model among the cheapest of a point."""
    worst = 0
    for k in range(1, candidates.shape[1]):
        if offers[i, k] > offers[i, worst]:
            worst = k
    if cost < offers[i, worst]:
        offers[i, worst] = cost
        candidates[i, worst] = model


@kernel
def fill_candidates(candidates, nearby):
    """Put the labels nearby into the room that is left, none twice."""
    for i in range(len(candidates)):
        for k in range(nearby.shape[1]):
            if nearby[i, k] < 0:
                break
            free, known = -1, False
            for c in range(candidates.shape[1]):
                if candidates[i, c] == nearby[i, k]:
                    known = True
                if candidates[i, c] < 0:
                    free = c
            if not known and free >= 0:
                candidates[i, free] = nearby[i, k]
