"""Proposals grown from several seeds at once: the same at any number of threads, apart from each other, and no more than are needed."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.kernels.bends import bends
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.kernels.primitives import PLANE, SIZE
from scan2nurbs.kernels.proposals import BATCH, _next_seeds, propose
from scan2nurbs.kernels.runner import set_threads
from test_segmentation import NOISE, box


@pytest.fixture(scope="module")
def body():
    """A noisy box: its points, normals and neighbours."""
    points, _ = box(np.random.default_rng(3))
    cells = build_cells(points, 3.0)
    neighbours, _ = nearest_neighbours(cells, 8, reach=2.0)
    points = np.ascontiguousarray(cells.points)
    low, high = points.min(axis=0), points.max(axis=0)
    side = np.argmin(np.concatenate([points - low, high - points], axis=1), axis=1) % 3
    normals = np.eye(3)[side]
    return points, normals, neighbours, np.argsort(bends(points, normals, neighbours)[0][:, 0] ** 2, kind="stable").astype(np.int32)


def proposals(body, seeds=None, most=100):
    kinds = np.ones(6, bool)
    points, normals, neighbours, order = body
    return propose(points, normals, neighbours, order if seeds is None else seeds, kinds, NOISE, 0.1, least=15, most=most, room=4)


def test_the_six_planes_are_among_few(body):
    found = proposals(body)
    planes = found.models[found.models[:, 0] == PLANE]
    for axis in np.eye(3):
        assert (np.abs(planes[:, 4:7] @ axis) > 0.999).sum() >= 2
    assert len(found.models) < 20
    assert (found.own >= 0).mean() > 0.95


def test_any_number_of_threads_finds_the_same(body):
    found = []
    try:
        for threads in (1, 2, 8):
            set_threads(threads)
            found.append(proposals(body))
    finally:
        set_threads(None)
    for other in found[1:]:
        for mine, its in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(mine, its)


def test_seeds_of_a_batch_are_not_beside_each_other_and_none_is_lost(body):
    points, _, neighbours, order = body
    tried, position, taken = np.zeros(len(points), bool), 0, []
    models, candidates = np.zeros((1, SIZE)), np.full((len(points), 4), -1, np.int32)
    while True:
        batch, position = _next_seeds(points, neighbours, order, position, BATCH, tried, models, candidates, NOISE)
        if not len(batch):
            break
        assert not any(np.isin(batch[k + 1 :], neighbours[batch[k]]).any() for k in range(len(batch)))
        taken += batch.tolist()
    assert sorted(taken) == list(range(len(points)))


def test_no_more_models_than_asked_for(body):
    assert len(proposals(body, most=2).models) == 2


def test_without_seeds_there_is_nothing(body):
    found = proposals(body, seeds=np.empty(0, np.int32))
    assert len(found.models) == 0
    assert (found.own == -1).all()
