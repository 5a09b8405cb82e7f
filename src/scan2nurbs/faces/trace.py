"""Read the cell complex off a mesh: borders run between vertices of two regions, and end in triangles of three."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from scan2nurbs.faces.complex import Loop
from scan2nurbs.faces.sheet import Sheet


@dataclass(frozen=True)
class Closed:
    """A mesh whose holes are capped with a fan of triangles about a vertex each that has no place.

    Attributes
    ----------
    triangles : (M, 3) int32
        Those of the mesh come first.
    twin : (3 M,) int32
        Half-edge beside each; none lacks one.
    n_vertices : int
        Vertices of the mesh; the caps' vertices follow.
    n_holes : int
    """

    triangles: NDArray[np.int32]
    twin: NDArray[np.int32]
    n_vertices: int
    n_holes: int


@dataclass(frozen=True)
class Traced:
    """The combinatorial complex.

    Attributes
    ----------
    borders : tuple of (K,) int64
        Half-edges that each border crosses in turn, from a vertex of the region on its left to one of that on its right.
    sides : (B, 2) int32
        Regions on the left and the right; −1 for a hole.
    ends : (B, 2) int32
        Vertices at the ends, −1 for closed borders.
    corners : (V,) int32
        Triangle of each vertex of the complex.
    loops : tuple of tuple of Loop
        Of each region.
    """

    borders: tuple[NDArray[np.int64], ...]
    sides: NDArray[np.int32]
    ends: NDArray[np.int32]
    corners: NDArray[np.int32]
    loops: tuple[tuple[Loop, ...], ...]


def cap_holes(sheet: Sheet) -> Closed:
    """Close a mesh with borders."""
    triangles, twin = sheet.triangles, sheet.twin
    m, n = len(triangles), len(sheet.source)
    edge = np.flatnonzero(twin < 0)
    if len(edge) == 0:
        return Closed(triangles, twin, n, 0)
    start, end = triangles.ravel()[edge], np.roll(triangles, -1, axis=1).ravel()[edge]
    # Vertices have one fan of triangles, so that one half-edge of the border leaves each.
    leaving = np.full(n, -1)
    leaving[start] = np.arange(len(edge))
    after = leaving[end]
    graph = coo_matrix((np.ones(len(edge), np.int8), (np.arange(len(edge)), after)), shape=(len(edge), len(edge)))
    n_holes, hole = connected_components(graph, directed=False)
    cap = 3 * (m + np.arange(len(edge)))
    joined = np.concatenate([twin, np.empty(3 * len(edge), twin.dtype)])
    joined[edge], joined[cap] = cap, edge
    # Corners of a cap: end, start, hole.
    joined[cap[after] + 1], joined[cap + 2] = cap + 2, cap[after] + 1
    caps = np.column_stack([end, start, n + hole]).astype(np.int32)
    return Closed(np.concatenate([triangles, caps]), joined, n, int(n_holes))


def trace(mesh: Closed, region: NDArray[np.int32]) -> Traced:
    """Trace the borders between the regions of a closed mesh's vertices.

    Parameters
    ----------
    mesh : Closed
    region : (V,) int32
        Region of each vertex of the mesh without its caps.

    Notes
    -----
    The regions are unions of the vertices' dual cells, three of which meet in every triangle: so every border has two sides, and every
    vertex three borders.
    """
    of = np.concatenate([region, np.full(mesh.n_holes, -1, np.int32)])[mesh.triangles]
    left, right, third = of.ravel(), np.roll(of, -1, axis=1).ravel(), np.roll(of, -2, axis=1).ravel()
    half = np.arange(len(left))
    following, previous = half // 3 * 3 + (half + 1) % 3, half // 3 * 3 + (half + 2) % 3
    # Through the triangle a half-edge belongs to, on between the same two regions.
    onward = np.where(third == left, mesh.twin[following], np.where(third == right, mesh.twin[previous], -1))
    triple = (of[:, 0] != of[:, 1]) & (of[:, 1] != of[:, 2]) & (of[:, 2] != of[:, 0])
    borders = _chains(left > right, onward, triple[mesh.twin // 3])
    corners = np.flatnonzero(triple).astype(np.int32)
    number = np.full(len(of), -1, np.int32)
    number[corners] = np.arange(len(corners), dtype=np.int32)
    first = np.array([b[0] for b in borders], np.int64)
    last = np.array([b[-1] for b in borders], np.int64)
    ends = np.column_stack([number[mesh.twin[first] // 3], number[last // 3]]).reshape(-1, 2)
    sides = np.column_stack([left[first], right[first]]).reshape(-1, 2)
    turn = mesh.twin[previous]
    loops = _loops(sides, first, last, mesh.twin, turn, ends, int(region.max()) + 1)
    return Traced(tuple(borders), sides.astype(np.int32), ends.astype(np.int32), corners, loops)


def _chains(mixed: NDArray[np.bool_], onward: NDArray[np.int32], begins: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Follow the half-edges that borders cross; open ones first, then what is left, which are cycles."""
    step = onward.tolist()
    todo = mixed.tolist()
    chains = []
    for seeds in (np.flatnonzero(mixed & begins), np.flatnonzero(mixed)):
        for seed in seeds.tolist():
            if not todo[seed]:
                continue
            chain, h = [], seed
            while h >= 0 and todo[h]:
                todo[h] = False
                chain.append(h)
                h = step[h]
            chains.append(np.array(chain, np.int64))
    return chains


def _loops(
    sides: NDArray[np.int32],
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    twin: NDArray[np.int32],
    turn: NDArray[np.int32],
    ends: NDArray[np.int32],
    n_regions: int,
) -> tuple[tuple[Loop, ...], ...]:
    """Go from border to border about each region, which stays on the left."""
    starts, stops = {}, {}
    for b in range(len(first)):
        starts[int(first[b])], starts[int(twin[last[b]])] = (b, True), (b, False)
        stops[b, True], stops[b, False] = int(last[b]), int(twin[first[b]])
    loops: list[list[Loop]] = [[] for _ in range(n_regions)]
    done = set()
    for b in range(len(first)):
        for way in (True, False):
            region = int(sides[b][0 if way else 1])
            if region < 0 or (b, way) in done:
                continue
            loop, at = [], (b, way)
            while at not in done:
                done.add(at)
                loop.append(at)
                if ends[at[0]][0] < 0:
                    break
                at = starts[int(turn[stops[at]])]
            loops[region].append(tuple(loop))
    return tuple(tuple(some) for some in loops)


def genera(mesh: Closed, region: NDArray[np.int32], n_loops: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return the number of handles (R,) of each region, from its Euler characteristic and the number of its loops (R,)."""
    n = len(n_loops)
    of = np.concatenate([region, np.full(mesh.n_holes, -1, np.int32)])[mesh.triangles]
    along = of == np.roll(of, -1, axis=1)
    inner = along.all(axis=1)
    count = np.bincount(region, minlength=n)
    edges = np.bincount(of[along & (of >= 0)], minlength=n) // 2
    faces = np.bincount(of[inner & (of[:, 0] >= 0), 0], minlength=n)
    return ((2 - n_loops - (count - edges + faces)) // 2).astype(np.int32)
