"""Small faces that cannot be trimmed between their neighbours: these take their points, where they pass close by."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.complex import Topology
from scan2nurbs.surfaces.shape import Shape

ALMOST_ALL = 0.95
"""So large a share of a face's points has to lie near its neighbours' surfaces."""


@dataclass(frozen=True)
class Dissolved:
    """A labelled cloud without some of its faces.

    Attributes
    ----------
    label : (N,) int32
        Face of every point; the numbers of the others are as before.
    faces : tuple of int
        Those that have no points any more.
    off : float
        How far from their new surfaces 95 % of these points lie, at most.
    """

    label: NDArray[np.int32]
    faces: tuple[int, ...]
    off: float


def dissolve(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    shapes: Sequence[Shape],
    topology: Topology,
    faces: Collection[int],
    reach: float,
) -> Dissolved | None:
    """Give the points of faces to the neighbours whose surfaces are nearest; None where these are too far from all of the faces.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
    shapes : sequence of Shape
        One a label.
    topology : Topology
        Which of the faces meet.
    faces : collection of int
        Of the topology.
    reach : float
        Up to which distance a point belongs to a surface, in the points' unit.
    """
    source = topology.source
    todo = sorted({int(source[f]) for f in faces})
    label, gone, off = label.copy(), [], 0.0
    for face in todo:
        pairs = [border.faces for border in topology.borders if min(border.faces) >= 0 and any(source[f] == face for f in border.faces)]
        beside = sorted({int(source[f]) for pair in pairs for f in pair} - set(todo))
        own = np.flatnonzero(label == face)
        if not beside or not len(own):
            continue
        apart = np.abs([shapes[k].distance(points[own]) for k in beside])
        furthest = float(np.quantile(apart.min(axis=0), ALMOST_ALL))
        if furthest > reach:
            continue
        label[own] = np.array(beside, np.int32)[np.argmin(apart, axis=0)]
        gone.append(face)
        off = max(off, furthest)
    return Dissolved(label, tuple(gone), off) if gone else None
