"""Join the pieces of a narrow face where its two neighbours touch across it by chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.place import measure
from scan2nurbs.faces.trace import Closed, Traced
from scan2nurbs.surfaces.shape import Floats, Shape

GAP = 0.5
"""Farthest, in h, from a face's surface that its points may be taken to lie, whatever the noise."""
LONGEST = 30
"""Most half-edges of the border between the neighbours: about 15 h."""


def bridge(
    mesh: Closed,
    traced: Traced,
    region: NDArray[np.int32],
    source: NDArray[np.int32],
    place: Floats,
    shapes: Sequence[Shape],
    spread: float,
    h: float,
) -> NDArray[np.int32]:
    """Give the vertices along a border to the face that lies at both of its ends, where its surface runs there as well.

    Parameters
    ----------
    mesh, traced : Closed, Traced
    region : (V,) int32
        Region of each vertex of the mesh.
    source : (R,) int32
        Label of each region.
    place : (V, 3) float64
        Vertices of the mesh.
    shapes : sequence of Shape
        Surface of each label.
    spread : float
        Standard deviation of the points about their surface.
    h : float
        Spacing of the points.

    Returns
    -------
    (V,) int32
        Labels, some of them new.

    Notes
    -----
    A strip two or three points wide, a fillet most of all, falls apart where noise gave all points across it to its neighbours.
    """
    label = source[region]
    of = np.concatenate([region, np.full(mesh.n_holes, -1, np.int32)])[mesh.triangles]
    start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    at, wanted = [], []
    for half, (left, right), (u, v) in zip(traced.borders, traced.sides, traced.ends, strict=True):
        if u < 0 or right < 0 or len(half) > LONGEST:
            continue
        third = [int(of[traced.corners[x]].sum() - left - right) for x in (u, v)]
        if min(third) >= 0 and source[third[0]] == source[third[1]]:
            at.append(half)
            wanted.append(int(source[third[0]]))
    if not at:
        return label
    which = np.repeat(np.arange(len(at)), [len(half) for half in at])
    half = np.concatenate(at)
    face = np.array(wanted, np.int32)[which][:, None]
    sides = np.stack([start[half], end[half]])
    away = np.abs(np.stack([measure(place[side], face, shapes)[0][:, 0] for side in sides]))
    nearer = np.take_along_axis(sides, away.argmin(axis=0)[None], axis=0)[0]
    worst = np.zeros(len(at))
    np.maximum.at(worst, which, away.min(axis=0))
    fits = (worst <= max(3.0 * spread, GAP * h))[which]
    label[nearer[fits]] = face[fits, 0]
    return label
