"""Fitting a region anew with every kind of primitive, and choosing the simplest that explains it."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.gauss_newton import refine, settle
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import CONE, CYLINDER, FREEDOM, PATCH, PLANE, SIZE, SPHERE, TORUS, distance_of
from scan2nurbs.kernels.runner import kernel
from scan2nurbs.kernels.starts import best_start, curvatures

START = 120
COINCIDENT = 3.0
"""Two surfaces nearly coincide where a point's distances from both sum up to less than so many standard deviations."""
PER_PARAMETER = 2.0
"""What a parameter costs more than by the criterion of Schwarz: borders are never clean, nor is noise quite normal."""
SHARE = 0.5
AMID = 75
"""The points away from a region's border tell its kind if they are so large a share of it, and so many."""
RARER = 2.0
"""Parameters that a sphere pays more than it has when kinds are compared: it is rarer than cylinders and cones, and no better than they
are on a narrow ring or strip, where noise would choose it."""


@kernel
def misfit(m, points, index, n, sigma):
    """Return the robust negative log likelihood of points under a model.

    Of all of them: that of one in k, times k, is off by more than what models compete by.
    """
    total = 0.0
    for k in range(n):
        i = index[k]
        d, _, _, _ = distance_of(m, points[i, 0], points[i, 1], points[i, 2])
        t = d / sigma
        total += min(0.5 * t * t, DISTANCE_CAP)
    return total


@kernel
def criterion(m, points, index, n, sigma):
    """Return the misfit and what the parameters cost."""
    return misfit(m, points, index, n, sigma) + FREEDOM[int(m[0])] * (0.5 * np.log(max(n, 2)) + PER_PARAMETER)


@kernel
def _doubt(m, n):
    """Return what the criterion of a model has to be better by than that of another kind."""
    return RARER * (0.5 * np.log(max(n, 2)) + PER_PARAMETER) if int(m[0]) == SPHERE else 0.0


@kernel
def refit(points, normals, neighbours, index, n, seed, stamp, mark, kinds, sigma, m):
    """Fit a region and keep the kind of least criterion in `m`, which comes in as the model so far; return the criterion.

    Parameters
    ----------
    points, normals, neighbours : arrays
    index : (M,) int32
        The region's points, of which n are read.
    seed : int
        A point amid the region, around which new kinds are started.
    stamp, mark : (N,) int32, int
        Points that may be part of the start have a stamp of `mark`.
    kinds : (6,) bool
        Kinds that may be chosen.
    sigma : float
    m : (SIZE,) float64
    """
    trial = m.copy()
    best = np.inf
    if kinds[int(m[0])]:
        refine(trial, points, index, n, sigma, 5)
        settle(trial, points, index, n, sigma)
        best = criterion(trial, points, index, n, sigma) + _doubt(trial, n)
        m[:] = trial
    first = np.empty(START, np.int32)
    n_first = _start_points(neighbours, seed, stamp, mark, first)
    bend = np.empty(14)
    scratch = np.zeros(SIZE)
    if n_first < 8:
        return best - _doubt(m, n)
    curvatures(points, first, n_first, scratch, bend)
    for kind in (PLANE, CYLINDER, SPHERE, CONE, TORUS, PATCH):
        if not kinds[kind]:
            continue
        if kind == PLANE:
            best_start(kind, bend, points, index, n, sigma, trial)
        elif kind == PATCH:
            refine(_as_patch(trial), points, index, n, sigma, 3)
        else:
            if not best_start(kind, bend, points, first, n_first, sigma, trial) < np.inf:
                continue
            refine(trial, points, index, n, sigma, 10)
        value = criterion(trial, points, index, n, sigma) + _doubt(trial, n)
        if value < best + n:  # no more than that is owed to chance
            settle(trial, points, index, n, sigma)
            value = criterion(trial, points, index, n, sigma) + _doubt(trial, n)
        if value < best:
            best = value
            m[:] = trial
    return best - _doubt(m, n)


@kernel
def _as_patch(m):
    m[0] = PATCH
    return m


@kernel
def _start_points(neighbours, seed, stamp, mark, first):
    """Collect the points about a seed within the region; their stamps are taken away and put back."""
    first[0] = seed
    n, head = 1, 0
    stamp[seed] = mark - 1
    while head < n < len(first):
        i = first[head]
        head += 1
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j >= 0 and stamp[j] == mark and n < len(first):
                stamp[j] = mark - 1
                first[n] = j
                n += 1
    for k in range(n):
        stamp[first[k]] = mark
    return n


@kernel
def refit_all(points, normals, neighbours, order, starts, depth, kinds, sigma, start, stop, models, values):
    """Refit every region: region l holds order[starts[l]:starts[l + 1]], deepest points first where `depth` is sorted within it."""
    stamp = np.zeros(len(points), np.int32)
    for label in range(start, stop):
        a, b = starts[label], starts[label + 1]
        if b - a < 6:
            values[label] = np.inf
            continue
        mark = 2 * label + 2
        n = 0
        deepest = order[a]
        for k in range(a, b):
            stamp[order[k]] = mark
            if depth[order[k]] > depth[deepest]:
                deepest = order[k]
        index = np.empty(b - a, np.int32)
        for k in range(a, b):
            if depth[order[k]] >= 2:
                index[n] = order[k]
                n += 1
        if n < 0.4 * (b - a) or n < 12:
            n = b - a
            index[:] = order[a:b]
        refit(points, normals, neighbours, index, n, deepest, stamp, mark, kinds, sigma, models[label])
        values[label] = criterion(models[label], points, order[a:b], b - a, sigma)


@kernel
def refit_amid(points, normals, neighbours, order, starts, depth, allowed, sigma, start, stop, models):
    """Give every region the plainest kind that its points away from its border ask for; see `refit_all`.

    Regions with too few such points keep their models.
    """
    stamp = np.zeros(len(points), np.int32)
    plainer = np.empty(len(allowed), np.bool_)
    for label in range(start, stop):
        a, b = starts[label], starts[label + 1]
        kind = int(models[label, 0])
        if kind in (PLANE, PATCH):
            continue
        n, index = _amid(order, a, b, depth)
        if n < AMID:
            continue
        deepest = index[0]
        for k in range(n):
            stamp[index[k]] = 2 * label + 2
            if depth[index[k]] > depth[deepest]:
                deepest = index[k]
        plainer[:] = False
        for other in (PLANE, CYLINDER, SPHERE, CONE, TORUS):
            plainer[other] = allowed[other]
            if other == kind:
                break
        m = models[label].copy()
        refit(points, normals, neighbours, index, n, deepest, stamp, 2 * label + 2, plainer, sigma, m)
        if int(m[0]) != kind:
            models[label] = m


@kernel
def _amid(order, a, b, depth):
    """Return how many points of order[a:b] lie deepest in their region, and these; none where the region is too narrow."""
    index = np.empty(b - a, np.int32)
    for least in (3, 2, 1):
        n = 0
        for k in range(a, b):
            if depth[order[k]] >= least:
                index[n] = order[k]
                n += 1
        if n >= SHARE * (b - a):
            return n, index
    return 0, index


@kernel
def chosen_by_noise(points, neighbours, label, index, n, i, j, models, sigma):
    """Return by how much the misfit of two regions is too small because points chose the nearer surface where the two nearly coincide.

    There most of a point's neighbours, whose noise is not its own, tell which of the two it belongs to.
    """
    total = 0.0
    for k in range(n):
        p = index[k]
        own = label[p]
        other = j if own == i else i
        here, _, _, _ = distance_of(models[own], points[p, 0], points[p, 1], points[p, 2])
        there, _, _, _ = distance_of(models[other], points[p, 0], points[p, 1], points[p, 2])
        a, b = abs(here), abs(there)
        if not a + b < COINCIDENT * sigma:
            continue
        votes = 0
        for q in range(neighbours.shape[1]):
            near = neighbours[p, q]
            if near >= 0 and near != p:
                if label[near] == own:
                    votes += 1
                elif label[near] == other:
                    votes -= 1
        if votes < 0:
            s, t = a / sigma, b / sigma
            total += min(0.5 * t * t, DISTANCE_CAP) - min(0.5 * s * s, DISTANCE_CAP)
    return total


@kernel
def unite_pairs(points, normals, neighbours, label, order, starts, pairs, seeds, kinds, sigma, models, values, start, stop, gains, united):
    """Fit both regions of each pair as one, and tell how much the criteria of the two exceed that of the one."""
    stamp = np.zeros(len(points), np.int32)
    for p in range(start, stop):
        i, j = pairs[p, 0], pairs[p, 1]
        a, b, c, d = starts[i], starts[i + 1], starts[j], starts[j + 1]
        n = b - a + d - c
        index = np.empty(n, np.int32)
        index[: b - a] = order[a:b]
        index[b - a :] = order[c:d]
        mark = 2 * p + 2
        for k in range(n):
            stamp[index[k]] = mark
        gains[p] = -np.inf
        best = np.inf
        m = models[i].copy()
        before = values[i] + values[j] + chosen_by_noise(points, neighbours, label, index, n, i, j, models, sigma)
        # Whatever one surface explains, one of the two models nearly does: unless both are small, try no new kinds.
        for either in (i, j):
            m[:] = models[either]
            if not kinds[int(m[0])]:
                continue
            refine(m, points, index, n, sigma, 6)
            value = criterion(m, points, index, n, sigma)
            if value < before + n:
                settle(m, points, index, n, sigma)
                value = criterion(m, points, index, n, sigma)
            if value < best:
                best = value
                united[p] = m
        if best < before + n or n < 150:
            m[:] = models[i]
            value = refit(points, normals, neighbours, index, n, seeds[p], stamp, mark, kinds, sigma, m)
            if value < best:
                best = value
                united[p] = m
        gains[p] = before - best
