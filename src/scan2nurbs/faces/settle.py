"""Decide along borders which of two faces a point belongs to: by where it lies across the border, which noise hardly moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.faces.contacts import LEAST, Contact, Contacts, face_contacts
from scan2nurbs.faces.strips import settle_strips
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.shape import Floats
from scan2nurbs.surfaces.shape_fit import ShapeFit

ROUNDS = 3
RINGS = 3
"""Rings of neighbours from a border within which points are doubtful."""
CROSSING = 60.0
"""Degrees: surfaces that turn by more where faces meet cross there, whatever their curvatures."""
EVEN = 0.5
"""Surfaces that cross turn alike on both sides of the border: on one side at least by this share of what they turn on the other."""
AGREE = 0.75
"""Share of a face's points that must lie on one side of the other's surface, for sides to tell."""
NEAR = 8
"""So many of either face's nearest points tell where it lies from a border."""
REACH = 3.0
"""A point is moved to no surface farther away than so many standard deviations."""
CAP = 8.0
"""Most that a deviation costs, as half a squared one in standard deviations."""
BENT = 0.1
"""Radians by which normals turn from band to band at least where surfaces bend so unlike that they tell the line of contact."""
DEARER = 1.0
"""Points that were on the wrong side of a border cost by no more than this more on the other, on average."""
INDIFFERENT = 2.0
"""Borders whose costs differ by less are alike."""


def settle_borders(points: Floats, label: NDArray[np.int32], fits: Sequence[ShapeFit], scale: Scale, noise: float) -> NDArray[np.int32]:
    """Give every point beside a border the face on whose side it lies.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Face of every point; −1 = none.
    fits : sequence of ShapeFit
        One a face.
    scale : Scale
        Of the same points.
    noise : float
        Standard deviation of the points across the surface, in their unit.

    Notes
    -----
    The nearest of two surfaces is chosen by noise where they cross at a small angle or are tangent. Both sides of a border are told
    apart better. Where surfaces cross, each face lies on one side of the other's surface, and the bisector between the faces divides
    them; noise moves points along it. Where they are tangent, their normals differ in opposite senses on both sides of the line of
    contact; these normals are the surfaces' own and have no noise. How much they differ orders the points across the border, and of all
    ways to cut this order in two that of the least squares is taken.
    """
    label, settled = settle_strips(points, label, fits, face_contacts(label, scale), scale.h, noise)
    for _ in range(ROUNDS):
        contacts = face_contacts(label, scale)
        best = np.full(len(label), REACH * noise)
        moved = label.copy()
        for contact in (contact for contact in contacts.found if contact.pair not in settled):
            for own, other, rows in _strays(points, label, fits, contacts, contact, noise):
                d = np.abs(fits[other].shape.distance(points[rows])) if len(rows) else np.zeros(0)
                closer = (d < best[rows]) & (label[rows] == own)
                best[rows[closer]], moved[rows[closer]] = d[closer], other
        if (moved == label).all():
            break
        label = _kept(label, moved, len(fits))
    return label


def _strays(
    points: Floats, label: NDArray[np.int32], fits: Sequence[ShapeFit], contacts: Contacts, contact: Contact, noise: float
) -> list[tuple[int, int, NDArray[np.int64]]]:
    """Return (own, other, rows): the points of one face of a contact that lie on the other's side of the border."""
    if min(map(len, contact.sides)) < LEAST:
        return []
    i, j = contact.pair
    bands = [contacts.band(side, label, RINGS) for side in contact.sides]
    rows, on_i = np.concatenate(bands), np.repeat([True, False], [len(band) for band in bands])
    p = points[rows]
    ni, nj, di, dj = fits[i].shape.normal(p), fits[j].shape.normal(p), fits[i].shape.distance(p), fits[j].shape.distance(p)
    dot = np.einsum("ij,ij->i", ni, nj)
    turn = _across(p, np.sign(dot)[:, None] * nj - ni, on_i)
    here, there = float(turn[on_i].mean()), float(turn[~on_i].mean())
    alike = here * there > 0.0 and min(abs(here), abs(there)) > EVEN * max(abs(here), abs(there))
    if np.median(np.abs(dot)) < np.cos(np.radians(CROSSING)) or alike:
        side_i, side_j = _side(di[~on_i]), _side(dj[on_i])
        across = side_i * di - side_j * dj if side_i and side_j else np.where(on_i, -1.0, 1.0)
    elif here < 0.0 < there and there - here > BENT:
        across = turn - _cut(turn, (di / noise) ** 2, (dj / noise) ** 2)
    else:
        return []
    stray = np.where(on_i, across > 0.0, across < 0.0)
    costs = np.minimum(0.5 * (np.stack([di, dj])[:, stray] / noise) ** 2, CAP)
    dearer = np.where(on_i[stray], costs[1] - costs[0], costs[0] - costs[1]).sum()
    # Surfaces that do not fit say nothing of the border.
    if dearer > DEARER * stray.sum() or any(2 * int(stray[side].sum()) > int(side.sum()) for side in (on_i, ~on_i)):
        return []
    return [(i, j, rows[on_i & stray]), (j, i, rows[~on_i & stray])]


def _side(d: Floats) -> float:
    """Return the sign of the distances of one face's points from the other's surface; 0 where the face lies on both sides."""
    side = float(np.sign(np.median(d)))
    return side if np.abs(d[np.sign(d) == side]).sum() > AGREE * np.abs(d).sum() else 0.0


def _across(p: Floats, turn: Floats, on_i: NDArray[np.bool_]) -> Floats:
    """Return the turn of the normals across the border (N,), rising from the first face to the second."""
    means = [p[mine][KDTree(p[mine]).query(p, k=min(NEAR, int(mine.sum())))[1].reshape(len(p), -1)].mean(axis=1) for mine in (on_i, ~on_i)]
    ahead = means[1] - means[0]
    across = np.einsum("ij,ij->i", turn, ahead) / np.maximum(np.linalg.norm(ahead, axis=1), 1e-300)
    return across * (1.0 if across[~on_i].mean() >= across[on_i].mean() else -1.0)


def _cut(turn: Floats, on_first: Floats, on_second: Floats) -> float:
    """Return where to cut the points, ordered by the turn, in those of the first and those of the second face.

    Of the cuts that cost about as little as the best one, that nearest to where the normals agree.
    """
    order = np.argsort(turn, kind="stable")
    gain = np.minimum(0.5 * on_first[order], CAP) - np.minimum(0.5 * on_second[order], CAP)
    cost = np.r_[0.0, np.cumsum(gain)]
    at = np.append(turn[order], turn[order[-1]])
    good = np.flatnonzero(cost <= cost.min() + INDIFFERENT)
    return float(at[good[np.argmin(np.abs(at[good]))]])


def _kept(label: NDArray[np.int32], moved: NDArray[np.int32], n: int) -> NDArray[np.int32]:
    """Return the new labels, but the old ones of faces that would lose half of their points."""
    before, after = (np.bincount(x[x >= 0], minlength=n) for x in (label, moved))
    lost = 2 * after < before
    return np.where((label >= 0) & lost[label], label, moved)
