"""Where faces touch: the points on either side of their common borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.kernels.nearest import nearest_neighbours
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.shape_fit import ShapeFit

SMOOTH = 15.0
"""Degrees: faces that turn by less meet smoothly."""
MEETING = 0.5
"""Surfaces that meet smoothly pass within this many h of the points at their border, and noise."""
LEAST = 4
"""Fewer points on a side are no border."""
INNER, OUTER, PLACES, NEAR = 2, 5, 64, 8
"""Which way a face goes from its border: to the mean of so many of the nearest points between two rings, at so many places."""


@dataclass(frozen=True)
class Contact:
    """The common border of two faces i < j.

    Attributes
    ----------
    pair : (int, int)
    sides : two (K,) int64
        Points of either face beside the other.
    """

    pair: tuple[int, int]
    sides: tuple[NDArray[np.int64], NDArray[np.int64]]


@dataclass(frozen=True)
class Contacts:
    """All contacts of a labelled cloud, and the neighbours of its points.

    Attributes
    ----------
    found : tuple of Contact
        By rising pair.
    neighbours : (N, 6) int64
        Points; each point itself where it has fewer.
    """

    found: tuple[Contact, ...]
    neighbours: NDArray[np.int64]

    def band(self, side: NDArray[np.int64], label: NDArray[np.int32], rings: int) -> NDArray[np.int64]:
        """Return the points of the side's label within so many rings."""
        band = side
        for _ in range(rings - 1):
            wider = np.union1d(band, self.neighbours[band])
            band = wider[label[wider] == label[side[0]]]
        return band


def face_contacts(label: NDArray[np.int32], scale: Scale) -> Contacts:
    """Find the contacts between the faces of a cloud of points.

    Parameters
    ----------
    label : (N,) int32
        Face of every point; −1 = none.
    scale : Scale
        Of the same points.
    """
    order = scale.cells.order
    near, _ = nearest_neighbours(scale.cells, 6, reach=1.5 * scale.h)
    own = np.arange(len(label))[:, None]
    neighbours = np.empty(near.shape, np.int64)
    neighbours[order] = order[np.where(near >= 0, near, own)]
    i, j = np.repeat(np.arange(len(label)), near.shape[1]), neighbours.ravel()
    meet = (label[i] >= 0) & (label[j] >= 0) & (label[i] != label[j])
    i, j = i[meet], j[meet]
    n = int(label.max(initial=0)) + 1
    code = label[i].astype(np.int64) * n + label[j]  # i's points beside j's
    by_code = np.lexsort((i, code))
    ordered, first = np.unique(code[by_code], return_index=True)
    sides = dict(zip(ordered.tolist(), (np.unique(rows) for rows in np.split(i[by_code], first[1:])), strict=True)) if len(ordered) else {}
    none = np.zeros(0, np.int64)
    pairs = sorted({(min(divmod(c, n)), max(divmod(c, n))) for c in sides})
    found = tuple(Contact((a, b), (sides.get(a * n + b, none), sides.get(b * n + a, none))) for a, b in pairs)
    return Contacts(found, neighbours)


def smooth_contacts(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    contacts: Contacts,
    fits: tuple[ShapeFit, ...],
    scale: Scale,
    turn: float = SMOOTH,
) -> tuple[Contact, ...]:
    """Return the contacts along half of which the surfaces turn by less than `turn` degrees, see `parted_contacts`."""
    return parted_contacts(points, label, contacts, fits, scale, turn)[0]


def parted_contacts(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    contacts: Contacts,
    fits: tuple[ShapeFit, ...],
    scale: Scale,
    turn: float = SMOOTH,
) -> tuple[tuple[Contact, ...], tuple[Contact, ...]]:
    """Return the contacts along half of which the surfaces turn by less than `turn` degrees, and those where they turn back.

    The two sides of a thin wall do not meet. Those of a blade do, but turn by nearly half a turn: lines of normals cannot tell.
    """
    smooth, back = [], []
    for contact in contacts.found:
        a, b = contact.pair
        rows = np.concatenate(contact.sides)
        if min(map(len, contact.sides)) < LEAST:
            continue
        place = points[rows]
        dot = np.abs(np.einsum("ij,ij->i", fits[a].shape.normal(place), fits[b].shape.normal(place)))
        if np.median(dot) <= np.cos(np.radians(turn)):
            continue
        apart = np.maximum(np.abs(fits[a].shape.distance(place)), np.abs(fits[b].shape.distance(place)))
        if np.median(apart) < MEETING * scale.h + 3.0 * scale.noise:
            (back if _turns_back(points, contacts, contact, label) else smooth).append(contact)
    return tuple(smooth), tuple(back)


def _turns_back(points: NDArray[np.float64], contacts: Contacts, contact: Contact, label: NDArray[np.int32]) -> bool:
    """Tell whether both faces lie on the same side of their border, as at the edge of a blade: lines of normals cannot tell."""
    _, away = ways(points, contacts, contact, label)
    return bool(len(away) and np.median(np.einsum("ij,ij->i", *away)) > 0.0)


def ways(
    points: NDArray[np.float64], contacts: Contacts, contact: Contact, label: NDArray[np.int32]
) -> tuple[NDArray[np.float64], tuple[NDArray[np.float64], ...]]:
    """Return up to 64 places (K, 3) along a border, and from each the two ways (K, 3) to either face; none where a face ends at once."""
    rows = np.concatenate(contact.sides)
    place = points[rows[:: -(-len(rows) // PLACES)]]
    bands = [np.setdiff1d(contacts.band(side, label, OUTER), contacts.band(side, label, INNER)) for side in contact.sides]
    if min(map(len, bands)) < LEAST:
        return place, ()
    away = []
    for band in bands:
        k = min(NEAR, len(band))
        nearest = KDTree(points[band]).query(place, k=k)[1].reshape(len(place), k)
        away.append(points[band[nearest]].mean(axis=1) - place)
    return place, tuple(away)
