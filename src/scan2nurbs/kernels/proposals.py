"""Proposals among which a segmentation chooses: primitives grown from seeds that no earlier one explains.

Most seeds, those of creases and of rough places, come to nothing; so several that lie apart are grown at once, in threads, and then
kept one after the other. How many depends on how the last ones fared, not on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.growth import ENOUGH, FAR, NONE_COST, cost_of, flood, grow_best, neighbourhood
from scan2nurbs.kernels.offers import remember
from scan2nurbs.kernels.primitives import FREEDOM, SIZE, distance_of
from scan2nurbs.kernels.runner import kernel, run_ranges

FEWEST, BATCH = 1, 16
"""Seeds at once: fewest where the last ones were kept, since the next may lie on the same face."""
MODEL_COST = 10.0
NOTICEABLE = 0.5
"""Two fits to the same face differ by less than this at its points."""
_SCALES = (20, 50, 130)
_TURNS = (0.6, 0.8, 0.9)


class Proposals(NamedTuple):
    """Models, and which of them explain each point.

    Attributes
    ----------
    models : (M, SIZE) float64
    own : (N,) int32
        The cheapest model of each point, −1 for none.
    candidates : (N, K) int32
        The cheapest models whose regions hold each point, −1 where there are fewer.
    """

    models: NDArray[np.float64]
    own: NDArray[np.int32]
    candidates: NDArray[np.int32]


def propose(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    neighbours: NDArray[np.int32],
    seeds: NDArray[np.int32],
    kinds: NDArray[np.bool_],
    sigma: float,
    tilt: float,
    *,
    least: int,
    most: int,
    room: int,
) -> Proposals:
    """Grow models from the seeds that no earlier model explains.

    Parameters
    ----------
    points, normals : (N, 3) float64
        In units of h; normals are lines, NaN where undefined.
    neighbours : (N, k) int32
    seeds : (S,) int32
        In the order in which they are tried.
    kinds : (6,) bool
        Kinds that may be grown.
    sigma, tilt : float
        Noise across the surface, in h, and of the normals, as a sine.
    least : int
        Smaller regions are not kept.
    most : int
        Models beyond so many are not looked for.
    room : int
        K, how many models a point remembers.
    """
    n = len(points)
    models, count, position, wanted = np.zeros((most, SIZE)), 0, 0, FEWEST
    best, own = np.full(n, NONE_COST), np.full(n, -1, np.int32)
    candidates, offers = np.full((n, room), -1, np.int32), np.full((n, room), np.inf)
    tried, scratch = np.zeros(n, np.bool_), np.zeros((2, n), np.int32)
    grown, sizes, regions = np.zeros((BATCH, SIZE)), np.zeros(BATCH, np.int64), np.empty((BATCH, ENOUGH), np.int32)
    while count < most:
        batch, position = _next_seeds(points, neighbours, seeds, position, wanted, tried, models, candidates, sigma)
        if not len(batch):
            break

        def work(start: int, stop: int, batch: NDArray[np.int32] = batch) -> None:
            _grow(points, normals, neighbours, kinds, batch, models, own, sigma, tilt, start, stop, grown, sizes, regions)

        run_ranges(work, len(batch), size=1)
        before = count
        count = _keep(
            points,
            normals,
            neighbours,
            batch,
            grown,
            sizes,
            regions,
            sigma,
            tilt,
            least,
            count,
            models,
            best,
            own,
            candidates,
            offers,
            tried,
            scratch,
        )
        wanted = FEWEST if count > before else min(2 * wanted, BATCH)
    return Proposals(models[:count].copy(), own, candidates)


@kernel
def _next_seeds(points, neighbours, seeds, position, wanted, tried, models, candidates, sigma):
    """Take the next seeds that no model explains, none beside another; return them, and where to look for more."""
    batch = np.empty(wanted, np.int32)
    n, passed = 0, -1
    while position < len(seeds) and n < wanted:
        seed = seeds[position]
        if not tried[seed]:
            if explained(points, neighbours, models, candidates, seed, sigma):
                tried[seed] = True
            elif not _beside(neighbours, batch, n, seed):
                tried[seed] = True
                batch[n] = seed
                n += 1
            elif passed < 0:
                passed = position
        position += 1
    return batch[:n], position if passed < 0 else passed


@kernel
def _beside(neighbours, batch, n, seed):
    for k in range(n):
        for q in range(neighbours.shape[1]):
            if neighbours[batch[k], q] == seed:
                return True
    return False


@kernel
def _grow(points, normals, neighbours, kinds, batch, models, own, sigma, tilt, start, stop, grown, sizes, regions):
    """Grow the best model of each seed; write it, the size of its region (0 for none), and the region."""
    stamp, mark = np.zeros(len(points), np.int32), 0
    queue, first, region = np.empty(ENOUGH, np.int32), np.empty(_SCALES[-1], np.int32), np.empty(ENOUGH, np.int32)
    m = np.zeros(SIZE)
    for s in range(start, stop):
        n_kept, top = 0, 0.0
        for scale in range(len(_SCALES) - 1, -1, -1):
            mark += 1
            reach = _SCALES[scale]
            n_first = neighbourhood(neighbours, normals, batch[s], reach, _TURNS[scale], stamp, mark, first)
            if n_first < 0.7 * reach or _known(points, models, own, first, n_first, sigma):
                continue
            n, gain, mark = grow_best(
                points,
                normals,
                neighbours,
                kinds,
                first,
                n_first,
                sigma,
                tilt,
                m,
                stamp,
                mark,
                queue,
                region,
                reach,
                grown[s],
                regions[s],
                n_kept,
                top,
            )
            if n > 0:
                n_kept, top = n, gain
            if n_kept > 4 * reach:
                break
        sizes[s] = n_kept


@kernel
def _keep(
    points,
    normals,
    neighbours,
    batch,
    grown,
    sizes,
    regions,
    sigma,
    tilt,
    least,
    count,
    models,
    best,
    own,
    candidates,
    offers,
    tried,
    scratch,
):
    """Keep the models that are worth it, unless one kept before explains the seed; return how many models there are."""
    stamp, queue = scratch[0], scratch[1]
    for s in range(len(batch)):
        n, region = sizes[s], regions[s]
        if s > 0 and explained(points, neighbours, models, candidates, batch[s], sigma):
            continue
        if n < least or _marginal(grown[s], points, normals, region, n, best, sigma, tilt) <= 0.0:
            tried[neighbours[batch[s]]] = True  # −1 stands for the last point, which is no loss
            continue
        if count == len(models):
            break
        models[count] = grown[s]
        if n >= ENOUGH:
            n = flood(grown[s], points, normals, neighbours, region, n, FAR * sigma, len(points), stamp, count + 1, queue)
            region = queue
        for k in range(n):
            i = region[k]
            cost = cost_of(grown[s], points, normals, i, sigma, tilt)
            remember(candidates, offers, i, count, cost)
            if cost < best[i]:
                best[i] = cost
                own[i] = count
        count += 1
    return count


@kernel
def _marginal(m, points, normals, region, n, best, sigma, tilt):
    """Return by how much a model lowers the least cost of its region, less its own cost."""
    gain = 0.0
    for k in range(n):
        gain += max(best[region[k]] - cost_of(m, points, normals, region[k], sigma, tilt) - NOTICEABLE, 0.0)
    return gain - 0.5 * FREEDOM[int(m[0])] * np.log(max(n, 2)) - MODEL_COST


@kernel
def explained(points, neighbours, models, candidates, i, sigma):
    """Tell whether any model whose region holds a point fits it and its neighbours without bias."""
    for c in range(candidates.shape[1]):
        label = candidates[i, c]
        if label < 0:
            continue
        d, _, _, _ = distance_of(models[label], points[i, 0], points[i, 1], points[i, 2])
        if abs(d) > FAR * sigma:
            continue
        total, count = d, 1
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j >= 0:
                d, _, _, _ = distance_of(models[label], points[j, 0], points[j, 1], points[j, 2])
                if abs(d) < 4.0 * sigma:
                    total += d
                    count += 1
        if count > 6 and abs(total) < 2.5 * sigma * np.sqrt(count):
            return True
    return False


@kernel
def _known(points, models, own, first, n, sigma):
    """Tell whether the model of a neighbourhood's first point explains nearly all of it without bias."""
    label = own[first[0]]
    if label < 0:
        return False
    total, count = 0.0, 0
    for k in range(n):
        i = first[k]
        d, _, _, _ = distance_of(models[label], points[i, 0], points[i, 1], points[i, 2])
        if abs(d) < FAR * sigma:
            total += d
            count += 1
    return count > 0.9 * n and abs(total) < 3.0 * sigma * np.sqrt(count)
