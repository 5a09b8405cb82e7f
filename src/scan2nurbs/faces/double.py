"""Edges of a mesh that run between the same two vertices as others, parted by a vertex of their own."""

from __future__ import annotations

import numpy as np

from scan2nurbs.faces.sheet import Sheet
from scan2nurbs.surfaces.shape import Floats


def part_double_edges(sheet: Sheet, place: Floats) -> tuple[Sheet, Floats]:
    """Halve all but one of the edges between the same two vertices, so that two vertices tell an edge.

    Parameters
    ----------
    sheet : Sheet
    place : (V, 3) float64
        Places of its vertices.

    Returns
    -------
    sheet : Sheet
        With more vertices, which come from the points that the halved edges began at.
    place : (W, 3) float64
    """
    for _ in range(4):
        double = _double(sheet)
        if not double:
            break
        source, triangles, twin, places = list(sheet.source), sheet.triangles.tolist(), sheet.twin.tolist(), list(place)
        touched: set[int] = set()
        for h in double:
            near = {h // 3, twin[h] // 3} if twin[h] >= 0 else {h // 3}
            if near & touched:
                continue  # in the next round
            touched |= near | {t // 3 for f in near for t in twin[3 * f : 3 * f + 3] if t >= 0}
            u, v = triangles[h // 3][h % 3], triangles[h // 3][(h + 1) % 3]
            source.append(source[u])
            places.append(0.5 * (places[u] + places[v]))
            _halve(triangles, twin, h, len(source) - 1)
        sheet = Sheet(np.array(source, np.int32), np.array(triangles, np.int32), np.array(twin, np.int32))
        place = np.array(places)
    return sheet, place


def _double(sheet: Sheet) -> list[int]:
    """List a half-edge of every edge whose vertices another edge before it has."""
    start, end = sheet.triangles.ravel().astype(np.int64), np.roll(sheet.triangles, -1, axis=1).ravel().astype(np.int64)
    half = np.flatnonzero((sheet.twin < 0) | (sheet.twin > np.arange(len(sheet.twin))))
    key = np.minimum(start[half], end[half]) * len(sheet.source) + np.maximum(start[half], end[half])
    order = np.argsort(key, kind="stable")
    again = np.r_[False, key[order][1:] == key[order][:-1]]
    return half[order[again]].tolist()


def _halve(triangles: list[list[int]], twin: list[int], h: int, m: int) -> None:
    """Put vertex m amid the edge of half-edge h: the first halves keep their triangles' places, the second ones are appended."""
    g = twin[h]
    parts = [_halve_triangle(triangles, twin, x, m) for x in ((h, g) if g >= 0 else (h,))]
    if len(parts) == 2:
        (a, b), (c, d) = parts
        twin[a], twin[d], twin[b], twin[c] = d, a, c, b


def _halve_triangle(triangles: list[list[int]], twin: list[int], h: int, m: int) -> tuple[int, int]:
    """Halve the triangle (u, v, w) of half-edge h = uv into (u, m, w) and (m, v, w); return the half-edges um and mv."""
    f, k = divmod(h, 3)
    _, v, w = (triangles[f][(k + j) % 3] for j in range(3))
    new = len(triangles)
    triangles[f][(k + 1) % 3] = m
    triangles.append([m, v, w])
    beside = twin[3 * f + (k + 1) % 3]
    twin.extend([-1, beside, 3 * f + (k + 1) % 3])
    if beside >= 0:
        twin[beside] = 3 * new + 1
    twin[3 * f + (k + 1) % 3] = 3 * new + 2
    return h, 3 * new
