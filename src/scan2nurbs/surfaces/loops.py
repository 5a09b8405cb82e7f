"""Whether a surface runs around something, read from distances along it alone: the harmonic 1-form of a thinned complex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from scan2nurbs.surfaces.nodes import Nodes, symmetric

_CORNERS = 400
# In corner spacings; loops shorter than three times this are filled.
_REACH = 3.2
_ZERO = 1e-7
# A sheet has about ten edges a corner within that reach; what has many more is a volume.
_MOST_EDGES = 15


def angle_around(nodes: Nodes) -> NDArray[np.float64] | None:
    """Return an angle (M,), in turns, that grows by one around the tube; None where there is not exactly one way around.

    Corners spread evenly over the nodes, edges between corners near along the surface, and the triangles between those form a
    complex (Vietoris-Rips on geodesic distances) whose first cohomology counts the loops that bound nothing: the null space of the
    edge Laplacian d₀d₀ᵀ + d₁ᵀd₁ is a line for a tube, however bent, and empty for a sheet (Hodge). Holes in the surface count too,
    so that a tube with large holes is not recognised here.
    """
    corners, distance = _corners(nodes)
    if len(corners) < 30:
        return None
    near = np.where(np.eye(len(corners), dtype=bool), np.inf, distance[:, corners]).min(axis=1)
    i, j = np.nonzero(np.triu(distance[:, corners] <= _REACH * np.median(near), 1))
    if len(i) > _MOST_EDGES * len(corners):
        return None
    edges = np.stack([i, j], axis=1)
    form = _harmonic(edges, len(corners))
    if form is None:
        return None
    angle = _integrate(edges, form, len(corners))
    return None if angle is None else angle[np.argmin(distance, axis=0)]


def _corners(nodes: Nodes) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return nodes, each the farthest from those before, and the distances (corners, M) along the surface from them."""
    graph = nodes.graph()
    chosen, rows = [0], [dijkstra(graph, indices=0)]
    nearest = rows[0]
    while len(chosen) < min(_CORNERS, len(nodes.points) // 2):
        chosen.append(int(np.argmax(nearest)))
        rows.append(dijkstra(graph, indices=chosen[-1]))
        nearest = np.minimum(nearest, rows[-1])
    return np.array(chosen), np.array(rows)


def _harmonic(edges: NDArray[np.int64], n: int) -> NDArray[np.float64] | None:
    """Return the only harmonic form on the edges, None if there is none or more than one."""
    m = len(edges)
    up, across = _boundaries(edges, n)
    laplacian = up @ up.T + across.T @ across
    shift = 1e-3
    factor = splu((laplacian + shift * eye_array(m)).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    inverse = LinearOperator((m, m), matvec=factor.solve, dtype=np.float64)  # type: ignore[call-arg] - the stubs know no keywords
    values, vectors = eigsh(inverse, k=2, which="LM", v0=np.cos(np.arange(m)))
    values = 1.0 / values - shift
    order = np.argsort(values)
    return vectors[:, order[0]] if values[order[0]] < _ZERO < 1e3 * _ZERO < values[order[1]] else None


def _boundaries(edges: NDArray[np.int64], n: int) -> tuple[csr_array, csr_array]:
    """Return d₀ (E, n), differences along edges, and d₁ (T, E), sums around the triangles of the graph."""
    i, j = edges.T
    m = len(edges)
    numbers = np.arange(m)
    up = coo_array((np.repeat([-1.0, 1.0], m), (np.tile(numbers, 2), np.concatenate([i, j]))), shape=(m, n)).tocsr()
    number_of = np.zeros((n, n), np.int64)
    number_of[i, j] = numbers
    touching = symmetric(edges, np.ones(m), n).toarray() > 0
    edge, k = np.nonzero(touching[i] & touching[j])
    # Each triangle once: its first edge joins the two lowest corners.
    edge, k = edge[k > j[edge]], k[k > j[edge]]
    sides = np.concatenate([edge, number_of[j[edge], k], number_of[i[edge], k]])
    rows = np.tile(np.arange(len(edge)), 3)
    across = coo_array((np.repeat([1.0, 1.0, -1.0], len(edge)), (rows, sides)), shape=(len(edge), m)).tocsr()
    return up, across


def _integrate(edges: NDArray[np.int64], form: NDArray[np.float64], n: int) -> NDArray[np.float64] | None:
    """Sum the form along a spanning tree and scale it so that what is left on the other edges are whole turns."""
    i, j = edges.T
    step = np.zeros((n, n))
    step[i, j], step[j, i] = form, -form
    order, before = breadth_first_order(symmetric(edges, np.ones(len(edges)), n), 0, directed=False)
    value = np.zeros(n)
    for corner in order[1:]:
        value[corner] = value[before[corner]] + step[before[corner], corner]
    rest = np.abs(form - (value[j] - value[i]))
    largest = float(rest.max())
    if len(order) < n or not largest > 1e-6 * float(np.abs(form).max()):
        return None
    period = float(np.median(rest[rest > 0.5 * largest]))
    return value / period if np.abs(rest / period - np.round(rest / period)).max() < 0.05 else None
