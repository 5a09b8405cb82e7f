"""Where narrow fillets end: along the lines in which a ball touches the two faces that it rolls along, which these faces tell better."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.contacts import LEAST, Contacts
from scan2nurbs.faces.rolling import Corner, corner_of
from scan2nurbs.surfaces.shape import Floats, Shape
from scan2nurbs.surfaces.shape_fit import ShapeFit

NARROW = 8
"""Strips have at most so many points for each that lies beside either of the two faces: they are about as many h wide."""
RINGS = 3
"""Rings of neighbours from a strip within which points may belong to it."""
REACH = 3.0
"""A point is given to no surface farther away than so many standard deviations."""


def settle_strips(
    points: Floats, label: NDArray[np.int32], fits: Sequence[ShapeFit], contacts: Contacts, h: float, noise: float
) -> tuple[NDArray[np.int32], frozenset[tuple[int, int]]]:
    """Give points about narrow fillets the face on whose side of the lines of contact they lie.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Face of every point; −1 = none.
    fits : sequence of ShapeFit
        One a face.
    contacts : Contacts
        Of these labels.
    h, noise : float
        Spacing, and standard deviation of the points across the surface.

    Returns
    -------
    label : (N,) int32
    settled : frozenset of (int, int)
        Pairs i < j of faces whose common border was decided.

    Notes
    -----
    The surface of a narrow strip, fitted by itself, follows what points it has: too few of them, and it ends too early. The ball has one
    number, its radius, and is taken where it explains the strip's points about as well.
    """
    label, settled = label.copy(), set[tuple[int, int]]()
    beside: dict[int, list[tuple[int, int]]] = {}
    for contact in contacts.found:
        for own, other, side in zip(contact.pair, contact.pair[::-1], contact.sides, strict=True):
            beside.setdefault(own, []).append((-len(side), other))
    size = np.bincount(label[label >= 0], minlength=len(fits))
    for strip in sorted(beside, key=lambda face: (size[face], face)):
        faces = sorted(beside[strip])[:2]
        if len(faces) < 2 or not LEAST <= size[strip] <= -NARROW * faces[1][0]:
            continue
        pair = faces[0][1], faces[1][1]
        rows, moved = _settled(points, label, fits, contacts, strip, pair, h, noise)
        if len(rows):
            label[rows] = moved
            settled |= {(min(strip, face), max(strip, face)) for face in pair}
    return label, frozenset(settled)


def _settled(
    points: Floats,
    label: NDArray[np.int32],
    fits: Sequence[ShapeFit],
    contacts: Contacts,
    strip: int,
    pair: tuple[int, int],
    h: float,
    noise: float,
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the points about a strip and the face of each; none where it is no fillet of the two faces."""
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int32)
    mine = np.flatnonzero(label == strip)
    around = mine
    for _ in range(RINGS):
        around = np.union1d(around, contacts.neighbours[around])
    bands = [around[label[around] == face] for face in pair]
    if min(len(mine), *map(len, bands)) < LEAST:
        return nothing
    rows = np.concatenate([*bands, mine])
    side = np.repeat([0, 1, 2], [len(bands[0]), len(bands[1]), len(mine)])
    first, second = (_field(fits[face].shape, points[rows], h) for face in pair)
    corner = corner_of(first, second, side)
    if corner is None:
        return nothing
    beside = corner.beside(points[rows] / h, side == 2)
    rows, side, corner = rows[beside], side[beside], corner.at(beside)
    now = np.where(side == 0, np.abs(corner.u), np.abs(corner.v))
    now[side == 2] = np.abs(fits[strip].shape.distance(points[mine])) / h
    radius = corner.radius_of_strip(now, noise / h, len(mine))
    if radius is None:
        return nothing
    moved = _sides(corner, radius, label[rows], strip, pair, noise / h)
    kept = 2 * np.count_nonzero(moved == strip) > len(mine)
    return (rows, moved) if kept else nothing


def _sides(corner: Corner, radius: float, own: NDArray[np.int32], strip: int, pair: tuple[int, int], noise: float) -> NDArray[np.int32]:
    """Return the face of each point: by the lines of contact, if its surface is near."""
    reach = radius * (1.0 - corner.cosine)
    # Beyond the line in which the ball touches the first face, a point is farther from the second than that line.
    first, second = corner.v >= reach, corner.u >= reach
    face = np.where(first & ~second, pair[0], np.where(second & ~first, pair[1], np.where(first, own, strip)))
    off = np.abs(np.where(face == pair[0], corner.u, np.where(face == pair[1], corner.v, corner.off(radius))))
    return np.where(off < REACH * noise, face, own).astype(np.int32)


def _field(shape: Shape, points: Floats, h: float) -> Floats:
    distance, normal = shape.distance_and_normal(points)
    return np.column_stack([distance / h, normal])
