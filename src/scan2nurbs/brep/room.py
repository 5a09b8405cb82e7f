"""How large a face may be: what leaves out most of its points, or reaches far beyond them, is on the wrong side of its borders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.alone import trim_alone, trim_anew, trim_by_points
from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.deviation import sample
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.solids import compound
from scan2nurbs.errors import InputError
from scan2nurbs.faces.topology import Topology

_ASTRAY, _SOME, _COARSE = 3.0, 0.05, 0.5
"""A face is astray where more than a share of it is so many h from the mesh; triangles half an h off tell that."""
_BEYOND = 20.0
"""So is one that is so many times as large as it may be: it need not be covered with samples to tell."""
_LEAST = 0.25
"""A face of less than this share of the area above which it is too large, half of that of its mesh, is on the wrong side of its borders."""


@dataclass(frozen=True)
class Room:
    """What a face may take up.

    Attributes
    ----------
    vertices : (n, 3) float64
        The mesh that all borders were read from.
    most, least : float
        Area above which a face is looked at, twice that of its part of the mesh and a few cells more, and below which it is too small.
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    """

    vertices: NDArray[np.float64]
    most: float
    least: float
    h: float
    scale: float

    @classmethod
    def of(cls, topology: Topology, f: int, h: float, scale: float) -> Room:
        """Return that of a face; it may have any area where there is no mesh."""
        if not len(topology.mesh.triangles):
            return cls(topology.mesh.vertices, np.inf, 0.0, h, scale)
        most = float(2.0 * topology.areas[f] + 20.0 * h**2)
        return cls(topology.mesh.vertices, most, _LEAST * most - 20.0 * h**2, h, scale)

    def is_left_by(self, pieces: tuple[Any, ...]) -> bool:
        """Tell whether a face is larger than its points and reaches where no points are: the wrong side of its borders was taken."""
        size = size_of(pieces, self.scale)
        if size <= self.most:
            return False
        if not size <= _BEYOND * self.most:
            return True
        coarse = _COARSE * self.h * self.scale
        try:
            mesh = tessellate(compound(pieces), deflection=coarse, least=coarse)
        except InputError:  # so large, and still without a triangle: its borders enclose nothing
            return True
        samples, _ = sample(mesh, self.h * self.scale)
        apart = KDTree(self.vertices).query(samples / self.scale, distance_upper_bound=_ASTRAY * self.h)[0]
        return float(np.mean(~np.isfinite(apart))) > _SOME


def size_of(pieces: tuple[Any, ...], scale: float) -> float:
    """Return the area of the pieces of a face, roughly."""
    return sum(map(rough_area, pieces)) / scale**2


def on_its_own(f: int, shape: Any, topology: Topology, h: float, scale: float, room: Room | None = None) -> tuple[Any, ...]:
    """Trim a face by its own outline: on its surface, or where that misses its points otherwise.

    Parameters
    ----------
    f : int
        The face.
    shape : Shape
        Its surface.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    room : Room, optional
        By default that of the face.

    Returns
    -------
    tuple of TopoDS_Face
        Empty where nothing within its room can be made.
    """
    found, room = tuple[Any, ...](), room or Room.of(topology, f, h, scale)
    ways = (partial(trim_alone, f, shape), partial(trim_anew, f), partial(trim_by_points, f, shape))
    for trim in ways:
        tried = trim(topology, h, scale)
        if room.is_left_by(tried):
            continue
        found = tried if size_of(tried, scale) > size_of(found, scale) else found
        if found and size_of(found, scale) >= room.least:
            break
    return found
