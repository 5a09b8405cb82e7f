"""A thinned picture of a point set: nodes a few spacings apart, with oriented normals and a neighbour graph along the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

NODES = 2000
_NEIGHBOURS = 20
_EDGES = 10
# An edge that leaves either tangent plane by more than this sine jumps between two sheets.
_STEEPEST = 0.6


@dataclass(frozen=True)
class Nodes:
    """Nodes and how they hang together.

    Attributes
    ----------
    points : (M, 3) float64
        Local means, on the surface up to the averaged noise.
    frames : (M, 3, 3) float64
        Rows: two tangent directions and the normal, right-handed, normals oriented consistently along the graph.
    edges : (E, 2) int64
        Pairs i < j of neighbours along the surface.
    spacing : float
        Noise-stable spacing of the points that the nodes stand for.
    """

    points: NDArray[np.float64]
    frames: NDArray[np.float64]
    edges: NDArray[np.int64]
    spacing: float

    @property
    def normals(self) -> NDArray[np.float64]:
        """Oriented unit normals (M, 3)."""
        return self.frames[:, 2]

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Lengths of the edges (E,)."""
        return np.linalg.norm(self.points[self.edges[:, 0]] - self.points[self.edges[:, 1]], axis=1)

    def graph(self, values: NDArray[np.float64] | None = None) -> csr_array:
        """Return the symmetric matrix (M, M) of the edges' values, by default of their lengths."""
        return symmetric(self.edges, self.lengths if values is None else values, len(self.points))


def symmetric(edges: NDArray[np.int64], values: NDArray[np.float64], n: int) -> csr_array:
    """Return the symmetric sparse matrix of values on edges."""
    i, j = edges.T
    return coo_array((np.concatenate([values, values]), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n)).tocsr()


def spacing_of(points: NDArray[np.float64], tree: cKDTree) -> float:
    """Return the noise-stable spacing: median distance to the 12th neighbour · √(π / 12)."""
    k = min(12, len(points) - 1)
    some = points[:: max(1, len(points) // 20000)]
    distance = tree.query(some, k=k + 1)[0][:, k]
    return float(np.median(distance) * np.sqrt(np.pi / k))


def make_nodes(points: NDArray[np.float64]) -> Nodes:
    """Thin points (N, 3) to about `NODES` nodes and connect them along the surface."""
    tree = cKDTree(points)
    spacing = spacing_of(points, tree)
    chosen = _thin(points, max(2.0 * spacing, spacing * np.sqrt(len(points) / NODES)))
    k = min(_NEIGHBOURS, len(points))
    centres, frames = _local_planes(points, points[chosen], np.atleast_2d(tree.query(points[chosen], k=k)[1]))
    edges = _connect(centres, frames[:, 2])
    return Nodes(centres, _orient(centres, frames, edges), edges, spacing)


def _thin(points: NDArray[np.float64], cell: float) -> NDArray[np.int64]:
    """Return one point a cell, the one nearest to the cell's centre, and of two closer than half a cell only the first."""
    if len(points) <= NODES // 2:
        return np.arange(len(points))
    scaled = (points - points.min(axis=0)) / cell
    key = np.floor(scaled).astype(np.int64)
    off = np.sum((scaled - key - 0.5) ** 2, axis=1)
    shape = key.max(axis=0) + 1
    flat = (key[:, 0] * shape[1] + key[:, 1]) * shape[2] + key[:, 2]
    order = np.lexsort((off, flat))
    first = order[np.concatenate([[True], np.diff(flat[order]) > 0])]
    close = cKDTree(points[first]).query_pairs(0.5 * cell, output_type="ndarray")
    kept = np.ones(len(first), bool)
    for i, j in close[np.lexsort((close[:, 1], close[:, 0]))]:
        if kept[i]:
            kept[j] = False
    return first[kept]


def _local_planes(
    points: NDArray[np.float64], queries: NDArray[np.float64], neighbours: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the queries dropped on their neighbours' planes, and the planes' right-handed frames."""
    near = points[neighbours]
    mean = near.mean(axis=1)
    d = near - mean[:, None]
    frames = np.linalg.eigh(np.einsum("nki,nkj->nij", d, d))[1].transpose(0, 2, 1)[:, ::-1].copy()
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    off = np.einsum("ni,ni->n", queries - mean, frames[:, 2])
    return queries - off[:, None] * frames[:, 2], frames


def _connect(points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the neighbour edges that run along the surface, with the shortest bridges between what would be separate pieces."""
    n = len(points)
    tree = cKDTree(points)
    k = min(_EDGES + 1, n)
    near = np.atleast_2d(tree.query(points, k=k)[1])
    edges = _unique(np.column_stack([np.repeat(np.arange(n), k), near.ravel()]))
    d = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(d, axis=1)
    steep = np.maximum(*(np.abs(np.einsum("ei,ei->e", d, normals[edges[:, s]])) for s in (0, 1)))
    edges = edges[(length > 0) & (steep <= _STEEPEST * length)]
    while True:
        count, label = connected_components(symmetric(edges, np.ones(len(edges)), n), directed=False)
        if count == 1:
            return edges
        edges = _unique(np.concatenate([edges, *(_bridges(points, label, piece) for piece in range(count))]))


def _bridges(points: NDArray[np.float64], label: NDArray[np.int32], piece: int) -> NDArray[np.int64]:
    """Return edges from a piece to the rest wherever the gap is not much wider than where it is narrowest."""
    inside, outside = np.flatnonzero(label == piece), np.flatnonzero(label != piece)
    distance, nearest = cKDTree(points[outside]).query(points[inside])
    chosen = distance <= 1.5 * distance.min()
    return np.column_stack([inside[chosen], outside[nearest[chosen]]])


def _unique(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    edges = np.sort(edges, axis=1)
    return np.unique(edges[edges[:, 0] < edges[:, 1]], axis=0)


def _orient(points: NDArray[np.float64], frames: NDArray[np.float64], edges: NDArray[np.int64]) -> NDArray[np.float64]:
    """Turn normals so that they agree along the spanning tree of the most parallel pairs (Hoppe et al. 1992)."""
    normals = frames[:, 2]
    d = points[edges[:, 1]] - points[edges[:, 0]]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    a, b = normals[edges[:, 0]], normals[edges[:, 1]]
    # Two normals of a smooth arc mirror each other across its chord; reflecting one first follows tight bends.
    mirrored = a - 2 * np.einsum("ei,ei->e", a, d)[:, None] * d
    agreement = np.einsum("ei,ei->e", mirrored, b)
    tree = minimum_spanning_tree(symmetric(edges, 1.0 + 1e-6 - np.abs(agreement), len(points)))
    order, before = breadth_first_order(tree, 0, directed=False)
    sign_of_edge = symmetric(edges, np.where(agreement < 0, -1.0, 1.0), len(points)).todok()
    sign = np.ones(len(points))
    for node in order[1:]:
        sign[node] = sign[before[node]] * sign_of_edge[before[node], node]
    out = frames.copy()
    out[:, 1:] *= sign[:, None, None]
    return out
