"""Impose the relations between the surfaces of a part that hold within their uncertainty."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import ParameterError
from scan2nurbs.ranges import require_float
from scan2nurbs.scale import chi2_quantile
from scan2nurbs.surfaces.constraints import ANGLE, evaluate
from scan2nurbs.surfaces.relation_search import Candidate, Floors, Known, find_relations, find_tangencies
from scan2nurbs.surfaces.relation_select import select_relations, tangency_doubts
from scan2nurbs.surfaces.relation_solve import JointFit, Member, fit_jointly, normal_system
from scan2nurbs.surfaces.shape import Floats, inverse
from scan2nurbs.surfaces.shape_fit import ShapeFit
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, lengths, recentred, scaled
from scan2nurbs.surfaces.shape_solve import TUKEY, distances

logger = logging.getLogger(__name__)

RELATIONS = ("parallel", "perpendicular", "coaxial", "coplanar", "equal radius", "tangent")
_POINTS = 50_000  # points of a face that take part in the joint fit, at most
_ATTEMPTS = 12
_PATIENCE = 4  # attempts in which relations are given up one by one
_CLOSED = 1e-10  # of the extent, and radians: equations that are further off contradict each other
_STRAINED = 4.0  # standard deviations
_REFUSED = 1.0 - 1e-6


@dataclass(frozen=True, kw_only=True)
class RelationParams:
    """What is imposed.

    Attributes
    ----------
    kinds : tuple of str
        Kinds that are imposed, all of them unless told; empty for none.
    angle : float
        Directions that are as close to a relation are never doubted, however well they are known; in degrees, [0, inf).
    length : float
        Places and radii that are as close to a relation are never doubted, however well they are known; a share of the noise, [0, inf).
    max_rise : float
        A relation that raises the rms of a face by more than this share of it is dropped, [0, inf).
    """

    kinds: tuple[str, ...] = RELATIONS
    angle: float = 0.05
    length: float = 0.1
    max_rise: float = 0.25

    def __post_init__(self) -> None:
        for kind in self.kinds:
            if kind not in RELATIONS:
                raise ParameterError(f"The 'kinds' of relations must be among {', '.join(RELATIONS)}. Got {kind!r} instead.")
        for name in ("angle", "length", "max_rise"):
            require_float(getattr(self, name), name, "impose_relations", 0, closed="low")


@dataclass(frozen=True)
class Relation:
    """A relation that was imposed.

    Attributes
    ----------
    kind : str
        One of `RELATIONS`.
    faces : (int, int)
    angle : float
        How far directions were apart before, in degrees.
    length : float
        How far places and radii were from it before, in the points' unit.
    cost : float
        By how much the rms of the face that suffered most rose by all relations together, in the points' unit; negative where none did.
    """

    kind: str
    faces: tuple[int, int]
    angle: float
    length: float
    cost: float


@dataclass(frozen=True)
class Related:
    """The fits under their relations, in the order given, the relations, and what the caller should know."""

    fits: tuple[ShapeFit, ...]
    relations: tuple[Relation, ...]
    notes: tuple[str, ...] = ()


def impose_relations(
    points: Floats,
    label: NDArray[np.int32],
    fits: Sequence[ShapeFit],
    *,
    noise: float,
    h: float,
    smooth: Iterable[tuple[int, int]] = (),
    params: RelationParams | None = None,
) -> Related:
    """Find the relations between the primitives of a part, and fit all of them again so that the relations hold exactly.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Face of each point; −1 for none.
    fits : sequence of ShapeFit
        One a face. Splines and swept curves stay as they are.
    noise : float
        Standard deviation of the points across the surface, in their unit.
    h : float
        Spacing of the points.
    smooth : iterable of (int, int)
        Pairs of faces that meet smoothly: these may be made tangent.
    params : RelationParams, optional

    Returns
    -------
    Related
        Equations of the relations hold to about 1e-12 of the extent.

    Notes
    -----
    A relation that raises the rms of a face by more than `max_rise`, significantly, is dropped, and all others are solved
    for again. Time grows with faces and relations, hardly with points. Deterministic.
    """
    params = params or RelationParams()
    part = _Part.make(points, label, fits, noise, h)
    floors = part.floors(params, noise, h)
    known = part.known()
    found = [c for c in find_relations(known, floors) if c.kind in params.kinds]
    tangent = find_tangencies(known, sorted({(min(p), max(p)) for p in smooth})) if "tangent" in params.kinds else []
    active, dropped, near = select_relations(known, found, tangent, floors)
    start = [near[m.face] for m in part.members]
    joint = JointFit(tuple(part.shapes), 0.0, np.zeros(0))
    for attempt in range(_ATTEMPTS):
        if not active:
            break
        joint = fit_jointly(start, part.members, active, floors)
        bad = _refused(part, joint, active, params, everything=attempt >= _PATIENCE)
        if not bad:
            break
        dropped += [active[k] for k in sorted(bad)]
        active = [c for k, c in enumerate(active) if k not in bad]
    else:
        dropped, active = [*dropped, *active], []
    logger.info("%d relations hold, %d were dropped", len(active), len(dropped))
    if not active:
        return Related(tuple(fits), (), _notes(dropped))
    return _result(part, fits, joint, active, dropped)


def doubt_tangency(
    points: Floats,
    label: NDArray[np.int32],
    fits: Sequence[ShapeFit],
    smooth: Iterable[tuple[int, int]],
    *,
    noise: float,
    h: float,
    params: RelationParams | None = None,
) -> dict[tuple[int, int], float]:
    """Tell how clearly the points speak against faces being tangent along the border where they meet smoothly.

    Parameters
    ----------
    points, label, fits, noise, h, params
        See `impose_relations`.
    smooth : iterable of (int, int)
        Pairs of faces.

    Returns
    -------
    dict
        For each pair (i < j) the Wald statistic of its best way to be tangent, over the threshold: at most one where they may be tangent;
        infinite where surfaces of these kinds cannot be, or are no primitives.

    Notes
    -----
    Primitives of a designed part that meet smoothly are tangent exactly. Primitives that merely approximate pieces of one freeform surface
    are not, and their parameters are known well enough to see it.
    """
    params = params or RelationParams()
    part = _Part.make(points, label, fits, noise, h)
    floors = part.floors(params, noise, h)
    pairs = sorted({(min(p), max(p)) for p in smooth})
    known = part.known()
    doubts = tangency_doubts(known, find_tangencies(known, pairs), floors)
    return {pair: doubts.get(pair, np.inf) for pair in pairs}


@dataclass(frozen=True)
class _Part:
    """The primitives of a part, moved to its middle and scaled by its extent."""

    middle: Floats
    extent: float
    shapes: list[Primitive]
    members: list[Member]
    place: dict[int, int]
    before: list[float]

    @staticmethod
    def make(points: Floats, label: NDArray[np.int32], fits: Sequence[ShapeFit], noise: float, h: float) -> _Part:
        low, high = points.min(axis=0), points.max(axis=0)
        middle, extent = 0.5 * (low + high), float((high - low).max())
        order = np.argsort(label, kind="stable")
        starts = np.searchsorted(label[order], np.arange(len(fits) + 1))
        shapes, members = [], []
        for face, fit in enumerate(fits):
            mine = order[starts[face] : starts[face + 1]]
            if fit.shape.kind not in COLUMNS or len(mine) < len(COLUMNS[fit.shape.kind]):
                continue
            stride = -(-len(mine) // _POINTS)
            own = np.ascontiguousarray((points[mine[::stride]] - middle) / extent)
            shape = recentred(scaled(fit.shape, -middle, 1.0 / extent), own.mean(axis=0))  # type: ignore[arg-type] - by kind
            sigma = max(noise, 0.01 * h, float(1.4826 * np.median(np.abs(distances(shape, own)))) * extent) / extent
            shapes.append(shape)
            members.append(Member(face, own, sigma, len(mine) / len(own)))
        place = {m.face: i for i, m in enumerate(members)}
        return _Part(middle, extent, shapes, members, place, [_rms(s, m) for s, m in zip(shapes, members, strict=True)])

    def floors(self, params: RelationParams, noise: float, h: float) -> Floors:
        return Floors(np.radians(params.angle), max(params.length * noise, 0.01 * h) / self.extent)

    def known(self) -> list[Known]:
        return [Known(m.face, s, inverse(normal_system(s, m)[0])) for s, m in zip(self.shapes, self.members, strict=True)]


def _rms(shape: Primitive, member: Member) -> float:
    d = np.minimum(np.abs(distances(shape, member.points)), TUKEY * member.sigma)
    return float(np.sqrt(np.mean(d * d)))


def _refused(part: _Part, joint: JointFit, active: Sequence[Candidate], params: RelationParams, *, everything: bool) -> set[int]:
    """Return the relations to give up: the worst that contradict others or spoil faces; where told, all of those faces."""
    if not np.isfinite(joint.gap) or joint.gap > _CLOSED:
        bad = {int(k) for k in np.flatnonzero(joint.force >= max(0.3 * joint.force.max(), _STRAINED))} or {int(np.argmax(joint.force))}
        return _widened(bad, active) if everything else _apart(bad, joint, active)
    bad: set[int] = set()
    for i, (shape, member) in enumerate(zip(joint.shapes, part.members, strict=True)):
        before, after = part.before[i], _rms(shape, member)
        rise = (after**2 - before**2) * len(member.points) * member.share / member.sigma**2
        if after > (1.0 + params.max_rise) * before and rise > chi2_quantile(_REFUSED, len(COLUMNS[shape.kind])):
            mine = [k for k, c in enumerate(active) if member.face in c.faces]
            if mine:
                bad |= set(mine) if everything else {max(mine, key=lambda k: joint.force[k])}
    return bad if everything else _apart(bad, joint, active)


def _widened(bad: set[int], active: Sequence[Candidate]) -> set[int]:
    """Return all relations of the faces of some."""
    faces = {face for k in bad for face in active[k].faces}
    return {k for k, c in enumerate(active) if faces & set(c.faces)}


def _apart(bad: set[int], joint: JointFit, active: Sequence[Candidate]) -> set[int]:
    """Return the worst relations, one a face: what else is bad may well be true once the worst is gone."""
    kept: set[int] = set()
    busy: set[int] = set()
    for k in sorted(bad, key=lambda k: -joint.force[k]):
        if not busy & set(active[k].faces):
            kept.add(k)
            busy |= set(active[k].faces)
    return kept


def _result(part: _Part, fits: Sequence[ShapeFit], joint: JointFit, active: Sequence[Candidate], dropped: Sequence[Candidate]) -> Related:
    new, rise = list(fits), {}
    touched = {face for c in active for face in c.faces}
    for i, (shape, member) in enumerate(zip(joint.shapes, part.members, strict=True)):
        after = _rms(shape, member)
        rise[member.face] = (after - part.before[i]) * part.extent
        if member.face in touched:
            size = np.where(lengths(shape.kind), part.extent, 1.0)
            # Of the points that took part: what others would have told is not in the fit.
            covariance = inverse(normal_system(shape, member._replace(share=1.0))[0]) * np.outer(size, size)
            back = scaled(shape, np.zeros(3), part.extent, part.middle)
            old = fits[member.face]
            new[member.face] = replace(old, shape=back, rms=after * part.extent, covariance=covariance)
    relations = []
    for c in active:
        first, second = (part.shapes[part.place[f]] for f in c.faces)
        values = evaluate(c.equations, first, second)
        angles = np.array([u == ANGLE for u in values.unit])
        apart = np.abs(values.value)
        angle, length = float(apart[angles].max(initial=0.0)), float(apart[~angles].max(initial=0.0))
        cost = max(rise[f] for f in c.faces)
        relations.append(Relation(c.kind, c.faces, float(np.degrees(angle)), length * part.extent, cost))
    return Related(tuple(new), tuple(relations), _notes(dropped))


def _notes(dropped: Sequence[Candidate]) -> tuple[str, ...]:
    return tuple(f"Faces {c.faces[0]} and {c.faces[1]} are not {c.kind}: the points speak against it." for c in dropped)
