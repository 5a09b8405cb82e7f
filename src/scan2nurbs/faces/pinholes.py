"""Close the small holes of a surface that no data tells of: where two sides of a wall touched by chance and were parted again."""

from __future__ import annotations

import numpy as np

from scan2nurbs.faces.sheet import Sheet
from scan2nurbs.surfaces.shape import Floats


def close_pinholes(sheet: Sheet, points: Floats, longest: float) -> Sheet:
    """Span every border loop of a sheet that is not longer than `longest` by triangles between its own vertices.

    Parameters
    ----------
    sheet : Sheet
    points : (N, 3) float64
        The points that its vertices come from.
    longest : float
        In the points' unit.

    Returns
    -------
    Sheet
        The given triangles, and the new ones after them.
    """
    start, end = sheet.triangles.ravel(), np.roll(sheet.triangles, -1, axis=1).ravel()
    border = np.flatnonzero(sheet.twin < 0)
    # Vertices are parted so that the border passes each of them once.
    leaving = dict(zip(start[border].tolist(), border.tolist(), strict=True))
    twin = sheet.twin.tolist()
    triangles: list[tuple[int, int, int]] = []
    for first in border.tolist():
        if twin[first] >= 0:
            continue
        loop = [first]
        while (after := leaving[int(end[loop[-1]])]) != first:
            loop.append(after)
        place = points[sheet.source[start[loop]]]
        if np.linalg.norm(place - np.roll(place, -1, axis=0), axis=1).sum() <= longest:
            _close(loop, [int(v) for v in start[loop]], place, twin, triangles, len(sheet.triangles))
    if not triangles and twin == sheet.twin.tolist():
        return sheet
    return Sheet(sheet.source, np.vstack([sheet.triangles, np.array(triangles, np.int32).reshape(-1, 3)]), np.array(twin, np.int32))


def _close(loop: list[int], vertices: list[int], place: Floats, twin: list[int], triangles: list[tuple[int, int, int]], n: int) -> None:
    """Append triangles that span a loop, cut off corner by corner, and pair their half-edges with the loop's and with each other."""
    if len(loop) == 2:
        twin[loop[0]], twin[loop[1]] = loop[1], loop[0]
        return
    normal = -np.cross(place, np.roll(place, -1, axis=0)).sum(axis=0)  # of the hole: its border runs around it the other way
    loop, left = list(loop), list(range(len(loop)))
    while True:
        k = _corner(place[left], normal) if len(left) > 3 else 1
        before, at, after = left[k - 1], left[k], left[(k + 1) % len(left)]
        new = 3 * (n + len(triangles))
        triangles.append((vertices[after], vertices[at], vertices[before]))
        twin += [loop[at], loop[before], -1]
        twin[loop[at]], twin[loop[before]] = new, new + 1
        if len(left) == 3:
            twin[new + 2], twin[loop[after]] = loop[after], new + 2
            return
        loop[before] = new + 2
        del left[k]


def _corner(place: Floats, normal: Floats) -> int:
    """Return the corner of a loop with the shortest line between its neighbours, of those that the loop does not enter there."""
    before, after = np.roll(place, 1, axis=0), np.roll(place, -1, axis=0)
    length = np.linalg.norm(after - before, axis=1)
    outward = np.cross(place - after, before - place) @ normal > 0.0
    return int(np.argmin(np.where(outward, length, np.inf) if outward.any() else length))
