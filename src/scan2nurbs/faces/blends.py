"""Tell blends of freeform faces from what they round: a ball rolled along them, so they bend evenly, and far more than what they join."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.contacts import Contact, Contacts, ways
from scan2nurbs.faces.gather import joined
from scan2nurbs.surfaces.shape_fit import ShapeFit

SHARPER = 3.0
"""A blend bends so many times more across its border than the face beside it."""
EVEN = 1.25
"""All along a blend the bend is the ball's, but for this factor."""
MOST_OF = 0.75
"""Share of a blend's border along which that must hold."""
GOOD_PART = 0.2
"""Less than this share of a border is left out of account: a blend rounds the faces that take more of a piece's."""
LONG = 8.0
"""A blend is so many times longer than wide: a sharp bend on a figurine is a patch."""
SEEN_OVER = 4.0
"""Two bends differ where they part by more than the noise within so many h of the border, ..."""
CLEAR = 0.03
"""... and in any case where they differ by so much, 1 / h: that can be told over the whole of a piece."""


@dataclass(frozen=True)
class Border:
    """A smooth border of two pieces.

    Attributes
    ----------
    sharper, flatter : int
        The pieces, the one first that bends more across the border.
    bend, other : float
        How much they do, 1 / h.
    points : int
        Points along the border.
    """

    sharper: int
    flatter: int
    bend: float
    other: float
    points: int

    @property
    def pair(self) -> tuple[int, int]:
        """The pieces, the lower number first."""
        return min(self.sharper, self.flatter), max(self.sharper, self.flatter)

    def jumps(self, noise: float) -> bool:
        """Tell whether one side bends far more than the other, and so that it can be seen at this noise, in h."""
        return self.bend > SHARPER * self.other and self.bend - self.other > min(2.0 * noise / SEEN_OVER**2, CLEAR)


@dataclass(frozen=True)
class Blends:
    """The blends among the pieces of smooth surfaces.

    Attributes
    ----------
    of : dict of int to int
        The blend that a piece belongs to, of the pieces that belong to one.
    beside : dict of int to dict
        For each of these, the pieces of other faces that it goes over into, and over how many points.
    """

    of: dict[int, int]
    beside: dict[int, dict[int, int]]

    def part(self, pair: tuple[int, int]) -> bool:
        """Tell whether only one of two pieces belongs to a blend, or either to another."""
        return self.of.get(pair[0]) != self.of.get(pair[1])

    def within(self, pair: tuple[int, int]) -> bool:
        """Tell whether two pieces belong to one blend."""
        return pair[0] in self.of and not self.part(pair)

    def round_alike(self, pair: tuple[int, int], parent: NDArray[np.int64]) -> bool:
        """Tell whether two pieces are of no blend, or lie between the same faces: where these change, CAD divides the blend.

        Parameters
        ----------
        pair : (int, int)
        parent : (M,) int64
            The lowest member of the face of each piece.
        """
        if not self.within(pair):
            return True
        one, other = (self._faces(m, parent) for m in pair)
        return one <= other or other <= one

    def rounds_any(self, pair: tuple[int, int], parent: NDArray[np.int64], faces: NDArray[np.bool_]) -> bool:
        """Tell whether two pieces lie in one blend beside one of some faces: without a freeform one they would be primitives.

        Parameters
        ----------
        pair : (int, int)
        parent : (M,) int64
            As in `round_alike`.
        faces : (M,) bool
            The lowest members of these faces.
        """
        return self.within(pair) and any(faces[face] for m in pair for face in self._faces(m, parent))

    def _faces(self, piece: int, parent: NDArray[np.int64]) -> set[int]:
        """Return the faces along a good part of the border of a piece of a blend."""
        points = Counter[int]()
        for other, n in self.beside[piece].items():
            points[int(parent[other])] += n
        return {face for face, n in points.items() if n >= GOOD_PART * points.total()}


def find_blends(borders: Sequence[Border], size: NDArray[np.int64], noise: float) -> Blends:
    """Find the blends among the pieces of smooth surfaces.

    Parameters
    ----------
    borders : sequence of Border
        From `smooth_borders`.
    size : (M,) int64
        Points of each piece.
    noise : float
        Standard deviation of the points across the surface, in h.

    Notes
    -----
    A freeform face bends as a continuous function of place; at the border of a blend the curvature across it jumps to one over the
    radius of the ball, the same all along.
    """
    jumps = [b for b in borders if b.jumps(noise)]
    own: dict[int, float] = {}
    for b in jumps:
        own[b.sharper] = max(own.get(b.sharper, 0.0), b.bend)
    sharper, flatter = Counter[int](), Counter[int]()
    for b in jumps:
        sharper[b.sharper] += b.points
        flatter[b.flatter] += b.points if b.bend > EVEN * own.get(b.flatter, 0.0) else 0
    members = {m for m, n in sharper.items() if flatter[m] < GOOD_PART * n}
    groups = _connected(members, [b for b in borders if b.bend <= SHARPER * b.other])
    of = {m: k for k, group in enumerate(groups) if _is_blend(set(group), borders, size, noise) for m in group}
    beside: dict[int, dict[int, int]] = {m: {} for m in of}
    for b in borders:
        if b.sharper in of and b.flatter not in of:
            beside[b.sharper][b.flatter] = b.points
    return Blends(of, beside)


def smooth_borders(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    fits: Sequence[ShapeFit],
    contacts: Contacts,
    smooth: Sequence[Contact],
    h: float,
) -> tuple[Border, ...]:
    """Measure how much the pieces of smooth surfaces bend across their borders.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
    fits : sequence of ShapeFit
        The pieces' surfaces.
    contacts : Contacts
        Of all pieces.
    smooth : sequence of Contact
        Where pieces meet smoothly. Those are left out where a piece ends at once.
    h : float
        Spacing of the points, in their unit.
    """
    found = (_border(points, label, fits, contacts, contact, h) for contact in smooth)
    return tuple(border for border in found if border is not None)


def _border(
    points: NDArray[np.float64], label: NDArray[np.int32], fits: Sequence[ShapeFit], contacts: Contacts, contact: Contact, h: float
) -> Border | None:
    """Measure how far normals turn over a spacing."""
    place, away = ways(points, contacts, contact, label)
    if not away:
        return None
    across = away[1] - away[0]
    across *= 0.5 * h / np.maximum(np.linalg.norm(across, axis=1), 1e-12 * h)[:, None]
    bend = []
    for m in contact.pair:
        shape = fits[m].shape
        before, after = shape.normal(place - across), shape.normal(place + across)
        after *= np.sign(np.einsum("ij,ij->i", before, after))[:, None]
        bend.append(float(np.median(np.linalg.norm(after - before, axis=1))))
    (other, flatter), (sharpest, sharper) = sorted(zip(bend, contact.pair, strict=True))
    return Border(sharper, flatter, sharpest, other, sum(map(len, contact.sides)))


def _connected(members: set[int], borders: Sequence[Border]) -> list[list[int]]:
    numbers = sorted(members)
    place = {m: k for k, m in enumerate(numbers)}
    pairs = [(place[b.sharper], place[b.flatter]) for b in borders if b.sharper in place and b.flatter in place]
    parent = joined(len(numbers), pairs)
    return [[numbers[k] for k in np.flatnonzero(parent == top)] for top in np.unique(parent)]


def _is_blend(group: set[int], borders: Sequence[Border], size: NDArray[np.int64], noise: float) -> bool:
    """Tell whether a group is long, and the bend jumps along most of its smooth border, to the same value everywhere."""
    around = [b for b in borders if (b.sharper in group) != (b.flatter in group)]
    points = np.array([b.points for b in around], np.float64)
    bend = np.array([b.bend for b in around])
    jump = np.array([b.jumps(noise) and b.sharper in group for b in around])
    length = 0.25 * points[jump].sum()  # the points of either piece along either side
    if length**2 < LONG * size[list(group)].sum() or not jump.any():
        return False
    order = np.argsort(bend[jump], kind="stable")
    middle = bend[jump][order][np.searchsorted(np.cumsum(points[jump][order]), 0.5 * points[jump].sum())]
    even = jump & (bend < EVEN * middle) & (bend > middle / EVEN)
    return bool(points[even].sum() > MOST_OF * points.sum())
