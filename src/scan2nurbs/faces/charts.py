"""Cut a closed or much bent freeform surface into charts: sheets over each of which one side of it is seen."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

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
    turns: Turns,
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
    turns : Turns
    widest : float
        Degrees by which normals of a chart may lean away from their mean.

    Returns
    -------
    list of list of int
        Labels of each chart, rising.
    """
    sides = turns.sides(group)
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


@dataclass(frozen=True)
class Turns:
    """How the normals of neighbouring pieces stand to each other.

    Attributes
    ----------
    borders : tuple of (int, int, int, float)
        Two labels, how many points their border has, and whether normals of both point to the same side of the surface (1) or not (−1).
        The longest first.
    """

    borders: tuple[tuple[int, int, int, float], ...]

    def sides(self, group: Collection[int]) -> dict[int, float]:
        """Return the sign that turns each piece's normals to one side of the surface.

        Signs go from neighbour to neighbour by the longest borders (Kruskal's algorithm): short ones may lead around an edge.
        """
        parent = {m: (m, 1.0) for m in group}

        def root(m: int) -> tuple[int, float]:
            sign = 1.0
            while parent[m][0] != m:
                m, sign = parent[m][0], sign * parent[m][1]
            return m, sign

        for a, b, _, same in self.borders:
            if a in parent and b in parent:
                (top, sign_a), (other, sign_b) = root(a), root(b)
                if top != other:
                    parent[other] = (top, sign_a * sign_b * same)
        return {m: root(m)[1] for m in group}


def turns_of(points: NDArray[np.float64], fits: tuple[ShapeFit, ...], smooth: Sequence[Contact], back: Sequence[Contact]) -> Turns:
    """Compare normals along borders where pieces meet smoothly, and along those where they turn back as at the edge of a blade."""
    borders = []
    for contacts, same in ((smooth, 1.0), (back, -1.0)):
        for contact in contacts:
            a, b = contact.pair
            place = points[np.concatenate(contact.sides)]
            sign = float(np.sign(np.einsum("ij,ij->i", fits[a].shape.normal(place), fits[b].shape.normal(place)).sum()) or 1.0)
            borders.append((a, b, len(place), same * sign))
    return Turns(tuple(sorted(borders, key=lambda border: (-border[2], border[:2]))))
