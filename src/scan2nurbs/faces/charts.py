"""Cut a closed or much bent freeform surface into charts: sheets over each of which one side of it is seen."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.contacts import Contact
from scan2nurbs.surfaces.shape_fit import ShapeFit

LEANING = 0.02
"""Share of a chart's points that may lean farther."""


def charts(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    fits: tuple[ShapeFit, ...],
    group: list[int],
    smooth: list[Contact],
    widest: float,
) -> list[list[int]]:
    """Gather pieces of one smooth surface into few charts, the longest common borders first.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
    fits : tuple of ShapeFit
    group : list of int
        Labels of the pieces.
    smooth : list of Contact
        The borders between them.
    widest : float
        Degrees by which normals of a chart may lean away from their mean.

    Returns
    -------
    list of list of int
        Labels of each chart, rising.
    """
    sides = _sides(points, fits, group, smooth)
    gathered = {m: sides[m] * fits[m].shape.normal(points[label == m]) for m in group}
    chart = {m: m for m in group}
    while True:
        border: dict[tuple[int, int], int] = {}
        for contact in smooth:
            a, b = sorted((chart[contact.pair[0]], chart[contact.pair[1]]))
            if a != b:
                border[a, b] = border.get((a, b), 0) + min(map(len, contact.sides))
        for a, b in sorted(border, key=lambda pair: (-border[pair], pair)):
            both = np.concatenate([gathered[a], gathered[b]])
            if _is_sheet(both, widest):
                gathered[a] = both
                del gathered[b]
                chart = {m: a if c == b else c for m, c in chart.items()}
                break
        else:
            return [sorted(m for m in group if chart[m] == c) for c in sorted(gathered)]


def _is_sheet(normals: NDArray[np.float64], widest: float) -> bool:
    mean = normals.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length < 0.3:
        return False
    return float(np.mean(normals @ (mean / length) < np.cos(np.radians(widest)))) <= LEANING


def _sides(points: NDArray[np.float64], fits: tuple[ShapeFit, ...], group: list[int], smooth: list[Contact]) -> dict[int, float]:
    """Return the sign that turns each piece's normals to one side of the surface, from neighbour to neighbour."""
    beside: dict[int, list[tuple[int, int, float]]] = {m: [] for m in group}
    for contact in smooth:
        a, b = contact.pair
        place = points[np.concatenate(contact.sides)]
        sign = float(np.sign(np.einsum("ij,ij->i", fits[a].shape.normal(place), fits[b].shape.normal(place)).sum()) or 1.0)
        beside[a].append((-len(place), b, sign))
        beside[b].append((-len(place), a, sign))
    sides: dict[int, float] = {}
    for start in group:
        # The longest borders first: short ones may lead around an edge.
        waiting = [] if start in sides else [(0, start, 1.0)]
        while waiting:
            _, m, sign = heappop(waiting)
            if m not in sides:
                sides[m] = sign
                for length, other, turn in beside[m]:
                    heappush(waiting, (length, other, sign * turn))
    return sides
