"""Which side of a surface the tetrahedra about it lie on, and how the triangles between the two sides hang together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges

_RANGE = 1 << 14
_LONG = 4.0
_FLAT = 4.0


def sides(
    points: NDArray[np.float64], normals: NDArray[np.float64], tetrahedra: NDArray[np.int32], apex: NDArray[np.int32], h: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Tell how clearly tetrahedra lie inside: whether their circumcentres lie behind the surface at their own corners.

    Parameters
    ----------
    points : (N, 3) float64
        Points of the surface.
    normals : (N, 3) float64
        Its outward unit normals at them.
    tetrahedra : (T, 4) int32
        Delaunay tetrahedra. Those with −1 for their last corner stand for the space beyond a triangle of the hull.
    apex : (T,) int32
        Of each tetrahedron beyond the hull the fourth corner of the one within; of no meaning for the others.
    h : float
        Spacing of the points.

    Returns
    -------
    depth : (T,) float64
        In [−2, 2]: mean depth of the circumcentre below the corners' tangent planes by its distance from the corners, less where that is
        below 2 h; positive inside.
    mixed : (T,) bool
        Where the corners disagree, or lie far apart and nearly in a plane: such tetrahedra span the openings of pockets, on whose rims
        alone they stand.

    Notes
    -----
    No point is nearer to a Delaunay circumcentre than its own corners, so that nothing else need be asked. Where the tangent planes of the
    corners disagree, as they do about creases and thin walls, the centre lies outside if the corners that disagree see each other behind
    them (convex: the outside is the union of the half-spaces) and inside otherwise (concave: their intersection).
    """
    depth, mixed = np.empty(len(tetrahedra)), np.empty(len(tetrahedra), np.bool_)
    run_ranges(lambda a, b: _sides(points, normals, tetrahedra, apex, h, a, b, depth, mixed), len(tetrahedra), size=_RANGE)
    return depth, mixed


@kernel
def _sides(points, normals, tetrahedra, apex, h, start, stop, depth, mixed):
    centre, vote = np.empty(3), np.empty(4)
    for t in range(start, stop):
        n = 4 if tetrahedra[t, 3] >= 0 else 3
        if n == 4:
            _to_centre(points, tetrahedra[t, 0], tetrahedra[t, 1], tetrahedra[t, 2], tetrahedra[t, 3], centre)
        else:
            _away(points, tetrahedra[t, 0], tetrahedra[t, 1], tetrahedra[t, 2], apex[t], centre)
        first = points[tetrahedra[t, 0]]
        total = 0.0
        for i in range(n):
            p, m = points[tetrahedra[t, i]], normals[tetrahedra[t, i]]
            vote[i] = 0.0
            for k in range(3):
                # Beyond the hull the centre is a direction.
                vote[i] += m[k] * (centre[k] + (first[k] - p[k] if n == 4 else 0.0))
            total += vote[i]
        radius = np.sqrt(centre[0] * centre[0] + centre[1] * centre[1] + centre[2] * centre[2])
        size = abs(total) / (n * max(radius, 1e-300)) * (min(radius / h, 2.0) if n == 4 else 2.0)
        bend = _bend(points, normals, tetrahedra[t], vote, n)
        disagree = not np.isnan(bend)
        inside = bend > 0.0 if disagree and bend != 0.0 else total < 0.0
        longest = _longest(points, tetrahedra[t], n)
        mixed[t] = disagree or (n == 4 and longest > _LONG * h and radius > _FLAT * longest)
        depth[t] = size if inside else -size


@kernel
def _bend(points, normals, corners, vote, n):
    """Sum the heights over each other's tangent planes of corners that disagree; NaN where none do."""
    bend, some = 0.0, False
    for i in range(n):
        for j in range(n):
            if vote[i] > 0.0 and vote[j] < 0.0:
                some = True
                p, q, a, b = points[corners[i]], points[corners[j]], normals[corners[i]], normals[corners[j]]
                for k in range(3):
                    bend += (a[k] - b[k]) * (q[k] - p[k])
    return bend if some else np.nan


@kernel
def _longest(points, corners, n):
    square = 0.0
    for i in range(1, n):
        length = 0.0
        for k in range(3):
            length += (points[corners[i], k] - points[corners[0], k]) ** 2
        square = max(square, length)
    return np.sqrt(square)


@kernel
def _to_centre(points, a, b, c, d, out):
    """Write the way from the first corner to the circumcentre; its direction alone counts where the corners lie in a plane."""
    p = points[a]
    ux, uy, uz = points[b, 0] - p[0], points[b, 1] - p[1], points[b, 2] - p[2]
    vx, vy, vz = points[c, 0] - p[0], points[c, 1] - p[1], points[c, 2] - p[2]
    wx, wy, wz = points[d, 0] - p[0], points[d, 1] - p[1], points[d, 2] - p[2]
    u, v, w = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    nx, ny, nz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
    volume = 2.0 * (ux * nx + uy * ny + uz * nz)
    scale = 1.0 / volume if volume != 0.0 else 1e30
    out[0] = (u * nx + v * (wy * uz - wz * uy) + w * (uy * vz - uz * vy)) * scale
    out[1] = (u * ny + v * (wz * ux - wx * uz) + w * (uz * vx - ux * vz)) * scale
    out[2] = (u * nz + v * (wx * uy - wy * ux) + w * (ux * vy - uy * vx)) * scale


@kernel
def _away(points, a, b, c, apex, out):
    """Write the normal of a triangle of the hull, away from the corner within."""
    p = points[a]
    ux, uy, uz = points[b, 0] - p[0], points[b, 1] - p[1], points[b, 2] - p[2]
    vx, vy, vz = points[c, 0] - p[0], points[c, 1] - p[1], points[c, 2] - p[2]
    wx, wy, wz = points[apex, 0] - p[0], points[apex, 1] - p[1], points[apex, 2] - p[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    sign = -1.0 if nx * wx + ny * wy + nz * wz > 0.0 else 1.0
    out[0], out[1], out[2] = sign * nx, sign * ny, sign * nz


def between(
    tetrahedra: NDArray[np.int32], neighbours: NDArray[np.int32], inside: NDArray[np.bool_], positive: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Find the triangles between inside and outside, and across which edges they hang together.

    Parameters
    ----------
    tetrahedra : (T, 4) int32
        Corners; −1 for the point at infinity.
    neighbours : (T, 4) int32
        Tetrahedron across the triangle that leaves out each corner; there always is one.
    inside : (T,) bool
        Which tetrahedra lie inside.
    positive : (T,) bool
        Whether the first three corners turn counter-clockwise seen from the fourth.

    Returns
    -------
    triangles : (M, 3) int32
        Corners, counter-clockwise seen from outside.
    twin : (3 M,) int32
        Half-edge 3 f + k runs from corner k of triangle f to the next one; its twin is the same edge of the triangle that bounds the same
        wedge of inside, −1 where that goes on to infinity. So every edge has one partner at most, whatever meets there.
    """
    facet = np.full(tetrahedra.shape, -1, np.int32)
    n = _number(tetrahedra, neighbours, inside, facet)
    triangles, twin = np.empty((n, 3), np.int32), np.full(3 * n, -1, np.int32)
    _triangles(tetrahedra, positive, facet, triangles)
    run_ranges(lambda a, b: _twins(tetrahedra, neighbours, inside, facet, triangles, a, b, twin), len(tetrahedra), size=_RANGE)
    return triangles, twin


@kernel
def _number(tetrahedra, neighbours, inside, facet):
    n = 0
    for t in range(len(tetrahedra)):
        if inside[t]:
            for k in range(4):
                if not inside[neighbours[t, k]] and (tetrahedra[t, 3] >= 0 or k == 3):
                    facet[t, k] = n
                    n += 1
    return n


@kernel
def _triangles(tetrahedra, positive, facet, triangles):
    for t in range(len(tetrahedra)):
        for k in range(4):
            if facet[t, k] >= 0:
                n = 0
                for j in range(4):
                    if j != k:
                        triangles[facet[t, k], n] = tetrahedra[t, j]
                        n += 1
                # Without corner k of a positive tetrahedron the other three turn clockwise, seen from outside, for odd k alone.
                if (k % 2 == 1) == positive[t]:
                    swap = triangles[facet[t, k], 0]
                    triangles[facet[t, k], 0] = triangles[facet[t, k], 1]
                    triangles[facet[t, k], 1] = swap


@kernel
def _twins(tetrahedra, neighbours, inside, facet, triangles, start, stop, twin):
    for t in range(start, stop):
        for k in range(4):
            f = facet[t, k]
            if f < 0:
                continue
            for e in range(3):
                u, v, w = triangles[f, e], triangles[f, (e + 1) % 3], triangles[f, (e + 2) % 3]
                here, apart = np.int64(t), np.int64(w)
                leave = _place(tetrahedra, here, apart)
                while inside[neighbours[here, leave]]:
                    other = _fourth(tetrahedra, here, u, v, apart)
                    here, apart = np.int64(neighbours[here, leave]), np.int64(other)
                    leave = _place(tetrahedra, here, apart)
                g = facet[here, leave]
                if g >= 0:
                    for j in range(3):
                        if triangles[g, j] == v and triangles[g, (j + 1) % 3] == u:
                            twin[3 * f + e] = 3 * g + j


@kernel
def _place(tetrahedra, t, corner):
    for k in range(4):
        if tetrahedra[t, k] == corner:
            return k
    return -1


@kernel
def _fourth(tetrahedra, t, u, v, w):
    for k in range(4):
        corner = tetrahedra[t, k]
        if corner != u and corner != v and corner != w:  # noqa: PLR1714 - a tuple of several types is no set for the compiler
            return corner
    return np.int32(-1)
