"""Growing primitives over a graph of neighbours, each from the neighbourhood of a point."""

from __future__ import annotations

import numpy as np

from scan2nurbs.kernels.gauss_newton import refine
from scan2nurbs.kernels.primitives import CONE, CYLINDER, FREEDOM, PATCH, PLANE, SPHERE, TORUS, distance_of
from scan2nurbs.kernels.runner import kernel
from scan2nurbs.kernels.starts import best_start, curvatures

FAR = 3.0
"""Points this many sigma from a surface do not follow it."""
DISTANCE_CAP = 4.5
NORMAL_CAP = 2.0
NONE_COST = 6.0
ENOUGH = 2500
"""A model is as good as known from so many points."""
_COSINE = 0.8


@kernel
def cost_of(m, points, normals, i, sigma, tilt):
    """Return the negative log likelihood of a point under a model: of its distance and of its normal, both bounded."""
    d, nx, ny, nz = distance_of(m, points[i, 0], points[i, 1], points[i, 2])
    t = d / sigma
    cost = min(0.5 * t * t, DISTANCE_CAP)
    dot = nx * normals[i, 0] + ny * normals[i, 1] + nz * normals[i, 2]
    if not np.isnan(dot):
        cost += min(0.5 * max(1.0 - dot * dot, 0.0) / (tilt * tilt), NORMAL_CAP)
    return cost


@kernel
def neighbourhood(neighbours, normals, seed, most, cosine, stamp, mark, queue):
    """Collect up to `most` points about a seed over links along which normals turn little; return how many."""
    queue[0] = seed
    stamp[seed] = mark
    n, head = 1, 0
    while head < n < most:
        i = queue[head]
        head += 1
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0 or stamp[j] == mark:
                continue
            dot = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1] + normals[i, 2] * normals[j, 2]
            if not abs(dot) >= cosine:
                continue
            stamp[j] = mark
            queue[n] = j
            n += 1
            if n >= most:
                break
    return n


@kernel
def flood(m, points, normals, neighbours, start, n_start, tolerance, most, stamp, mark, queue):
    """Collect the points connected to `start[:n_start]` that follow a model, up to `most`; return how many."""
    n = 0
    for k in range(n_start):
        i = start[k]
        if stamp[i] != mark and _follows(m, points, normals, i, tolerance):
            stamp[i] = mark
            queue[n] = i
            n += 1
    head = 0
    while head < n < most:
        i = queue[head]
        head += 1
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0 or stamp[j] == mark:
                continue
            stamp[j] = mark
            if _follows(m, points, normals, j, tolerance):
                queue[n] = j
                n += 1
                if n >= most:
                    break
    return n


@kernel
def _follows(m, points, normals, i, tolerance):
    d, nx, ny, nz = distance_of(m, points[i, 0], points[i, 1], points[i, 2])
    if not abs(d) <= tolerance:
        return False
    dot = nx * normals[i, 0] + ny * normals[i, 1] + nz * normals[i, 2]
    return not abs(dot) < _COSINE


@kernel
def grow(m, points, normals, neighbours, first, n_first, sigma, stamp, mark, queue, region):
    """Grow a model from a neighbourhood, fitting it anew each time its region has grown; return the size and the last mark.

    The region is left in `region`; it stays empty where the model does not hold even in its neighbourhood.
    """
    region[:n_first] = first[:n_first]
    n, before = n_first, 0
    for _ in range(14):
        mark += 1
        most = min(2 * n + 40, ENOUGH)
        found = flood(m, points, normals, neighbours, first, n_first, FAR * sigma, most, stamp, mark, queue)
        if found < 0.6 * n_first:
            return 0, mark
        capped = found >= most
        region[:found] = queue[:found]
        n = found
        square = refine(m, points, region, n, sigma, 4)
        if not square < 2.25 * sigma * sigma:
            return 0, mark
        if n >= ENOUGH or (not capped and n <= 1.02 * before):
            break
        before = n
    return n, mark


@kernel
def gain_of(m, points, normals, region, n, sigma, tilt):
    """Return by how much a model lowers the cost of its region against leaving it unexplained, less what its parameters cost."""
    gain = 0.0
    for k in range(n):
        gain += NONE_COST - cost_of(m, points, normals, region[k], sigma, tilt)
    return gain - 0.5 * FREEDOM[int(m[0])] * np.log(max(n, 2))


@kernel
def grow_best(
    points, normals, neighbours, kinds, first, n_first, sigma, tilt, m, stamp, mark, queue, region, reach, chosen, kept, n_kept, top
):
    """Grow every kind from one neighbourhood, the simple ones first, and keep the best; return its size, gain, and the last mark."""
    bend = np.empty(14)
    noise = sigma * sigma
    allowed = noise * (1.0 + 3.5 * np.sqrt(2.0 / n_first))
    if curvatures(points, first, n_first, m, bend) > 1.3 * allowed:
        return 0, top, mark  # an edge, or a bend too sharp for this scale
    kept_any = False
    settled = False
    for kind in (PLANE, CYLINDER, SPHERE, CONE, TORUS, PATCH):
        if settled or (kind == PATCH and n_kept > 600):
            break
        if not kinds[kind]:
            continue
        square = best_start(kind, bend, points, first, n_first, sigma, m)
        if not square < allowed:
            continue
        n, mark = grow(m, points, normals, neighbours, first, n_first, sigma, stamp, mark, queue, region)
        if n < 0.6 * n_first:
            continue
        gain = gain_of(m, points, normals, region, n, sigma, tilt)
        better = n_kept == 0
        if not better:
            better = gain > top and _pays(m, chosen, points, normals, kept, n_kept, n, sigma, tilt)
        if better:
            n_kept, top, kept_any = n, gain, True
            kept[:n] = region[:n]
            chosen[:] = m
            settled = n > 4 * reach and n > 200 and _rms(m, points, region, n) < 1.06 * sigma
    return (n_kept if kept_any else 0), top, mark


@kernel
def _rms(m, points, region, n):
    total = 0.0
    for k in range(n):
        d, _, _, _ = distance_of(m, points[region[k], 0], points[region[k], 1], points[region[k], 2])
        total += d * d
    return np.sqrt(total / n)


@kernel
def _pays(m, chosen, points, normals, kept, n_kept, n, sigma, tilt):
    """Tell whether a model is worth more parameters than the one kept: it explains far more points, or the same ones better."""
    extra = FREEDOM[int(m[0])] - FREEDOM[int(chosen[0])]
    if extra <= 0 or n > 1.3 * n_kept + 20:
        return True
    gained = 0.0
    for k in range(n_kept):
        i = kept[k]
        gained += cost_of(chosen, points, normals, i, sigma, tilt) - cost_of(m, points, normals, i, sigma, tilt)
    return gained > 0.5 * extra * np.log(n_kept) + 3.0
