"""Unroll a curved sheet: landmark Isomap for the lie of the land, then as-rigid-as-possible flattening of every tangent neighbourhood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from scan2nurbs.surfaces.nodes import Nodes

_LANDMARKS = 80
_ROUNDS = 60
_CARRIERS = 4


def unroll(nodes: Nodes) -> NDArray[np.float64]:
    """Return nearly isometric parameters (M, 2) of the nodes of one sheet, in their unit."""
    return flatten(nodes, isomap(nodes))


def isomap(nodes: Nodes) -> NDArray[np.float64]:
    """Embed the nodes in a plane by their geodesic distances to landmarks (de Silva and Tenenbaum 2003)."""
    distance = _landmark_distances(nodes)
    landmarks, rows = distance[0], distance[1]
    square = rows[:, landmarks] ** 2
    mean = square.mean(axis=0)
    gram = -0.5 * (square - mean - mean[:, None] + mean.mean())
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T))
    top = np.maximum(values[-2:], 1e-12 * values[-1])
    return -0.5 * (rows**2 - mean[:, None]).T @ (vectors[:, -2:] / np.sqrt(top))


def _landmark_distances(nodes: Nodes) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return landmarks, each the node farthest from those before, and the geodesic distances (landmarks, M) from them."""
    graph = nodes.graph()
    chosen = [int(np.argmax(dijkstra(graph, indices=0)))]
    rows: list[NDArray[np.float64]] = []
    for _ in range(min(_LANDMARKS, len(nodes.points))):
        rows.append(dijkstra(graph, indices=chosen[-1]))
        chosen.append(int(np.argmax(np.min(rows, axis=0))))
    return np.array(chosen[:-1]), np.array(rows)


def flatten(nodes: Nodes, uv: NDArray[np.float64], period: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Improve parameters so that every node's tangent neighbourhood lies in them as rigidly as possible.

    Alternates the best rotation of each neighbourhood with a Poisson solve (Liu et al. 2008, on a graph instead of triangles).

    Parameters
    ----------
    nodes : Nodes
        Nodes with oriented frames.
    uv : (M, 2) float64
        Parameters to start from.
    period : (E, 2) float64, optional
        What to add to uv[j] − uv[i] on edges i < j that cross the seam of a tube.
    """
    i, j = np.concatenate([nodes.edges, nodes.edges[:, ::-1]]).T
    jump = np.zeros((len(i), 2)) if period is None else np.concatenate([period, -period])
    flat = tangent_steps(nodes, i, j)
    weight = 1.0 / np.maximum(np.linalg.norm(flat, axis=1), 1e-12)
    n = len(uv)
    uv = uv if _mean_turn(flat, uv, i, j, jump) > 0 else uv * [1.0, -1.0]
    jump = jump if _mean_turn(flat, uv, i, j, jump) > 0 else jump * [1.0, -1.0]
    laplacian = csr_array((-2.0 * weight, (i, j)), shape=(n, n))
    laplacian = diags_array(-np.asarray(laplacian.sum(axis=1)).ravel()) + laplacian
    solver = splu(
        (laplacian + diags_array(np.r_[weight.mean(), np.zeros(n - 1)])).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    for _ in range(_ROUNDS):
        step = uv[j] - uv[i] + jump
        # The best rotation of one plane is the angle of a complex sum.
        turn = np.bincount(i, weight * (flat[:, 0] * step[:, 0] + flat[:, 1] * step[:, 1]), n) + 1j * np.bincount(
            i, weight * (flat[:, 0] * step[:, 1] - flat[:, 1] * step[:, 0]), n
        )
        turn /= np.maximum(np.abs(turn), 1e-300)
        wanted = turn[i] * (flat[:, 0] + 1j * flat[:, 1])
        target = weight * np.stack([wanted.real - jump[:, 0], wanted.imag - jump[:, 1]])
        right = np.stack([np.bincount(j, t, n) - np.bincount(i, t, n) for t in target], axis=1)
        new = solver.solve(right)
        new -= new.mean(axis=0) - uv.mean(axis=0)
        if np.abs(new - uv).max() < 1e-4 * np.ptp(uv, axis=0).max():
            return new
        uv = new
    return uv


def tangent_steps(nodes: Nodes, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the edges from i to j in the tangent frame of i, (E, 2), with their length in space."""
    d = nodes.points[j] - nodes.points[i]
    flat = np.einsum("eci,ei->ec", nodes.frames[i, :2], d)
    length = np.linalg.norm(flat, axis=1)
    return flat * (np.linalg.norm(d, axis=1) / np.maximum(length, 1e-300))[:, None]


def jacobians(nodes: Nodes, uv: NDArray[np.float64], jump: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Return for each node the matrix (M, 2, 2) that takes its tangent plane to the parameters, by least squares over its edges."""
    i, j = np.concatenate([nodes.edges, nodes.edges[:, ::-1]]).T
    step = uv[j] - uv[i] + (0.0 if jump is None else np.concatenate([jump, -jump]))
    flat = tangent_steps(nodes, i, j)
    n = len(uv)
    cross = np.stack([np.bincount(i, step[:, a] * flat[:, b], n) for a in range(2) for b in range(2)], 1).reshape(n, 2, 2)
    gram = np.stack([np.bincount(i, flat[:, a] * flat[:, b], n) for a in range(2) for b in range(2)], 1).reshape(n, 2, 2)
    trace = np.trace(gram, axis1=1, axis2=2)
    gram += 1e-6 * np.maximum(trace, 1e-300)[:, None, None] * np.eye(2)
    return cross @ np.linalg.inv(gram)


def carry(
    nodes: Nodes, uv: NDArray[np.float64], jacobian: NDArray[np.float64], points: NDArray[np.float64], around: float = 0.0
) -> NDArray[np.float64]:
    """Return the parameters (N, 2) of points from those of the nearest nodes on the same sheet, each continued by its jacobian.

    Parameters
    ----------
    around : float
        Period of u where it runs around a tube, else 0.
    """
    k = min(_CARRIERS, len(uv))
    distance, near = KDTree(nodes.points).query(points, k=k)
    distance, near = distance.reshape(-1, k), near.reshape(-1, k)
    d = points[:, None] - nodes.points[near]
    local = np.einsum("nkci,nki->nkc", nodes.frames[near], d)
    moved = np.einsum("nkab,nkb->nka", jacobian[near], local[..., :2])
    # A node whose plane the point is far off belongs to another sheet.
    weight = 1.0 / (distance**2 + 9.0 * local[..., 2] ** 2 + 1e-6 * nodes.spacing**2)
    guess = uv[near] + moved
    if around > 0.0:
        first = np.take_along_axis(guess, np.argmax(weight, axis=1)[:, None, None], axis=1)
        guess[..., 0] -= around * np.round((guess[..., 0] - first[..., 0]) / around)
    # Two sheets must not be averaged: what lies far from the best guess does not count.
    best = np.take_along_axis(guess, np.argmax(weight, axis=1)[:, None, None], axis=1)
    far = np.linalg.norm(guess - best, axis=2) > distance + distance.max(axis=1, keepdims=True) + nodes.spacing
    weight = np.where(far, 0.0, weight)
    return (guess * weight[..., None]).sum(axis=1) / weight.sum(axis=1, keepdims=True)


def _mean_turn(
    flat: NDArray[np.float64], uv: NDArray[np.float64], i: NDArray[np.int64], j: NDArray[np.int64], jump: NDArray[np.float64]
) -> float:
    """Return the sum of the determinants of the neighbourhoods' maps: positive where most are not mirrored."""
    step, n = uv[j] - uv[i] + jump, len(uv)
    cross = [np.bincount(i, step[:, a] * flat[:, b], n) for a in range(2) for b in range(2)]
    return float(np.sum(np.sign(cross[0] * cross[3] - cross[1] * cross[2])))
