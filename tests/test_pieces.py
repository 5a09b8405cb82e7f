"""Connected pieces of labels against SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scan2nurbs.kernels.pieces import label_pieces


def pieces_of_scipy(points, label, neighbours, longest, strips):
    """List all links, and let SciPy find what hangs together."""
    n = len(neighbours)
    links = [(i, j) for i in range(n) for j in neighbours[i]]
    if strips:
        links += [(a, b) for row in neighbours for a in row for b in row]
    links = [(i, j) for i, j in links if min(i, j) >= 0 and label[i] == label[j] >= 0 and np.linalg.norm(points[i] - points[j]) < longest]
    i, j = np.array(links, int).reshape(-1, 2).T
    _, piece = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)
    _, first = np.unique(piece, return_index=True)
    return first[piece]


@given(st.integers(0, 10_000), st.integers(1, 60), st.integers(1, 4))
def test_pieces_are_those_of_scipy(seed, n, k):
    rng = np.random.default_rng(seed)
    points, label = rng.uniform(size=(n, 3)), rng.integers(-1, 3, n).astype(np.int32)
    neighbours = rng.integers(-1, n, (n, k)).astype(np.int32)
    found = label_pieces(points, label, neighbours, 0.6)
    assert np.array_equal(found, pieces_of_scipy(points, label, neighbours, 0.6, strips=False))


@pytest.mark.parametrize("seed", range(20))
def test_pieces_of_strips_hang_together_by_common_neighbours(seed):
    rng = np.random.default_rng(seed)
    points, label = rng.uniform(size=(80, 3)), rng.integers(-1, 4, 80).astype(np.int32)
    neighbours = rng.integers(0, 80, (80, 3)).astype(np.int32)
    found = label_pieces(points, label, neighbours, np.inf, strips=True)
    assert np.array_equal(found, pieces_of_scipy(points, label, neighbours, np.inf, strips=True))
    assert len(np.unique(found)) < len(np.unique(label_pieces(points, label, neighbours, np.inf)))


def test_points_without_a_label_are_pieces_of_their_own():
    neighbours = np.array([[1, 2], [0, 2], [0, 1]], np.int32)
    points = np.zeros((3, 3))
    assert label_pieces(points, np.full(3, -1, np.int32), neighbours, 1.0).tolist() == [0, 1, 2]
    assert label_pieces(points, np.array([-1, 5, 5], np.int32), neighbours, 1.0).tolist() == [0, 1, 1]
