"""The borders of a topology as curves: each laid once, for both of its faces, between vertices where they agree."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.curve import fit_curve
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.meeting import Loose, Meeting
from scan2nurbs.brep.space import SpaceCurve, lay_curve, simple_curve
from scan2nurbs.faces.topology import Border
from scan2nurbs.surfaces.shape import Shape, cross, unit

Floats = NDArray[np.float64]

MODES = ("middle", "contact", "crossing")

_MOST = 400
_FAR = 2.0
"""Points of a border farther apart than so many h get others between them."""
_SIMPLE = (0.1, 0.03, 2e-3)
_STRAY = (0.02, 0.02, 2e-3)
_PRIOR = (0.02, 0.3, 1.0)
_GUIDE, _CONTACT, _FIRM = 0.05, 0.3, 3.0
_DRIFT = 3.0
_KEEP_END = 0.08
_AIM = 0.94
_SHORTEST = 0.02


@dataclass(frozen=True)
class BorderCurve:
    """A border as a curve.

    Attributes
    ----------
    curve : SpaceCurve
        From the first vertex to the last.
    faces, vertices : (int, int)
        As in the topology.
    mode : str
        "crossing" where the two surfaces intersect, "contact" where they touch, "middle" where neither tells where they meet.
    gap : float
        Largest distance of the curve to its surfaces.
    angle : float
        Median angle between the surfaces, in degrees; 180 at a free border.
    """

    curve: SpaceCurve
    faces: tuple[int, int]
    vertices: tuple[int, int]
    mode: str
    gap: float
    angle: float

    @property
    def closed(self) -> bool:
        """Whether it is a ring without a vertex."""
        return self.vertices[0] < 0


@dataclass(frozen=True)
class _Guide:
    """A border's points, evenly spaced and drawn onto the surfaces."""

    meeting: Meeting
    points: Floats
    along: Floats
    mode: int
    spacing: float
    caution: int


def lay_borders(
    borders: Sequence[Border],
    vertices: Floats,
    shapes: Sequence[Shape],
    h: float,
    caution: Sequence[int] | None = None,
    known: Known | None = None,
    held: Collection[int] = (),
) -> tuple[list[BorderCurve], Floats]:
    """Lay a curve along every border, and the vertices where the surfaces and the curves that meet there agree.

    Parameters
    ----------
    borders : sequence of Border
        Of a `Topology`.
    vertices : (V, 3) float64
    shapes : sequence of Shape
        Of the faces.
    h : float
        Spacing of the cloud.
    caution : sequence of int, optional
        How closely each border's own points are followed, whatever the surfaces say: 0 not at all, 1 by a fair curve, 2 by all of them.
    known : Known, optional
        Curves that were laid before.
    held : collection of int
        Vertices that stay where they are.

    Returns
    -------
    curves : list of BorderCurve
        One a border.
    vertices : (V, 3) float64
    """
    caution = caution or [0] * len(borders)
    known = known or Known()
    guides = []
    for border, care in zip(borders, caution, strict=True):
        beside = [shapes[f] for f in border.faces if f >= 0]
        guides.append(known(("guide", border, care, *beside), lambda b=border, c=care: _guide(b, shapes, h, c)))
    placed = _place_vertices(borders, guides, vertices, shapes, h, known, held)
    curves = []
    for border, guide in zip(borders, guides, strict=True):
        ends = placed[list(border.vertices)].tobytes() if border.vertices[0] >= 0 else b""
        curves.append(known(("curve", border, guide, ends), lambda b=border, g=guide: _lay(b, g, placed, h)))
    return curves, placed


def without_faces(border: Border, faces: Collection[int], known: Known) -> Border:
    """Return a border that is free where some faces were."""
    first, second = (-1 if f in faces else f for f in border.faces)
    return (
        border
        if (first, second) == border.faces
        else known(("free", border, first, second), lambda: replace(border, faces=(first, second)))
    )


def _guide(border: Border, shapes: Sequence[Shape], h: float, caution: int) -> _Guide:
    closed = border.vertices[0] < 0
    meeting = Meeting(tuple(shapes[f] for f in border.faces if f >= 0) or (Loose(),), h)
    points = _even(_smoothed(_filled(np.asarray(border.points, np.float64), h), closed), h)
    along = _directions(points, closed)
    drawn, how = meeting.draw(points, along) if not caution else (points, np.zeros(len(points), np.int8))
    inner = how if closed or len(how) < 4 else how[1:-1]
    counts = np.bincount(inner, minlength=3)
    mode = int(np.argmax(counts + np.array([0.0, 0.1, 0.2])))
    if mode == 0:
        drawn = meeting.middle(_faired(points, closed, h) if caution < 2 else points)
    kept = np.ones(len(drawn), bool)
    if mode > 0:
        kept = how >= mode
        kept[[0, -1]] |= not closed
    drawn = _ordered(drawn[kept], along[kept], closed, h)
    spacing = float(np.median(np.linalg.norm(np.diff(drawn, axis=0), axis=1))) if len(drawn) > 1 else h
    return _Guide(meeting, drawn, _directions(drawn, closed), mode, spacing, caution)


def _filled(points: Floats, h: float) -> Floats:
    """Return the points, and evenly spaced ones where two lie far apart, as on rims of holes: smoothing would draw these together."""
    if len(points) < 2:
        return points
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    count = np.where(step > _FAR * h, np.ceil(step / h), 1.0).astype(int)
    at = np.concatenate([[0.0], np.repeat(np.arange(len(step)), count) + np.concatenate([np.arange(1, n + 1) / n for n in count])])
    return np.column_stack([np.interp(at, np.arange(len(points)), points[:, k]) for k in range(3)])


def _smoothed(points: Floats, closed: bool) -> Floats:
    """Even out the steps of a polyline: two passes of the (1, 2, 1) mean, ends held."""
    keep = np.r_[True, (np.diff(points, axis=0) != 0).any(axis=1)]
    points = points[keep]
    for _ in range(2):
        if len(points) < 4:
            break
        if closed:
            ring = points[:-1]
            ring = 0.25 * np.roll(ring, 1, axis=0) + 0.5 * ring + 0.25 * np.roll(ring, -1, axis=0)
            points = np.vstack([ring, ring[:1]])
        else:
            points = np.vstack([points[:1], 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:], points[-1:]])
    return points


def _even(points: Floats, h: float) -> Floats:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = int(np.clip(np.ceil(length[-1] / h), 6, _MOST))
    at = np.linspace(0.0, length[-1], count + 1)
    return np.column_stack([np.interp(at, length, points[:, k]) for k in range(3)])


def _directions(points: Floats, closed: bool) -> Floats:
    if len(points) < 2:
        return np.zeros_like(points)
    if closed and len(points) > 3:
        ring = points[:-1]
        steps = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
        return unit(np.vstack([steps, steps[:1]]))
    return unit(np.gradient(points, axis=0))


def _faired(points: Floats, closed: bool, h: float) -> Floats:
    """Lay a smooth curve through points of which no surface tells where exactly they belong."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if len(points) < 6 or (np.diff(length) <= 0).any():
        return points
    faired = fit_curve(points, length, tolerance=0.8 * h, closed=closed)(length)
    if closed:
        faired[-1] = faired[0]
    return faired


def _ordered(points: Floats, along: Floats, closed: bool, h: float) -> Floats:
    """Leave out points that do not go forward along the border; both ends stay.

    Those of an open border are followed from its middle, since its ends are where the mesh may turn back for a step or two.
    """
    if len(points) < 3:
        return points
    step = max(0.2 * float(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))), 1e-6 * h)
    middle = 0 if closed else len(points) // 2
    after = _forward(points[middle:], along[middle:], step)
    before = _forward(points[middle::-1], -along[middle::-1], step)
    points = np.vstack([points[middle - np.array(before[:0:-1], int)], points[middle + np.array(after, int)]])
    if closed:
        points[-1] = points[0]
    return points


def _forward(points: Floats, along: Floats, step: float) -> list[int]:
    """Return the points, from the first to the last, of which each lies ahead of the one before."""
    kept = [0]
    for k in range(1, len(points)):
        if (points[k] - points[kept[-1]]) @ (along[k] + along[kept[-1]]) * 0.5 > step:
            kept.append(k)
    last = len(points) - 1
    while len(kept) > 1 and (points[last] - points[kept[-1]]) @ along[kept[-1]] <= step:
        kept.pop()
    return [*kept, last] if last else kept


def _place_vertices(
    borders: Sequence[Border],
    guides: Sequence[_Guide],
    vertices: Floats,
    shapes: Sequence[Shape],
    h: float,
    known: Known,
    held: Collection[int],
) -> Floats:
    """Move each vertex to where the surfaces around it meet; lines of contact and drawn curves decide what they leave open."""
    ends: list[list[tuple[int, int]]] = [[] for _ in range(len(vertices))]
    for k, border in enumerate(borders):
        if border.vertices[0] >= 0:
            ends[border.vertices[0]].append((k, 0))
            ends[border.vertices[1]].append((k, -1))
    placed = np.array(vertices, np.float64).reshape(-1, 3)
    for v, meet in enumerate(ends):
        around = sorted({f for k, _ in meet for f in borders[k].faces if f >= 0})
        if around and v not in held:
            given = (placed[v], [shapes[f] for f in around], [guides[k] for k, _ in meet], h)
            placed[v] = known(("vertex", given[0].tobytes(), *given[1], *given[2]), lambda g=given: _placed(*g))
    return placed


def _placed(start: Floats, shapes: list[Shape], guides: list[_Guide], h: float) -> Floats:
    vague = [guide for guide in guides if guide.mode < 2]
    prior = _PRIOR[max(guide.caution for guide in guides)]
    found = start
    # Surfaces that hardly meet would carry the vertex far away: it is then held more firmly. But where the vertex is far from one of
    # them, as at the rim of a scan, between whose points there may be gaps, it has to go as far as surfaces at right angles ask for.
    apart = max(float(np.abs(shape.distance(start[None])[0])) for shape in shapes)
    farthest = max(_DRIFT * h, np.sqrt(len(shapes)) * apart)
    for firm in (prior, 0.1, 0.3, 1.0):
        found = _vertex(start, shapes, vague, h, max(firm, prior))
        if np.linalg.norm(found - start) <= farthest:
            break
    return found


def _vertex(start: Floats, shapes: list[Shape], guides: list[_Guide], h: float, prior: float) -> Floats:
    at = start.copy()
    for _ in range(12):
        rows, right = [prior * np.eye(3)], [prior * (start - at)]
        for shape in shapes:
            distance, normal = shape.distance_and_normal(at[None])
            rows.append(normal)
            right.append(-distance)
        for guide in guides:
            near = int(np.argmin(np.linalg.norm(guide.points - at, axis=1)))
            across = unit(cross(guide.meeting.shapes[0].normal(at[None]), guide.along[near : near + 1]))[0]
            # A line of contact that ends aside of its vertex would hook across its neighbours to get there.
            weight = max(_CONTACT, _FIRM * prior) if guide.mode == 1 else _GUIDE
            rows.append(weight * across[None])
            right.append(np.array([weight * across @ (guide.points[near] - at)]))
        step = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
        step *= min(1.0, h / max(float(np.linalg.norm(step)), 1e-300))
        at = at + step
        if np.linalg.norm(step) < 1e-12 * h:
            break
    return at


def _lay(border: Border, guide: _Guide, vertices: Floats, h: float) -> BorderCurve:
    closed = border.vertices[0] < 0
    points = guide.points
    if not closed:
        first, last = _ends(guide, vertices[list(border.vertices)], h)
        if border.vertices[0] != border.vertices[1] and np.linalg.norm(last - first) < _SHORTEST * h:
            first, last = border.points[0], border.points[-1]
        points = _between(guide, first, last)
    points = _distinct(points, h)
    curve = simple_curve(points, closed, _SIMPLE[guide.mode] * h, _keep_end(guide) * h) if guide.caution < 2 else None
    if curve is None:
        # A loop that folds back on itself may be thinned to equal points.
        curve = lay_curve(_distinct(_thinned(points, 2.0 * h), h), closed=closed, tolerance=_STRAY[guide.mode] * h, draw=_drawing(guide))
    samples = curve(curve.samples(64))
    sine = float(np.median(guide.meeting.sine(samples)))
    angle = 180.0 if min(border.faces) < 0 else float(np.degrees(np.arcsin(min(sine, 1.0))))
    gap = float(guide.meeting.gap(samples).max())
    return BorderCurve(curve, border.faces, border.vertices, MODES[guide.mode], gap, angle)


def _drawing(guide: _Guide) -> Any:
    if guide.mode == 2:
        return lambda points: guide.meeting.cross(points)[0]
    if guide.mode == 0:
        return guide.meeting.middle

    def touch(points: Floats) -> Floats:
        near = np.argmin(np.linalg.norm(points[:, None] - guide.points[None], axis=2), axis=1)
        return guide.meeting.touch(points, guide.along[near])[0]

    return touch


def _ends(guide: _Guide, vertices: Floats, h: float) -> Floats:
    """Return where the border's curve ends at its vertices: on the border if that is near, else in the vertex itself."""
    drawn = _drawing(guide)(vertices)
    return np.where((np.linalg.norm(drawn - vertices, axis=1) <= _keep_end(guide) * h)[:, None], drawn, vertices)


def _keep_end(guide: _Guide) -> float:
    """Return how far, in h, a curve may end from its vertex: where a face failed it ends there, lest neighbours cross before they meet."""
    return 1e-3 if guide.caution else _KEEP_END


def _between(guide: _Guide, first: Floats, last: Floats) -> Floats:
    """Return the points between two ends that may lie before or beyond the guide's."""
    points, along = guide.points, guide.along
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    kept = np.ones(len(points), bool)
    kept[[0, -1]] = False
    reach = max(6.0 * guide.meeting.h, 2.0 * guide.spacing)
    margin = 0.5 * guide.spacing
    ahead = ((points - first) * along).sum(axis=1)
    behind = ((last - points) * along).sum(axis=1)
    near_first = (length <= reach) & (np.linalg.norm(points - first, axis=1) <= reach)
    near_last = (length[-1] - length <= reach) & (np.linalg.norm(points - last, axis=1) <= reach)
    kept &= ~(near_first & (ahead <= margin)) & ~(near_last & (behind <= margin))
    inner, steps = points[kept], along[kept]
    # An end that lies aside of the way would be reached by a hook: the last points give way for a smooth turn.
    for end, sign in ((first, 1.0), (last, -1.0)):
        for _ in range(len(inner) // 3):
            k = 0 if sign > 0 else -1
            way = sign * (inner[k] - end)
            if way @ steps[k] >= _AIM * np.linalg.norm(way):
                break
            inner, steps = (inner[1:], steps[1:]) if sign > 0 else (inner[:-1], steps[:-1])
    return np.vstack([first, inner, last])


def _distinct(points: Floats, h: float) -> Floats:
    """Leave out points that repeat the one before them, or the last; the ends stay, moved apart if they are all there is."""
    # First those at the end: a loop that passes through it leaves a point twice in a row when that is taken away.
    kept = np.linalg.norm(points - points[-1], axis=1) > 1e-3 * h
    kept[[0, -1]] = True
    points = points[kept]
    kept = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-3 * h]
    kept[-1] = True
    points = points[kept]
    if len(points) == 2 and np.linalg.norm(points[1] - points[0]) <= 1e-3 * h:
        points = points + np.array([[-0.5], [0.5]]) * _SHORTEST * h / np.sqrt(3.0)
    return points


def _thinned(points: Floats, spacing: float) -> Floats:
    """Return every so many points, so that they lie about `spacing` apart, the ends and at least two points between them included."""
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    count = max(4, int(length / spacing) + 1)
    if len(points) <= count + 1:
        return points
    return points[np.unique(np.round(np.linspace(0, len(points) - 1, count + 1)).astype(int))]
