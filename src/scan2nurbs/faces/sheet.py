"""A surface through oriented points: the triangles between the tetrahedra inside and those outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.cut import decide_sides
from scan2nurbs.kernels.tetrahedra import between, sides
from scan2nurbs.surfaces.shape import Floats

JITTER = 0.02
"""How far, in h, the points are shaken, since points on planes and spheres have no unique Delaunay tetrahedra."""


UPRIGHT = 0.2
"""Cosine of the angle (78 degrees) to its corners' normals beyond which a triangle stands on end."""
PEELINGS = 20
"""Most layers of such triangles that are taken away."""


@dataclass(frozen=True)
class Sheet:
    """An oriented 2-manifold of triangles, with or without a border.

    Attributes
    ----------
    source : (V,) int32
        Point that each vertex comes from; a point at which the surface touches itself is several vertices.
    triangles : (M, 3) int32
        Vertices, counter-clockwise seen from outside.
    twin : (3 M,) int32
        Half-edge 3 f + k runs from corner k of triangle f to its next corner; the half-edge beside it, −1 on the border.
    """

    source: NDArray[np.int32]
    triangles: NDArray[np.int32]
    twin: NDArray[np.int32]


def span_sheet(points: Floats, normals: Floats, h: float) -> Sheet:
    """Span a surface without a border, as far as there is no end of the hull, through oriented points.

    Parameters
    ----------
    points : (N, 3) float64
        Points of a surface, about h apart.
    normals : (N, 3) float64
        Its outward unit normals.
    h : float
        The spacing.

    Raises
    ------
    NoResultError
        If the points are too few, or all in one place.

    Notes
    -----
    The Delaunay triangulation restricted to the surface (Edelsbrunner and Shah 1997): the triangles whose dual edges cross it. It is the
    border between two sets of tetrahedra, so that its edges pair by construction.
    """
    shaken = points + np.random.default_rng(0).normal(size=points.shape) * (JITTER * h)
    try:
        delaunay = Delaunay(shaken)
    except (QhullError, ValueError) as error:
        raise NoResultError("The points are too few, or lie too close to each other, for a surface.") from error
    tetrahedra, neighbours, apex = _with_outside(delaunay.simplices, delaunay.neighbors)
    positive = _positive(shaken, tetrahedra, apex)
    depth, mixed = sides(shaken, normals, tetrahedra, apex, h)
    inside = depth > 0
    inside[mixed] = decide_sides(shaken, tetrahedra, neighbours, depth, mixed, h)
    triangles, twin = between(tetrahedra, neighbours, inside, positive)
    return _split(np.arange(len(points), dtype=np.int32), triangles, twin)


def _with_outside(simplices: NDArray[np.int32], neighbors: NDArray[np.int32]) -> tuple[NDArray[np.int32], ...]:
    """Append a tetrahedron with the point at infinity, −1, to every triangle of the hull."""
    n = len(simplices)
    inner, corner = np.nonzero(neighbors < 0)
    m = len(inner)
    hull = np.stack([simplices[inner, (corner + j) % 4] for j in (1, 2, 3)], axis=1)
    tetrahedra = np.concatenate([simplices, np.column_stack([hull, np.full(m, -1)])]).astype(np.int32)
    neighbours = np.concatenate([neighbors, np.full((m, 4), -1)]).astype(np.int32)
    neighbours[inner, corner] = n + np.arange(m)
    neighbours[n:, 3] = inner
    # The edges of the hull are shared by two of its triangles each.
    edges = np.sort(np.concatenate([hull[:, [1, 2]], hull[:, [0, 2]], hull[:, [0, 1]]]), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0])).reshape(-1, 2)
    for a, b in (order.T, order.T[::-1]):
        neighbours[n + a % m, a // m] = n + b % m
    apex = np.full(n + m, -1, np.int32)
    apex[n:] = simplices[inner, corner]
    return tetrahedra, neighbours, apex


def _positive(points: Floats, tetrahedra: NDArray[np.int32], apex: NDArray[np.int32]) -> NDArray[np.bool_]:
    outside = tetrahedra[:, 3] < 0
    fourth = np.where(outside, apex, tetrahedra[:, 3])
    a = points[tetrahedra[:, 0]]
    u, v, w = points[tetrahedra[:, 1]] - a, points[tetrahedra[:, 2]] - a, points[fourth] - a
    return (np.einsum("ij,ij->i", np.cross(u, v), w) > 0) ^ outside


def drop_triangles(sheet: Sheet, keep: NDArray[np.bool_]) -> Sheet:
    """Keep some (M,) of the triangles, and part the vertices that then hang together in one point only."""
    number = np.where(keep, np.cumsum(keep) - 1, -1).astype(np.int32)
    twin = sheet.twin.reshape(-1, 3)[keep].ravel()
    twin = np.where(twin >= 0, number[twin // 3] * 3 + twin % 3, -1)
    twin[twin < 0] = -1
    return _split(sheet.source, sheet.triangles[keep], twin.astype(np.int32))


def _split(source: NDArray[np.int32], triangles: NDArray[np.int32], twin: NDArray[np.int32]) -> Sheet:
    """Make a vertex of every fan of triangles."""
    corner = np.flatnonzero(twin >= 0)
    # A half-edge and the one after its twin begin at the same vertex.
    after = twin[corner] // 3 * 3 + (twin[corner] + 1) % 3
    graph = coo_matrix((np.ones(len(corner), np.int8), (corner, after)), shape=(len(twin), len(twin)))
    n, fan = connected_components(graph, directed=False)
    origin = np.empty(n, np.int32)
    origin[fan] = source[triangles.ravel()]
    # Vertices in the order of the points that they come from.
    order = np.argsort(origin, kind="stable")
    rank = np.empty(n, np.int32)
    rank[order] = np.arange(n, dtype=np.int32)
    return Sheet(origin[order], rank[fan].reshape(-1, 3), twin)


def peel(sheet: Sheet, points: Floats, normals: Floats) -> Sheet:
    """Take away, from its borders inwards, what closes an open surface but stands upright on it.

    Parameters
    ----------
    sheet : Sheet
    points, normals : (N, 3) float64
        The points that its vertices come from, and the outward unit normals at them.
    """
    for _ in range(PEELINGS):
        rim = np.zeros(len(sheet.triangles), bool)
        rim[np.flatnonzero(sheet.twin < 0) // 3] = True
        if rim.any():
            corners = sheet.source[sheet.triangles[rim]]
            rim[rim] = _on_end(points[corners], normals[corners])
        if not rim.any():
            break
        sheet = drop_triangles(sheet, ~rim)
    return sheet


def _on_end(corners: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Tell which triangles (M, 3, 3) stand upright on the surface at each of their corners."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
    return np.einsum("mj,mkj->mk", across, normals).max(axis=1) < UPRIGHT


def components(sheet: Sheet) -> tuple[int, NDArray[np.int32]]:
    """Count the connected pieces of a sheet; return how many there are and that of each triangle (M,)."""
    half = np.flatnonzero(sheet.twin >= 0)
    m = len(sheet.triangles)
    graph = coo_matrix((np.ones(len(half), np.int8), (half // 3, sheet.twin[half] // 3)), shape=(m, m))
    n, piece = connected_components(graph, directed=False)
    return int(n), piece.astype(np.int32)


def triangle_areas(points: Floats, triangles: NDArray[np.int32]) -> Floats:
    """Return the areas (M,) of triangles (M, 3) of points (N, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
