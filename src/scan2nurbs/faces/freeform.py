"""Tell freeform faces from primitives: what primitives cut from a smooth surface meets smoothly, but is not tangent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.faces.astray import look_amid, one_sweep
from scan2nurbs.faces.blends import find_blends, smooth_borders
from scan2nurbs.faces.charts import Turns, charts, turns_of
from scan2nurbs.faces.compete import MODEL_COST
from scan2nurbs.faces.contacts import Contact, Contacts, face_contacts, parted_contacts, smooth_contacts
from scan2nurbs.faces.finish import sweeps
from scan2nurbs.faces.gather import Pairs, gather, groups
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.relations import doubt_tangency
from scan2nurbs.surfaces.shape import KINDS, Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit, choose_shape, fit_shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS

BAND = 4
"""Rings of neighbours from a border over which a surface runs on."""
LEAST_DEVIATION = 0.15
"""Smallest deviation that counts there, in h: the smaller the noise, the smaller the pieces, and the sooner they part."""
KINK = 35.0
"""Degrees by which pieces of a freeform face may turn where they meet: the smaller they are, the more."""
LEAST_BORDER = 4.0
"""Borders shorter than this, in h, may be corners where faces touch that have no edge in common."""
CREASED = 0.5
"""A border is a crease where so large a share of its points is on an edge."""
LEAST_PIECES = 3
"""Of fewer pieces a freeform face is no likelier than two primitives whose tangency a few stray points hide."""
ROUGHEST = 1.25
"""A freeform surface explains its points with residuals up to this many times those of the pieces."""


WIDEST = (65.0, 45.0, 30.0)
"""Degrees by which normals of a chart may lean away from their mean: at first a height field with a margin."""


@dataclass(frozen=True)
class Pieces:
    """A labelled cloud with a fit for each label.

    Attributes
    ----------
    points : (N, 3) float64
    normals : (N, 3) float64
        As lines; NaN where unknown.
    label : (N,) int32
    fits : tuple of ShapeFit
    by_edges : bool
        Whether points on creases had a say; where not, any others would have given the same.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    label: NDArray[np.int32]
    fits: tuple[ShapeFit, ...]
    by_edges: bool = False


def join_freeform(pieces: Pieces, on_edge: NDArray[np.bool_], scale: Scale, noise: float, kinds: Sequence[Kind] = KINDS) -> Pieces:
    """Join the pieces of freeform faces, wherever one B-spline surface is the shorter description of their points.

    Parameters
    ----------
    pieces : Pieces
    on_edge : (N,) bool
        Points on creases.
    scale : Scale
        Of all points.
    noise : float
        Standard deviation of the points across the surface, in their unit.
    kinds : sequence of str
        Kinds of surfaces that joined faces may have.

    Returns
    -------
    Pieces
        Joined faces keep the lowest of their labels; the other labels are empty.

    Notes
    -----
    Neighbours that meet smoothly and are not tangent (`relations.doubt_tangency`), over a border where each surface runs on over the
    other's points, are pieces of one face. What they make is fitted by one surface; where that folds or is worse, by one for each of a few
    charts.
    """
    contacts = face_contacts(pieces.label, scale)
    bent, back = parted_contacts(pieces.points, pieces.label, contacts, pieces.fits, scale, KINK)
    smooth = smooth_contacts(pieces.points, pieces.label, replace(contacts, found=bent), pieces.fits, scale)
    doubts = doubt_tangency(pieces.points, pieces.label, pieces.fits, [c.pair for c in smooth], noise=max(noise, 0.01 * scale.h), h=scale.h)
    least = max(noise, LEAST_DEVIATION * scale.h)
    borders = smooth_borders(pieces.points, pieces.label, pieces.fits, contacts, smooth, scale.h)
    size = np.bincount(pieces.label[pieces.label >= 0], minlength=len(pieces.fits))
    blends = find_blends(borders, size, least / scale.h)
    amid = look_amid(pieces.points, pieces.label, pieces.fits, contacts, least)
    swept = frozenset(c.pair for c in smooth if amid.likely(c.pair) and _one_sweep(pieces, c, scale.h))
    # A ball that rolls between surfaces of one axis makes a ring: one that is none is a part of their profile.
    bent, smooth = (tuple(c for c in some if c.pair in swept or not blends.part(c.pair)) for some in (bent, smooth))
    even = frozenset(b.pair for b in borders if not b.jumps(least / scale.h))
    pairs = Pairs(
        reach={c.pair: _runs_on(pieces, contacts, c, least) for c in smooth},
        doubt=doubts,
        even=even,
        freeform=swept | frozenset(c.pair for c in smooth if all(map(amid.astray, c.pair)) or (c.pair in even and amid.likely(c.pair))),
    )
    by_edges = any(pairs.doubted(c.pair) for c in bent) or bool(pairs.chains(pairs.reach))  # or nothing is joined that edges could part
    bent = tuple(c for c in bent if not _creased(pieces, c, on_edge, scale.h))
    smooth_pieces = _Smooth(pieces, size, pairs, bent, smooth, turns_of(pieces.points, pieces.fits, bent, back), tuple(kinds), noise)
    faces = smooth_pieces.join(lambda pair: not blends.within(pair))
    parent, freeform = np.arange(len(size)), np.zeros(len(size), bool)
    for members, fit in faces:
        parent[members], freeform[members[0]] = members[0], fit.shape.kind not in COLUMNS
    faces += smooth_pieces.join(  # blends come last, as they lie between faces
        lambda pair: blends.within(pair) and blends.round_alike(pair, parent), lambda pair: blends.rounds_any(pair, parent, freeform)
    )
    label, fits = pieces.label.copy(), list(pieces.fits)
    for members, fit in faces:
        label[np.isin(label, members)] = members[0]
        fits[members[0]] = fit
    return replace(pieces, label=label, fits=tuple(fits), by_edges=by_edges)


@dataclass(frozen=True)
class _Smooth:
    """Pieces with their contacts: those that are no creases, and those where they meet smoothly."""

    pieces: Pieces
    size: NDArray[np.int64]
    pairs: Pairs
    bent: tuple[Contact, ...]
    smooth: tuple[Contact, ...]
    turns: Turns
    kinds: tuple[Kind, ...]
    noise: float

    def join(
        self, alike: Callable[[tuple[int, int]], bool], sure: Callable[[tuple[int, int]], bool] = lambda _: False
    ) -> list[tuple[list[int], ShapeFit]]:
        """Return the faces of several pieces among those of some pairs, each with its surface; some pairs may belong together for sure."""
        bent, smooth = ([c for c in some if alike(c.pair)] for some in (self.bent, self.smooth))
        flat = np.array([fit.shape.kind == "plane" for fit in self.pieces.fits], bool)
        near = [c.pair for c in smooth]
        parent = gather(self.size, flat, self.pairs, [c.pair for c in bent], near, [pair for pair in near if sure(pair)])
        doubted = {c.pair for c in bent if self.pairs.doubted(c.pair)}
        found = []
        for group in groups(parent):
            within = [c for c in bent if c.pair[0] in group and c.pair[1] in group]
            found += _fitted(self.pieces, group, within, self.turns, _beside(group, doubted, parent), self.kinds, self.noise)
        return found


def _one_sweep(pieces: Pieces, contact: Contact, h: float) -> bool:
    one, other = (pieces.fits[m].shape for m in contact.pair)
    return one_sweep(one, other, pieces.points[np.concatenate(contact.sides)].mean(axis=0), h)


def _creased(pieces: Pieces, contact: Contact, on_edge: NDArray[np.bool_], h: float) -> bool:
    """Tell whether a border is a crease, or too short to tell."""
    rows = np.concatenate(contact.sides)
    return float(np.ptp(pieces.points[rows], axis=0).max()) < LEAST_BORDER * h or float(np.mean(on_edge[rows])) > CREASED


def _runs_on(pieces: Pieces, contacts: Contacts, contact: Contact, noise: float) -> tuple[float, float]:
    """Return how far the points beside the border lie from the other's surface, either way, root mean square in deviations."""
    out = []
    for own, side in ((contact.pair[0], contact.sides[1]), (contact.pair[1], contact.sides[0])):
        band = contacts.band(side, pieces.label, BAND)
        d = pieces.fits[own].shape.distance(pieces.points[band]) / noise
        out.append(float(np.sqrt(np.mean(np.minimum(d * d, 25.0)))))
    return out[0], out[1]


def _fitted(
    pieces: Pieces, group: list[int], smooth: list[Contact], turns: Turns, beside: list[int], kinds: Sequence[Kind], noise: float
) -> list[tuple[list[int], ShapeFit]]:
    """Return the charts of a group with their fits: the whole of it if that pays, else as few as do; what stays as it is, is left out."""
    whole = _fit(pieces, group, kinds, noise)
    if whole is not None:
        return [_extended(pieces, group, whole, beside, noise)]
    found, left = [], [group]
    for widest in WIDEST:
        failed = []
        for part in left:
            among = [c for c in smooth if c.pair[0] in part and c.pair[1] in part]
            for chart in charts(pieces.points, pieces.label, pieces.fits, part, among, turns, widest):
                fit = _fit(pieces, chart, kinds, noise) if 1 < len(chart) < len(group) else None
                if fit is not None:
                    found.append((chart, fit))
                elif len(chart) > 1:
                    failed.append(chart)
        left = failed
    return found


def _beside(group: list[int], doubted: set[tuple[int, int]], parent: NDArray[np.int64]) -> list[int]:
    """Return the pieces that stand alone beside a group and are not tangent to it."""
    alone = np.bincount(parent, minlength=len(parent)) == 1
    return sorted({j for pair in doubted for i, j in (pair, pair[::-1]) if i in group and alone[j]})


def _extended(pieces: Pieces, group: list[int], fit: ShapeFit, beside: list[int], noise: float) -> tuple[list[int], ShapeFit]:
    """Let the surface of a group take in pieces beside it wherever it costs less to describe both at once."""
    for m in beside:
        wider = sorted([*group, m])
        joint = _fit(pieces, wider, [fit.shape.kind], noise)
        if joint is not None and _price(pieces, wider, joint) < _price(pieces, group, fit) + _price(pieces, [m], pieces.fits[m]):
            group, fit = wider, joint
    return group, fit


def _price(pieces: Pieces, members: list[int], fit: ShapeFit) -> float:
    """Return the length of the description of a surface; each control point is determined by the points in its own few spans only."""
    n, free = int(np.isin(pieces.label, members).sum()), fit.shape.freedom
    return MODEL_COST + 0.5 * free * float(np.log(max(n if fit.shape.kind in COLUMNS else n / free, 2.0)))


def _fit(pieces: Pieces, members: list[int], kinds: Sequence[Kind], noise: float) -> ShapeFit | None:
    """Return the one surface of some pieces, or None where it does not explain the points or is the longer description."""
    mine = np.flatnonzero(np.isin(pieces.label, members))
    p, own = pieces.points[mine], pieces.label[mine]
    d = np.empty(len(mine))
    for m in members:
        d[own == m] = pieces.fits[m].shape.distance(p[own == m])
    cost = sum(_price(pieces, [m], pieces.fits[m]) for m in members)
    best: ShapeFit | None = None
    for fit in _trials(p, len(members) >= LEAST_PIECES, kinds, noise):
        off = fit.shape.distance(p)
        left = study(fit.shape.foot(p), off, max(noise, _rough(d)))
        # Residuals of the pieces are too small to compare with: each point chose the piece that it is nearest to.
        simple, clear = fit.shape.kind in COLUMNS, left.nothing_left()
        if not (clear or (left.explained(noise) and not simple)):
            continue
        if _price(pieces, members, fit) >= cost or _rough(off) > ROUGHEST * max(_rough(d), noise):
            continue
        if clear:
            return fit
        best = fit if best is None or fit.criterion < best.criterion else best
    return best


def _trials(points: NDArray[np.float64], several: bool, kinds: Sequence[Kind], noise: float) -> Iterator[ShapeFit]:
    """Yield surfaces for the points of some pieces, the simplest first; freeform ones only of several."""
    primitives: list[Kind] = [kind for kind in kinds if kind in COLUMNS]
    if primitives:
        with suppress(NoResultError, InputError):
            yield choose_shape(points, noise=noise, kinds=primitives)
    if several:
        yield from sweeps(points, noise, kinds)
        with suppress(NoResultError, InputError):
            yield fit_shape("bspline", points, noise=noise)


def _rough(d: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.minimum(np.abs(d), 5.0 * np.median(np.abs(d))) ** 2)))
