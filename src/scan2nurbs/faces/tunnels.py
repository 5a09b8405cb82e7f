"""Closed borders that noise made: tunnels between two sides of a thin wall, or of a narrow gap, and places where two faces touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.complex import Loop, length_of
from scan2nurbs.faces.draw import Drawn
from scan2nurbs.faces.merge import without_borders
from scan2nurbs.faces.trace import Traced
from scan2nurbs.surfaces.shape import Floats, Shape

POINT = 1.0
"""Length, in h, of a closed border that is no more than a point."""
AWAY = -0.8
"""Cosine between the outward normals of two faces that lie on two sides of a wall: sharper edges are none."""


def without_tunnels(
    traced: Traced, drawn: Drawn, shapes: Sequence[Shape], outward: NDArray[np.int8], h: float, longest: float
) -> tuple[Traced, Drawn]:
    """Take out closed borders about a point, and short ones between two faces that look away from each other.

    Parameters
    ----------
    traced, drawn : Traced, Drawn
        The complex and its places.
    shapes : sequence of Shape
        Surface of each face.
    outward : (F,) int8
        Sign by which its normals look outward.
    h : float
        Spacing of the points.
    longest : float
        Circumference up to which a tunnel counts as chance, in the points' unit.

    Notes
    -----
    A border stays if it is the only one of a face. The faces go on where a tunnel was; the mesh still hangs together there.
    """
    loops: list[list[Loop]] = [list(some) for some in traced.loops]
    gone = np.zeros(len(drawn.lines), bool)
    for b in np.flatnonzero(traced.ends[:, 0] < 0):
        one, other = (int(f) for f in traced.sides[b])
        length = length_of(drawn.lines[b])
        if length > longest or min(one, other) < 0 or min(len(loops[one]), len(loops[other])) < 2:
            continue
        if length <= POINT * h or _look_away(drawn.lines[b], (one, other), shapes, outward):
            gone[b] = True
            for f in (one, other):
                loops[f] = [loop for loop in loops[f] if loop[0][0] != b]
    faces = [set(f) for f in drawn.faces]
    return without_borders(traced, traced.ends, loops, drawn.vertices, list(drawn.lines), faces, gone)


def _look_away(line: Floats, pair: tuple[int, int], shapes: Sequence[Shape], outward: NDArray[np.int8]) -> bool:
    """Tell whether two faces look away from each other all along a border."""
    one, other = (outward[f] * shapes[f].normal(line) for f in pair)
    return bool(np.nanmax(np.einsum("nk,nk->n", one, other)) < AWAY)
