"""Find relations that hold between the primitives of a part within their uncertainty, by Wald tests."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from scan2nurbs.scale import chi2_quantile
from scan2nurbs.surfaces.constraints import (
    ANGLE,
    Equations,
    Values,
    coaxial,
    coplanar,
    equal_radius,
    evaluate,
    on_axis,
    parallel,
    perpendicular,
    tangencies,
)
from scan2nurbs.surfaces.shape import KINDS, Floats
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive

_PROBABILITY = 0.997
_BEST_KNOWN = np.radians(1.0)  # directions that are known less well would be parallel to many


class Candidate(NamedTuple):
    """A relation between two faces that may be imposed."""

    kind: str
    faces: tuple[int, int]
    equations: Equations


class Known(NamedTuple):
    """A face's primitive, scaled by the part's extent, and the covariance of its parameters."""

    face: int
    shape: Primitive
    covariance: Floats


class Floors(NamedTuple):
    """Differences below which no relation is doubted, however well known the shapes are: radians, and a length over the extent."""

    angle: float
    length: float


def find_relations(known: Sequence[Known], floors: Floors) -> list[Candidate]:
    """Return the relations that hold within the uncertainty of the primitives.

    Notes
    -----
    Members of a group are related to its best known member only, so that a group of n takes n − 1 relations.
    """
    out: list[Candidate] = []
    groups = _groups([k for k in known if _tilt(k) < _BEST_KNOWN], parallel, _tilt, floors)
    for group in groups:
        lines = [k for k in group if k.shape.kind in ("cylinder", "cone", "torus")]
        planes = [k for k in group if k.shape.kind == "plane"]
        nested = [*_groups(lines, coaxial, _place, floors), *_groups(planes, coplanar, _place, floors)]
        for inner in nested:
            kind, equations = ("coplanar", coplanar) if inner[0].shape.kind == "plane" else ("coaxial", coaxial)
            out += [Candidate(kind, (inner[0].face, k.face), equations) for k in inner[1:]]
        # The rest of the group follows its best known member through the best of each line or plane.
        heads = [inner[0] for inner in nested if all(k.face != group[0].face for k in inner)]
        out += [Candidate("parallel", (group[0].face, k.face), parallel) for k in heads]
        out += _centres(nested, known, floors)
    out += _perpendicular(groups, floors)
    for kind in ("cylinder", "sphere", "torus"):
        alike = [k for k in known if k.shape.kind == kind and _radius(k) < 0.1 * _size(k)]
        for group in _groups(alike, equal_radius, _radius, floors):
            out += [Candidate("equal radius", (group[0].face, k.face), equal_radius) for k in group[1:]]
    return out


def find_tangencies(known: Sequence[Known], smooth: Iterable[tuple[int, int]]) -> list[tuple[Candidate, ...]]:
    """Return, for each pair of primitives that meet smoothly, the ways in which they may be tangent."""
    by_face = {k.face: k for k in known}
    out = []
    for pair in smooth:
        if pair[0] in by_face and pair[1] in by_face:
            s, t = sorted((by_face[pair[0]], by_face[pair[1]]), key=lambda k: (KINDS.index(k.shape.kind), k.face))
            out.append(tuple(Candidate("tangent", (s.face, t.face), way) for way in tangencies(s.shape, t.shape)))
    return [ways for ways in out if ways]


def wald(values: Values, first: Known, second: Known, floors: Floors) -> float:
    """Return the Wald statistic of equations, about χ² with as many degrees of freedom as there are equations where they hold."""
    n = len(first.covariance)
    a, b = values.slope[:, :n], values.slope[:, n:]
    floor = np.array([floors.angle if unit == ANGLE else floors.length for unit in values.unit])
    spread = a @ first.covariance @ a.T + b @ second.covariance @ b.T + np.diag(floor**2)
    return float(values.value @ np.linalg.solve(spread, values.value))


def _holds(equations: Equations, first: Known, second: Known, floors: Floors, probability: float = _PROBABILITY) -> float:
    """Return the Wald statistic over its threshold: at most one where the relation holds."""
    values = evaluate(equations, first.shape, second.shape)
    return wald(values, first, second, floors) / chi2_quantile(probability, len(values.value))


def _groups(known: Sequence[Known], equations: Equations, doubt: Callable[[Known], float], floors: Floors) -> list[list[Known]]:
    """Gather what is related to a group's best known member; best known ones first."""
    groups: list[list[Known]] = []
    for k in sorted(known, key=lambda k: (doubt(k), k.face)):
        fits = [(_holds(equations, group[0], k, floors), i) for i, group in enumerate(groups)]
        best = min(fits, default=(np.inf, -1))
        if best[0] <= 1.0:
            groups[best[1]].append(k)
        else:
            groups.append([k])
    return groups


def _tilt(k: Known) -> float:
    """Return the standard deviation of the direction; infinite for a sphere."""
    tilts = np.isin(COLUMNS[k.shape.kind], [3, 4])
    return float(np.sqrt(np.trace(k.covariance[np.ix_(tilts, tilts)]))) if tilts.any() else np.inf


def _place(k: Known) -> float:
    shifts = np.isin(COLUMNS[k.shape.kind], [0, 1, 2])
    return float(np.sqrt(np.trace(k.covariance[np.ix_(shifts, shifts)])))


def _radius(k: Known) -> float:
    column = 6 if k.shape.kind == "torus" else 5
    place = int(np.flatnonzero(COLUMNS[k.shape.kind] == column)[0])
    return float(np.sqrt(k.covariance[place, place]))


def _size(k: Known) -> float:
    return float(k.shape.minor if k.shape.kind == "torus" else k.shape.radius)  # type: ignore[union-attr] - by kind


def _perpendicular(groups: list[list[Known]], floors: Floors) -> list[Candidate]:
    heads = [group[0] for group in groups]
    return [
        Candidate("perpendicular", (s.face, t.face), perpendicular)
        for i, s in enumerate(heads)
        for t in heads[i + 1 :]
        if abs(float(_axis(s) @ _axis(t))) < 0.1 and _holds(perpendicular, s, t, floors) <= 1.0
    ]


def _axis(k: Known) -> Floats:
    return k.shape.direction if k.shape.kind == "plane" else k.shape.axis  # type: ignore[union-attr] - by kind


def _centres(lines: list[list[Known]], known: Sequence[Known], floors: Floors) -> list[Candidate]:
    """Return the spheres whose centres lie on axes."""
    out = []
    for sphere in (k for k in known if k.shape.kind == "sphere" and _place(k) < 0.1 * _size(k)):
        heads = [line[0] for line in lines if line[0].shape.kind != "plane"]
        fits = [(_holds(on_axis, head, sphere, floors), i) for i, head in enumerate(heads)]
        best = min(fits, default=(np.inf, -1))
        if best[0] <= 1.0:
            out.append(Candidate("coaxial", (heads[best[1]].face, sphere.face), on_axis))
    return out
