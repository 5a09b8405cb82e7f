"""A thinned picture of a point set: nodes a few spacings apart, with oriented normals and a neighbour graph along the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import KDTree

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
    dense : (N,) bool
        Which of the points are not isolated.
    """

    points: NDArray[np.float64]
    frames: NDArray[np.float64]
    edges: NDArray[np.int64]
    spacing: float
    dense: NDArray[np.bool_]

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


def spacing_of(points: NDArray[np.float64], tree: KDTree) -> float:
    """Return the noise-stable spacing: median distance to the 12th neighbour · √(π / 12)."""
    k = min(12, len(points) - 1)
    some = points[:: max(1, len(points) // 20000)]
    distance = tree.query(some, k=k + 1)[0][:, k]
    return float(np.median(distance) * np.sqrt(np.pi / k))


def make_nodes(points: NDArray[np.float64]) -> Nodes:
    """Thin points (N, 3) to about `NODES` nodes and connect them along the surface; what stands alone or off it makes no node."""
    tree = KDTree(points)
    spacing = spacing_of(points, tree)
    is_dense = _dense(points, tree)
    dense = points[is_dense]
    tree = KDTree(dense)
    chosen = _thin(dense, max(2.0 * spacing, spacing * np.sqrt(len(points) / NODES)))
    k = min(_NEIGHBOURS, len(dense))
    centres, frames, off = _local_planes(dense, dense[chosen], _nearest(tree, dense[chosen], k))
    on = off <= 1.5 * spacing
    on = on if np.mean(on) > 0.5 else np.ones(len(on), bool)
    centres, frames = centres[on], frames[on]
    edges = _connect(centres, frames[:, 2])
    whole = _large_pieces(edges, len(centres))
    centres, frames = centres[whole], frames[whole]
    edges = _bridge(centres, (np.cumsum(whole) - 1)[edges[whole[edges].all(axis=1)]])
    return Nodes(centres, _orient(centres, frames, edges), edges, spacing, is_dense)


def _nearest(tree: KDTree, queries: NDArray[np.float64], k: int) -> NDArray[np.int64]:
    _, near = tree.query(queries, k=k)
    return np.asarray(near, dtype=np.int64).reshape(-1, k)


def _dense(points: NDArray[np.float64], tree: KDTree) -> NDArray[np.bool_]:
    """Tell which points are not much farther from their neighbours than those are from theirs."""
    k = min(8, len(points) - 1)
    distance, near = (np.asarray(a) for a in tree.query(points, k=k + 1))
    reach = distance[:, k]
    dense = reach <= 2.0 * np.median(reach[near[:, 1:]], axis=1)
    return dense if np.mean(dense) > 0.5 else np.ones(len(points), bool)


def _large_pieces(edges: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    """Tell which nodes hang together with more than a hundredth of all."""
    label = connected_components(symmetric(edges, np.ones(len(edges)), n), directed=False)[1]
    return np.bincount(label)[label] > 0.01 * n


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
    close = KDTree(points[first]).query_pairs(0.5 * cell, output_type="ndarray")
    kept = np.ones(len(first), bool)
    for i, j in close[np.lexsort((close[:, 1], close[:, 0]))]:
        if kept[i]:
            kept[j] = False
    return first[kept]


def _local_planes(
    points: NDArray[np.float64], queries: NDArray[np.float64], neighbours: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the queries dropped on robust planes of their neighbours, the planes' right-handed frames, and how far they dropped."""
    near = points[neighbours]
    weight = np.ones(near.shape[:2])
    frames, mean = np.empty((len(near), 3, 3)), near[:, 0]
    for _ in range(3):
        mean = np.einsum("nk,nki->ni", weight, near) / weight.sum(axis=1, keepdims=True)
        d = near - mean[:, None]
        frames = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weight, d, d))[1].transpose(0, 2, 1)[:, ::-1].copy()
        height = np.abs(np.einsum("nki,ni->nk", d, frames[:, 2]))
        size = 3.0 * np.median(height, axis=1, keepdims=True) + 1e-6 * np.abs(d).max(axis=(1, 2))[:, None]
        weight = 1.0 / (1.0 + (height / size) ** 2) ** 2
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    off = np.einsum("ni,ni->n", queries - mean, frames[:, 2])
    return queries - off[:, None] * frames[:, 2], frames, np.abs(off)


def _connect(points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the edges between near neighbours that run along the surface."""
    n = len(points)
    k = min(_EDGES + 1, n)
    near = _nearest(KDTree(points), points, k)
    edges = _unique(np.column_stack([np.repeat(np.arange(n), k), near.ravel()]))
    d = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(d, axis=1)
    steep = np.maximum(*(np.abs(np.einsum("ei,ei->e", d, normals[edges[:, s]])) for s in (0, 1)))
    return edges[(length > 0) & (steep <= _STEEPEST * length)]


def _bridge(points: NDArray[np.float64], edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Add the shortest edges between pieces until all nodes hang together."""
    while True:
        count, label = connected_components(symmetric(edges, np.ones(len(edges)), len(points)), directed=False)
        if count == 1:
            return edges
        edges = _unique(np.concatenate([edges, *(_bridges(points, label, piece) for piece in range(count))]))


def _bridges(points: NDArray[np.float64], label: NDArray[np.int32], piece: int) -> NDArray[np.int64]:
    """Return edges from a piece to the rest wherever the gap is not much wider than where it is narrowest."""
    inside, outside = np.flatnonzero(label == piece), np.flatnonzero(label != piece)
    distance, nearest = (np.asarray(a) for a in KDTree(points[outside]).query(points[inside]))
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
