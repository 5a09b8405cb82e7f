"""Check that a cell complex is one."""

from __future__ import annotations

import numpy as np

from scan2nurbs.faces.complex import Topology


def topology_faults(topology: Topology) -> list[str]:
    """Say what is wrong with a complex; nothing, if it is consistent.

    Parameters
    ----------
    topology : Topology

    Returns
    -------
    list of str
        A sentence for every fault found in borders, vertices, loops, bodies and the Euler characteristic.
    """
    return [*_borders(topology), *_loops(topology), *_mesh(topology), *_euler(topology)]


def _borders(t: Topology) -> list[str]:
    faults = []
    degree = np.zeros(len(t.vertices), np.int64)
    for b, border in enumerate(t.borders):
        left, right = border.faces
        if left < 0 or left == right or max(left, right) >= t.n_faces:
            faults.append(f"Border {b} lies between faces {left} and {right}.")
        elif right >= 0 and t.body[left] != t.body[right]:
            faults.append(f"Border {b} lies between two bodies.")
        if not np.isfinite(border.points).all() or len(border.points) < 2:
            faults.append(f"Border {b} has no proper polyline.")
        u, v = border.vertices
        if (u < 0) != (v < 0):
            faults.append(f"Border {b} has one vertex.")
        elif u < 0:
            if not np.array_equal(border.points[0], border.points[-1]):
                faults.append(f"Border {b} has no vertex, but is not closed.")
        else:
            degree[u] += 1
            degree[v] += 1
            if not (np.array_equal(border.points[0], t.vertices[u]) and np.array_equal(border.points[-1], t.vertices[v])):
                faults.append(f"Border {b} does not end in its vertices.")
    faults += [f"Vertex {v} has {d} borders." for v, d in enumerate(degree) if d < 3]
    return faults


def _loops(t: Topology) -> list[str]:
    faults = []
    seen: dict[tuple[int, bool], int] = {}
    for f, loops in enumerate(t.loops):
        for loop in loops:
            if not loop:
                faults.append(f"Face {f} has an empty loop.")
            for k, (b, forward) in enumerate(loop):
                border = t.borders[b]
                if border.faces[0 if forward else 1] != f:
                    faults.append(f"Face {f} walks border {b} with another face on its left.")
                if (b, forward) in seen:
                    faults.append(f"Border {b} is walked twice the same way.")
                seen[b, forward] = f
                after, way = loop[(k + 1) % len(loop)]
                if border.vertices[1 if forward else 0] != t.borders[after].vertices[0 if way else 1]:
                    faults.append(f"A loop of face {f} breaks after border {b}.")
    for b, border in enumerate(t.borders):
        if (b, True) not in seen or ((b, False) in seen) != (border.faces[1] >= 0):
            faults.append(f"Border {b} is not walked once for each of its faces.")
    return faults


def _mesh(t: Topology) -> list[str]:
    tri = t.mesh.triangles
    start, end = tri.ravel().astype(np.int64), np.roll(tri, -1, axis=1).ravel().astype(np.int64)
    n = len(t.mesh.vertices)
    forward, count = np.unique(start * n + end, return_counts=True)
    faults = []
    if (count > 1).any():
        faults.append(f"{int((count > 1).sum())} edges of the mesh are used twice the same way.")
    face = np.repeat(t.mesh.face, 3)
    order = np.argsort(start * n + end)
    back = end * n + start
    place = np.minimum(np.searchsorted(forward, back), len(forward) - 1)
    paired = forward[place] == back
    open_bodies = {int(b) for b in np.unique(t.body[face[~paired]])}
    if not (count > 1).any():
        other = np.where(paired, face[order[place]], -1)
        met = {(int(a), int(b)) for a, b in zip(face, other, strict=True) if a != b}
        # Borders that vanished in a vertex leave their short edges in the mesh.
        for b in t.borders:
            if (b.faces[0], b.faces[1]) not in met:
                faults.append(f"Faces {b.faces[0]} and {b.faces[1]} share a border, but no edge of the mesh.")
    for b, closed in enumerate(t.closed):
        if closed == (b in open_bodies):
            faults.append(f"Body {b} is said to be {'closed' if closed else 'open'}, but its mesh is not.")
    return faults


def _euler(t: Topology) -> list[str]:
    """Compare V − E + F, each face counted with its own characteristic, with that of the mesh."""
    faults = [f"Face {f} has {g} handles." for f, g in enumerate(t.genus) if g < 0]
    tri = t.mesh.triangles
    edges = np.sort(np.concatenate([tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]]), axis=1)
    mesh = len(np.unique(tri)) - len(np.unique(edges, axis=0)) + len(tri)
    n_open = sum(b.vertices[0] >= 0 for b in t.borders)
    faces = sum(2 - 2 * int(g) - len(loops) for g, loops in zip(t.genus, t.loops, strict=True))
    if len(t.vertices) - n_open + faces != mesh:
        faults.append(f"The complex has the Euler characteristic {len(t.vertices) - n_open + faces}, its mesh {mesh}.")
    return faults
