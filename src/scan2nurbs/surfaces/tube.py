"""Parameters that run around a tube: u once around, v along it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from scan2nurbs.surfaces.loops import angle_around
from scan2nurbs.surfaces.nodes import Nodes
from scan2nurbs.surfaces.unroll import jacobians, tangent_steps

_PROBES = 64
# The gradient of a coordinate that does not run around vanishes; one that does turns once in at most some extents.
_SLOWEST = 0.02


@dataclass(frozen=True)
class Around:
    """A map of the nodes onto a tube.

    Attributes
    ----------
    uv : (M, 2) float64
        Parameters; u in [0, period).
    period : float
        Length of the tube around, the median over the nodes.
    jump : (E, 2) float64
        What to add to uv[j] − uv[i] on the nodes' edges i < j, which is not zero where they cross the seam.
    """

    uv: NDArray[np.float64]
    period: float
    jump: NDArray[np.float64]


def around(nodes: Nodes) -> Iterator[Around]:
    """Yield maps of the nodes around straight lines that may lie inside a tube; none where nothing runs around any of them.

    An edge that crosses a half-plane bounded by the line counts one turn. The smoothest function that jumps by one on those edges
    (a harmonic circle-valued coordinate, de Silva et al. 2011) depends on the line only through the class of loops that enclose it.
    """
    solver = _Poisson(nodes)
    for axis in _axes(nodes):
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        for centre in _centres(nodes, axis):
            d = nodes.points - centre
            found = solver.around(np.arctan2(d @ np.cross(axis, first), d @ first) / (2 * np.pi))
            if found is not None:
                yield found


def around_bends(nodes: Nodes) -> Iterator[Around]:
    """Yield the map around a tube that no straight line runs through, if there is one; slower than `around`."""
    angle = angle_around(nodes)
    found = None if angle is None else _Poisson(nodes).around(angle)
    if found is not None:
        yield found


def poles(nodes: Nodes, turn: NDArray[np.float64]) -> int:
    """Count the nodes whose neighbours a coordinate runs around, though it should run around the tube alone.

    Parameters
    ----------
    nodes : Nodes
    turn : (M,) float64
        The coordinate, in turns; whole turns do not count.

    Notes
    -----
    Where the line that a map runs around leaves the tube through its wall instead of its end, all values meet in one place. The index
    of such a place is what the values' steps add up to, each within half a turn, from one neighbour to the next around it.
    """
    i, j = np.concatenate([nodes.edges, nodes.edges[:, ::-1]]).T
    steps = tangent_steps(nodes, i, j)
    order = np.lexsort((np.arctan2(steps[:, 1], steps[:, 0]), i))
    i, value = i[order], turn[j[order]]
    first = np.searchsorted(i, np.arange(len(nodes.points)))
    following = np.arange(1, len(i) + 1)
    last = np.flatnonzero(np.diff(i, append=-1))
    following[last] = first[i[last]]
    step = value[following] - value
    index = np.bincount(i, step - np.round(step), len(nodes.points))
    return int(np.count_nonzero(np.abs(index) > 0.5))


class _Poisson:
    """Functions on the nodes with wanted differences along the edges, by least squares."""

    def __init__(self, nodes: Nodes) -> None:
        self.nodes = nodes
        self.n = len(nodes.points)
        self.i, self.j = nodes.edges.T
        self.weight = 1.0 / np.maximum(nodes.lengths, 1e-12)
        laplacian = nodes.graph(-self.weight)
        degree = -np.asarray(laplacian.sum(axis=1)).ravel()
        anchor = np.zeros(self.n)
        anchor[0] = degree.mean()
        matrix = csr_array(laplacian + diags_array(degree + anchor)).tocsc()
        self.factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def solve(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return f with f[j] − f[i] as close to step as can be."""
        pull = self.weight * step
        return self.factor.solve(np.bincount(self.j, pull, self.n) - np.bincount(self.i, pull, self.n))

    def around(self, angle: NDArray[np.float64]) -> Around | None:
        """Return the map in the class of an angle (M,) in turns, whatever its shape; None where it does not run around."""
        nodes = self.nodes
        turns = np.round(angle[self.i] - angle[self.j])
        turn = self.solve(-turns)
        gradient = jacobians(nodes, np.stack([turn, turn], 1), np.stack([turns, turns], 1))[:, 0]
        slope = np.linalg.norm(gradient, axis=1)
        if not np.median(slope) * np.ptp(nodes.points, axis=0).max() > _SLOWEST:
            return None
        period = float(1.0 / np.median(slope))
        across = np.stack([-gradient[:, 1], gradient[:, 0]], 1) / np.maximum(slope, 1e-300)[:, None]
        forth = np.einsum("ec,ec->e", tangent_steps(nodes, self.i, self.j), across[self.i])
        back = np.einsum("ec,ec->e", tangent_steps(nodes, self.j, self.i), across[self.j])
        along = self.solve(0.5 * (forth - back))
        whole = np.floor(turn)
        jump = np.zeros((len(self.i), 2))
        jump[:, 0] = period * (turns + whole[self.j] - whole[self.i])
        u = period * np.clip(turn - whole, 0.0, 1.0)
        return Around(np.stack([u, along], axis=1), period, jump)


def _axes(nodes: Nodes) -> Iterator[NDArray[np.float64]]:
    """Yield directions that a tube may have: of its normals (cylinder), of their plane (cone), of its points."""
    normals = nodes.normals
    spread = normals - normals.mean(axis=0)
    points = nodes.points - nodes.points.mean(axis=0)
    seen: list[NDArray[np.float64]] = []
    vectors = [np.linalg.eigh(normals.T @ normals)[1][:, 0], np.linalg.eigh(spread.T @ spread)[1][:, 0]]
    for vector in (*vectors, *np.linalg.eigh(points.T @ points)[1].T[::-1]):
        if all(abs(vector @ other) < 0.985 for other in seen):
            seen.append(vector)
            yield vector


def _centres(nodes: Nodes, axis: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Yield points inside the tube: the centroid, and the middles of the longest inner and outer chords along normals.

    The centroid of a bent profile lies outside of it.
    """
    yield nodes.points.mean(axis=0)
    flat = nodes.points - np.outer(nodes.points @ axis, axis)
    normals = nodes.normals - np.outer(nodes.normals @ axis, axis)
    near = 1.5 * float(np.median(nodes.lengths))
    probes = np.linspace(0, len(flat) - 1, min(_PROBES, len(flat))).astype(np.int64)
    for side in (-1.0, 1.0):
        best, longest = None, 0.0
        for k in probes:
            direction = side * normals[k] / max(float(np.linalg.norm(normals[k])), 1e-12)
            d = flat - flat[k]
            t = d @ direction
            hit = (np.linalg.norm(d - np.outer(t, direction), axis=1) < near) & (t > near)
            if hit.any() and (length := float(t[hit].min())) > longest:
                best, longest = nodes.points[k] + 0.5 * length * direction, length
        if best is not None:
            yield best
