"""Tell freeform faces from primitives: what primitives cut from a smooth surface meets smoothly, but is not tangent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.faces.charts import Turns, charts, turns_of
from scan2nurbs.faces.compete import MODEL_COST
from scan2nurbs.faces.contacts import Contact, Contacts, face_contacts, parted_contacts, smooth_contacts
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.relations import doubt_tangency
from scan2nurbs.surfaces.shape import KINDS, Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit, choose_shape, fit_shape
from scan2nurbs.surfaces.shape_parameters import COLUMNS

BAND = 4
"""Rings of neighbours from a border over which a surface runs on."""
CERTAIN = 4.0
"""Doubt beyond which neighbours are not tangent, even if stray points spoil small ones."""
RUNS_ON = 2.0
"""A surface runs on over points that lie within so many deviations of it, root mean square; a fillet bends away much faster."""
PARTS = 4.0
"""The same for the other way about: the smaller of two pieces is known less well."""
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
MOST = 0.5
"""Share of the points that lies on freeform faces where a cloud is no part of primitives at all."""
SMALL = 0.2
"""A piece is small with less than this share of a freeform face's points: it joins without further evidence."""
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
    by_edges = any(doubts.get(c.pair, np.inf) > 1.0 for c in bent)  # where all are tangent, nothing is joined
    bent = tuple(c for c in bent if not _creased(pieces, c, on_edge, scale.h))
    clear = {c.pair for c in bent}
    run_on = {c.pair for c in smooth if c.pair in clear and doubts[c.pair] > 1.0 and _run_on(pieces, contacts, c, least)}
    doubted = {c.pair: c.pair in run_on for c in bent if doubts.get(c.pair, np.inf) > 1.0}
    parent = _continued(pieces, doubted, [pair for pair in sorted(run_on) if doubts[pair] > CERTAIN])
    parent = _absorbed(pieces, contacts, smooth, parent, least)
    turns = turns_of(pieces.points, pieces.fits, bent, back)
    label, fits = pieces.label.copy(), list(pieces.fits)
    for group in _groups(parent):
        within = [c for c in bent if c.pair[0] in group and c.pair[1] in group]
        for members, fit in _fitted(pieces, group, within, turns, _beside(group, doubted, parent), kinds, noise):
            label[np.isin(label, members)] = members[0]
            fits[members[0]] = fit
    return replace(pieces, label=label, fits=tuple(fits), by_edges=by_edges)


def _creased(pieces: Pieces, contact: Contact, on_edge: NDArray[np.bool_], h: float) -> bool:
    """Tell whether a border is a crease, or too short to tell."""
    rows = np.concatenate(contact.sides)
    return float(np.ptp(pieces.points[rows], axis=0).max()) < LEAST_BORDER * h or float(np.mean(on_edge[rows])) > CREASED


def _run_on(pieces: Pieces, contacts: Contacts, contact: Contact, noise: float) -> bool:
    """Tell whether the surfaces of two pieces run on over each other's points beside their border."""
    over = _runs_on(pieces, contacts, contact, noise)
    return min(over) < RUNS_ON and max(over) < PARTS


def _runs_on(pieces: Pieces, contacts: Contacts, contact: Contact, noise: float) -> tuple[float, float]:
    """Return how far the points beside the border lie from the other's surface, either way, root mean square in deviations."""
    out = []
    for own, side in ((contact.pair[0], contact.sides[1]), (contact.pair[1], contact.sides[0])):
        band = contacts.band(side, pieces.label, BAND)
        d = pieces.fits[own].shape.distance(pieces.points[band]) / noise
        out.append(float(np.sqrt(np.mean(np.minimum(d * d, 25.0)))))
    return out[0], out[1]


def _continued(pieces: Pieces, doubted: dict[tuple[int, int], bool], joins: list[tuple[int, int]]) -> NDArray[np.int64]:
    """Let what is freeform for certain go on up to the next crease, over pieces that stand alone where their surface runs on.

    Where most of the points are freeform, it goes on over all pieces that are not tangent.
    """
    parent = _joined(len(pieces.fits), joins)
    size = np.bincount(pieces.label[pieces.label >= 0], minlength=len(parent))
    while True:
        free = np.bincount(parent, minlength=len(parent))[parent] > 1
        organic = size[free].sum() > MOST * size.sum()
        either = {pair for pair, runs_on in doubted.items() if runs_on or organic}
        more = [pair for pair in doubted if free[list(pair)].all() or (pair in either and free[list(pair)].any())]
        wider = _joined(len(parent), [*joins, *more])
        if (wider == parent).all():
            return parent
        parent = wider


def _absorbed(
    pieces: Pieces, contacts: Contacts, smooth: tuple[Contact, ...], parent: NDArray[np.int64], noise: float
) -> NDArray[np.int64]:
    """Give freeform faces the small pieces beside them onto which their surface runs on."""
    size = np.bincount(pieces.label[pieces.label >= 0], minlength=len(parent))
    reach = {c.pair: _runs_on(pieces, contacts, c, noise) for c in smooth}
    while True:
        members, total = np.bincount(parent, minlength=len(parent)), np.bincount(parent, weights=size, minlength=len(parent))
        more = []
        for (i, j), (over_j, over_i) in reach.items():
            for own, other, over in ((i, j, over_j), (j, i, over_i)):
                group, small = parent[own], parent[other]
                if group != small and members[group] > 1 and total[small] <= SMALL * total[group] and over < RUNS_ON:
                    more.append((int(group), int(small)))
        if not more:
            return parent
        parent = _joined(len(parent), [*enumerate(parent.tolist()), *more])


def _joined(n: int, pairs: list[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the lowest member of the group of each of n, given which ones belong together."""
    parent = list(range(n))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for i, j in pairs:
        a, b = sorted((root(i), root(j)))
        parent[b] = a
    return np.array([root(i) for i in range(n)], np.int64)


def _groups(parent: NDArray[np.int64]) -> list[list[int]]:
    kept, count = np.unique(parent, return_counts=True)
    return [np.flatnonzero(parent == k).tolist() for k in kept[count > 1]]


def _fitted(
    pieces: Pieces, group: list[int], smooth: list[Contact], turns: Turns, beside: list[int], kinds: Sequence[Kind], noise: float
) -> list[tuple[list[int], ShapeFit]]:
    """Return the charts of a group with their fits: the whole of it if that pays, else as few as do; what stays as it is, is left out."""
    whole = _fit(pieces, group, kinds, noise)
    if whole is not None:
        return [_extended(pieces, group, whole, beside, kinds, noise)]
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


def _beside(group: list[int], doubted: dict[tuple[int, int], bool], parent: NDArray[np.int64]) -> list[int]:
    """Return the pieces that stand alone beside a group and are not tangent to it."""
    alone = np.bincount(parent, minlength=len(parent)) == 1
    return sorted({j for pair in doubted for i, j in (pair, pair[::-1]) if i in group and alone[j]})


def _extended(
    pieces: Pieces, group: list[int], fit: ShapeFit, beside: list[int], kinds: Sequence[Kind], noise: float
) -> tuple[list[int], ShapeFit]:
    """Let the surface of a group take in pieces beside it wherever it costs less to describe both at once."""
    for m in beside:
        wider = sorted([*group, m])
        joint = _fit(pieces, wider, kinds, noise)
        if joint is not None and _price(pieces, wider, joint) < _price(pieces, group, fit) + _price(pieces, [m], pieces.fits[m]):
            group, fit = wider, joint
    return group, fit


def _price(pieces: Pieces, members: list[int], fit: ShapeFit) -> float:
    """Return the length of the description of a surface; each control point is determined by the points in its own few spans only."""
    n, free = int(np.isin(pieces.label, members).sum()), fit.shape.freedom
    return MODEL_COST + 0.5 * free * float(np.log(max(n / free if fit.shape.kind == "bspline" else n, 2.0)))


def _fit(pieces: Pieces, members: list[int], kinds: Sequence[Kind], noise: float) -> ShapeFit | None:
    """Return the one surface of some pieces, or None where it does not explain the points or is the longer description."""
    mine = np.flatnonzero(np.isin(pieces.label, members))
    p, own = pieces.points[mine], pieces.label[mine]
    d = np.empty(len(mine))
    for m in members:
        d[own == m] = pieces.fits[m].shape.distance(p[own == m])
    cost = sum(_price(pieces, [m], pieces.fits[m]) for m in members)
    primitives: list[Kind] = [kind for kind in kinds if kind in COLUMNS]
    for simple in (True, False)[: 1 + (len(members) >= LEAST_PIECES)]:
        try:
            fit = choose_shape(p, noise=noise, kinds=primitives) if simple else fit_shape("bspline", p, noise=noise)
        except (NoResultError, InputError):
            continue
        off = fit.shape.distance(p)
        left = study(fit.shape.foot(p), off, max(noise, _rough(d)))
        # Residuals of the pieces are too small to compare with: each point chose the piece that it is nearest to.
        explained = left.nothing_left() if simple else left.explained(noise)
        if explained and _price(pieces, members, fit) < cost and _rough(off) <= ROUGHEST * max(_rough(d), noise):
            return fit
    return None


def _rough(d: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.minimum(np.abs(d), 5.0 * np.median(np.abs(d))) ** 2)))
