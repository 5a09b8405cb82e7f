"""Joining neighbouring regions that one surface explains as well as two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import MODEL_COST, Sheet, grouped
from scan2nurbs.kernels.refits import misfit, unite_pairs
from scan2nurbs.kernels.runner import run_ranges

LEAST_CONTACT = 6
RANGE = 2
MANY = 300
"""Regions of fewer points tell nothing of the noise: what their parameters cost is not small beside what it leaves."""
COINCIDENT = 1.0
"""Surfaces coincide if points of one leave, a point, less than this in the other: as if they were farther away by half their noise."""
NOISE_LEAVES = 0.5
"""Mean negative log likelihood of normal noise, a point."""


def contacts(label: NDArray[np.int32], neighbours: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """List the pairs of neighbouring labels.

    Returns
    -------
    pairs : (P, 2) int64
        Labels i < j with links between them.
    count : (P,) int64
        How many links.
    place : (P,) int32
        A point on each border.
    """
    n = int(label.max(initial=-1)) + 1
    i = np.repeat(np.arange(len(label)), neighbours.shape[1])
    j = neighbours.ravel()
    meet = (j >= 0) & (label[i] >= 0) & (label[j] >= 0) & (label[i] != label[j])
    i, j = i[meet], j[meet]
    code = np.minimum(label[i], label[j]).astype(np.int64) * max(n, 1) + np.maximum(label[i], label[j])
    by_code = np.argsort(code, kind="stable")
    found, first, count = np.unique(code[by_code], return_index=True, return_counts=True)
    middle = first + count // 2
    return np.stack([found // max(n, 1), found % max(n, 1)], axis=1), count, i[by_code][middle].astype(np.int32)


def unite(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], values: NDArray[np.float64], kinds: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Join pairs of regions while it pays, the most rewarding first.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
    models : (M, SIZE) float64
    values : (M,) float64
        Criteria of the models on their regions.
    kinds : (6,) bool
        Kinds that a joint model may have.

    Returns
    -------
    label, models : arrays
        The joined ones; labels keep gaps.
    """
    label, models, values = label.copy(), models.copy(), values.copy()
    tested: set[tuple[int, int]] = set()
    for _ in range(12):
        pairs, count, place = contacts(label, sheet.neighbours)
        new = np.array([(int(i), int(j)) not in tested for i, j in pairs], bool) & (count >= LEAST_CONTACT)
        pairs, place = pairs[new], place[new]
        if not len(pairs):
            break
        tested.update((int(i), int(j)) for i, j in pairs)
        order, starts = grouped(label, len(models))
        gains, united = _gains(sheet, label, models, values, kinds, (order, starts), (pairs, place))
        worth = gains + _owed_to_choice(sheet, models, values, (order, starts), pairs, gains)
        changed: set[int] = set()
        gone: set[int] = set()
        for p in np.argsort(-worth, kind="stable"):
            i, j = int(pairs[p, 0]), int(pairs[p, 1])
            if worth[p] <= -MODEL_COST:
                break
            if i in gone or j in gone or (i in changed and j in changed):
                tested.discard((i, j))
                continue
            if i in changed or j in changed:
                # One of the two has grown meanwhile: it takes the other as it is, where it explains it.
                i, j = (i, j) if i in changed else (j, i)
                mine = order[starts[j] : starts[j + 1]]
                value = misfit(models[i], sheet.points, mine, len(mine), sheet.sigma)
                if value > values[j] + MODEL_COST:
                    tested.discard((min(i, j), max(i, j)))
                    continue
                values[i] += value
            else:
                models[i] = united[p]
                values[i] += values[j] - gains[p]
            changed.add(i)
            gone.add(j)
            label[label == j] = i
        tested = {pair for pair in tested if not (changed | gone) & set(pair)}
        if not changed:
            break
    return label, models


def _owed_to_choice(
    sheet: Sheet,
    models: NDArray[np.float64],
    values: NDArray[np.float64],
    regions: tuple[NDArray[np.int32], NDArray[np.int64]],
    pairs: NDArray[np.int64],
    gains: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how much of the criteria of pairs is owed to points that chose their region by their noise.

    Where several surfaces nearly coincide, each has the points that noise moved towards it, and leaves less than noise does. What noise
    leaves is what half of all points leave at most; whether two surfaces coincide, the points of the smaller region tell.
    """
    order, starts = regions
    size, owed = np.diff(starts), np.zeros(len(pairs))
    kept = np.isfinite(values) & (size >= MANY)
    if not kept.any():
        return owed
    each, weight = values[kept] / size[kept], size[kept]
    by_value = np.argsort(each, kind="stable")
    middle = by_value[np.searchsorted(np.cumsum(weight[by_value]), 0.5 * weight.sum())]
    luck = np.where(kept, min(float(each[middle]), NOISE_LEAVES) * size - np.sqrt(0.5 * size) - np.where(kept, values, 0.0), 0.0)
    both = np.where(kept[pairs].all(axis=1), np.maximum(luck, 0.0)[pairs].sum(axis=1), 0.0)
    alike = models[pairs[:, 0], 0] == models[pairs[:, 1], 0]
    for p in np.flatnonzero(alike & (gains <= -MODEL_COST) & (gains + both > -MODEL_COST)):
        small, large = sorted(pairs[p].tolist(), key=lambda r: (size[r], r))
        mine = order[starts[small] : starts[small + 1]]
        if misfit(models[large], sheet.points, mine, len(mine), sheet.sigma) < COINCIDENT * len(mine):
            owed[p] = both[p]
    return owed


def _gains(
    sheet: Sheet,
    label: NDArray[np.int32],
    models: NDArray[np.float64],
    values: NDArray[np.float64],
    kinds: NDArray[np.bool_],
    regions: tuple[NDArray[np.int32], NDArray[np.int64]],
    borders: tuple[NDArray[np.int64], NDArray[np.int32]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by how much each pair's criteria exceed those of one joint model, and these models."""
    (order, starts), (pairs, place) = regions, borders
    gains, united = np.empty(len(pairs)), np.zeros((len(pairs), models.shape[1]))
    points, normals, neighbours, sigma = sheet.points, sheet.normals, sheet.neighbours, sheet.sigma

    def judge(a: int, b: int) -> None:
        unite_pairs(points, normals, neighbours, label, order, starts, pairs, place, kinds, sigma, models, values, a, b, gains, united)

    run_ranges(judge, len(pairs), size=RANGE)
    return np.nan_to_num(gains, nan=-np.inf, posinf=np.inf, neginf=-np.inf), united  # neither can be fitted, nor both
