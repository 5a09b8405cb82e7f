"""Labels chosen sweep by sweep: points whose beliefs stay are passed over, and the choice is that of all points renewed."""

import numpy as np
import pytest

from scan2nurbs.kernels.growth import NONE_COST
from scan2nurbs.kernels.labelling import choose_labels


def every_point_renewed(candidates, costs, neighbours, weights, rounds=20):
    """The twin: all beliefs are renewed in every sweep."""
    n, room = candidates.shape
    belief = np.zeros((n, room + 1))
    for step in range(rounds):
        score = np.column_stack([np.where(candidates >= 0, -costs, -1e9), np.full(n, -NONE_COST)])
        for i in range(n if step else 0):
            for j, w in zip(neighbours[i], weights[i], strict=True):
                same = (candidates[i][:, None] == candidates[j][None]) & (candidates[j] >= 0)[None]
                score[i, :room] += w * (same * belief[j, :room]).sum(axis=1)
        power = np.exp(min(1.0, 0.3 + 0.1 * step) * (score - score.max(axis=1, keepdims=True)))
        belief = power / power.sum(axis=1, keepdims=True)
    choice = belief.argmax(axis=1)
    picked = candidates[np.arange(n), np.minimum(choice, room - 1)]
    return np.where(choice < room, picked, -1)


@pytest.mark.parametrize("seed", range(4))
def test_the_choice_is_that_of_all_points_renewed(seed):
    rng = np.random.default_rng(seed)
    n, room = 400, 3
    place = np.arange(n)
    neighbours = np.column_stack([(place + step) % n for step in (-2, -1, 1, 2)]).astype(np.int32)
    candidates = np.array([rng.permutation(5)[:room] for _ in range(n)], np.int32)
    candidates[rng.random((n, room)) < 0.1] = -1
    costs = rng.uniform(0.0, 3.0, (n, room)).astype(np.float32)
    costs[place < n // 2] *= 0.1  # slow to settle beside the others
    weights = rng.uniform(0.2, 1.2, neighbours.shape).astype(np.float32)
    found = choose_labels(candidates, costs, neighbours, weights)
    np.testing.assert_array_equal(found, every_point_renewed(candidates, costs, neighbours, weights))


def test_what_settled_moves_when_its_neighbour_does():
    n = 40
    before = np.maximum(np.arange(n) - 1, 0)[:, None].astype(np.int32)
    candidates, weights = np.tile(np.array([0, 1], np.int32), (n, 1)), np.full((n, 1), 9.0, np.float32)
    costs = np.tile(np.array([3.0, 0.0], np.float32), (n, 1))
    costs[0], weights[0] = (0.0, 9.0), 0.0
    found = choose_labels(candidates, costs, before, weights)
    np.testing.assert_array_equal(found, every_point_renewed(candidates, costs, before, weights))
    assert 10 < np.count_nonzero(found == 0) < 30, "it went on from point to point, a sweep each"
