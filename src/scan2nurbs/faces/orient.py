"""Which way is out: one sign for every patch of points that share a face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from scan2nurbs.surfaces.shape import Floats

DIRECTIONS = 64
"""Directions in which a body is asked for its farthest point."""
ASIDE = 0.5
"""A point is on the border of its patch where its neighbours in it lie so far to one side, in shares of their mean distance: over half a
disc it is 2/π."""


def find_patches(label: NDArray[np.int32], neighbours: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find the connected patches of points of one label over the graph (N, k) of near points; return that of each point, (N,) int32."""
    n, k = neighbours.shape
    i, j = np.repeat(np.arange(n), k), neighbours.ravel()
    same = (j >= 0) & (label[i] == label[j])
    graph = coo_matrix((np.ones(int(same.sum()), np.int8), (i[same], j[same])), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def outward_signs(
    points: Floats, normals: Floats, patch: NDArray[np.int32], neighbours: NDArray[np.int32], reach: Floats
) -> NDArray[np.int8]:
    """Find the sign of each patch's normals that makes all of them point out of the body.

    Parameters
    ----------
    points, normals : (N, 3) float64
        Points on their faces' surfaces with the unit normals there, of one side in each patch.
    patch : (N,) int32
        Patch of each point.
    neighbours : (N, k) int32
        Near points of each point, −1 for none.
    reach : (N,) float64
        Distance over which neighbours tell about each other.

    Returns
    -------
    (P,) int8
        +1 or −1 for each patch.

    Notes
    -----
    Neighbours of two patches vote for equal signs as far as the normal of one, reflected in the plane amid them, is that of the other: as
    if a circle ran through both (Xie, McDonnell and Qin 2004). That holds across smooth borders and thin walls, but not across a step
    lower than it is wide. Where both points lie on the borders of their patches, these say it: an oriented surface passes a border that
    two patches share once in either direction. The votes are summed by pairs of patches, the strongest ones make a tree, and then single
    patches change while the others outvote them. What hangs together is turned so that its farthest points in many directions face these
    directions.
    """
    n_patches = int(patch.max()) + 1
    votes = _votes(points, normals, patch, neighbours, reach, n_patches)
    sign = _along_tree(votes)
    _settle(votes, sign)
    n, body = connected_components(votes, directed=False)
    sign[_faces_in(points, normals * sign[patch][:, None], body[patch], n)[body]] *= -1
    return sign.astype(np.int8)


def _votes(
    points: Floats, normals: Floats, patch: NDArray[np.int32], neighbours: NDArray[np.int32], reach: Floats, n_patches: int
) -> csr_matrix:
    """Return how strongly near points of each two patches agree: negative where they disagree."""
    n, k = neighbours.shape
    i, j = np.repeat(np.arange(n), k), neighbours.ravel()
    near = j >= 0
    same = patch[i] == patch[j]
    along, share = _borders(points, normals, i[near & same], j[near & same])
    i, j = i[near & ~same], j[near & ~same]
    way = points[j] - points[i]
    square = np.einsum("ij,ij->i", way, way)
    along_i, along_j = np.einsum("ij,ij->i", normals[i], way), np.einsum("ij,ij->i", normals[j], way)
    circle = np.einsum("ij,ij->i", normals[i], normals[j]) - 2.0 * along_i * along_j / np.maximum(square, 1e-300)
    border = -np.einsum("ij,ij->i", along[i], along[j])
    both = share[i] * share[j]
    agree = (both * border + (1.0 - both) * circle) * np.exp(-square / reach[i] ** 2)
    graph = coo_matrix((agree, (patch[i], patch[j])), shape=(n_patches, n_patches)).tocsr()
    return (graph + graph.T).tocsr()


def _borders(points: Floats, normals: Floats, i: NDArray[np.intp], j: NDArray[np.int32]) -> tuple[Floats, Floats]:
    """Return how the border of its patch runs at each point (N, 3), the patch on the left, and how clearly the point lies on one (N,)."""
    n = len(points)
    way = points[j] - points[i]
    count = np.maximum(np.bincount(i, minlength=n), 1)
    inward = np.column_stack([np.bincount(i, way[:, c], minlength=n) for c in range(3)]) / count[:, None]
    inward -= np.einsum("ij,ij->i", inward, normals)[:, None] * normals
    far = np.bincount(i, np.linalg.norm(way, axis=1), minlength=n) / count
    length = np.linalg.norm(inward, axis=1)
    share = np.clip(length / np.maximum(ASIDE * far, 1e-300), 0.0, 1.0)
    return np.asarray(np.cross(inward / np.maximum(length, 1e-300)[:, None], normals), np.float64), np.asarray(share, np.float64)


def _along_tree(votes: csr_matrix) -> NDArray[np.int8]:
    """Give signs along the spanning trees of the strongest votes."""
    n = len(votes.indptr) - 1
    weight = votes.copy()
    weight.data = 1.0 / (np.abs(weight.data) + 1e-12)
    tree = minimum_spanning_tree(weight)
    tree = (tree + tree.T).tocsr()
    sign = np.zeros(n, np.int8)
    for root in range(n):
        if sign[root] == 0:
            order, before = breadth_first_order(tree, root, directed=False)
            sign[root] = 1
            for a in order[1:]:
                sign[a] = sign[before[a]] * (1 if votes[a, before[a]] >= 0 else -1)
    return sign


def _settle(votes: csr_matrix, sign: NDArray[np.int8]) -> None:
    """Turn the sign that disagrees most, while one does."""
    for _ in range(20):
        gain = sign * (votes @ sign.astype(np.float64))
        worst = int(np.argmin(gain))
        if gain[worst] >= 0:
            return
        sign[worst] *= -1


def _faces_in(points: Floats, normals: Floats, body: NDArray[np.int32], n: int) -> NDArray[np.bool_]:
    """Tell of each body whether its farthest points look inwards."""
    inward = np.zeros(n, bool)
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    order = np.argsort(body, kind="stable")
    start = np.searchsorted(body[order], np.arange(n + 1))
    for b in range(n):
        rows = order[start[b] : start[b + 1]]
        height = points[rows] @ directions.T
        far = rows[np.argmax(height, axis=0)]
        inward[b] = np.einsum("ij,ij->", normals[far], directions) < 0
    return inward
