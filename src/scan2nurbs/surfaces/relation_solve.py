"""Fit all primitives of a part at once, under equations between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, bmat, coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu

from scan2nurbs.surfaces.constraints import ANGLE, evaluate
from scan2nurbs.surfaces.relation_search import Candidate, Floors
from scan2nurbs.surfaces.shape import Floats, inverse
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, moved, pose
from scan2nurbs.surfaces.shape_solve import TUKEY, accumulate, distances

_ROUNDS = 18
_PATIENCE = 12  # rounds until the equations are brought to hold wherever the fit is
_MET = 1e-14  # of the extent, and radians
_SETTLED = 1e-3  # of χ²
_SOFT = 1e-8  # keeps equations that follow from each other solvable
_LARGEST = 0.3  # largest step of a radius, as a share of it, and of an angle


class Member(NamedTuple):
    """A face in the joint fit: points of it, scaled by the part's extent, its own noise, and how many points each of them stands for."""

    face: int
    points: Floats
    sigma: float
    share: float = 1.0


class JointFit(NamedTuple):
    """The primitives found, the largest value of an equation, and how many standard deviations each relation pulls."""

    shapes: tuple[Primitive, ...]
    gap: float
    force: Floats


def fit_jointly(shapes: Sequence[Primitive], members: Sequence[Member], relations: Sequence[Candidate], floors: Floors) -> JointFit:
    """Minimise the sum of squares of all faces, each over its noise, under the equations of the relations.

    Notes
    -----
    Gauss-Newton steps on the squares and Newton's on the equations (sequential quadratic programming), which are slightly soft, so that
    equations that follow from each other do no harm. When the fit has settled, a few steps on the equations alone close them.
    """
    current = list(shapes)
    place = {m.face: i for i, m in enumerate(members)}
    starts = np.concatenate([[0], np.cumsum([len(COLUMNS[s.kind]) for s in current])])
    scale, ease, force = np.ones(0), np.ones(0), np.zeros(len(relations))
    gap, projections = np.inf, 0
    for k in range(_ROUNDS):
        systems = [normal_system(shape, member) for shape, member in zip(current, members, strict=True)]
        value, slope, owner, unit = _equations(current, relations, place, starts)
        if k == 0:
            variance = _variance(slope, systems)
            scale = np.sqrt(variance + np.where(unit == ANGLE, floors.angle, floors.length) ** 2)
            ease = variance / scale**2
        before, gap = gap, float(np.abs(value).max(initial=0.0))
        if gap < _MET or (projections > 1 and gap > 0.1 * before):
            break
        rows = csc_array(slope.multiply(1.0 / scale[:, None]))
        step, multipliers, promise = _step(systems, value / scale, rows, projections > 0)
        if projections == 0:
            force[:] = 0.0
            np.maximum.at(force, owner, np.abs(multipliers) * ease)
        if projections > 0 or promise < _SETTLED or k >= _PATIENCE:
            projections += 1
        share = min(1.0, *(room(s, step[starts[i] : starts[i + 1]]) for i, s in enumerate(current)))
        current = [moved(s, share * step[starts[i] : starts[i + 1]]) for i, s in enumerate(current)]
    return JointFit(tuple(current), gap, force)


def normal_system(shape: Primitive, member: Member) -> tuple[Floats, Floats]:
    """Return the normal equations of a face over its noise, kept solvable where its points do not determine it."""
    cut = TUKEY * max(member.sigma, 1.4826 * float(np.median(np.abs(distances(shape, member.points)))))
    found = accumulate(shape, member.points, np.ones(len(member.points)), cut)
    weight = member.share / member.sigma**2
    matrix = found.information * weight
    diagonal = np.diag(matrix)
    matrix[np.diag_indices_from(matrix)] += 1e-9 * diagonal + 1e-9 * diagonal.max() + 1e-30
    return matrix, found.gradient * weight


def _equations(
    shapes: Sequence[Primitive], relations: Sequence[Candidate], place: dict[int, int], starts: NDArray[np.int64]
) -> tuple[Floats, csc_array, NDArray[np.int64], NDArray[np.int64]]:
    """Return all equations' values, slopes, relations and units."""
    values, owner, units = [], [], []
    rows, columns, entries = [], [], []
    n = 0
    for k, relation in enumerate(relations):
        i, j = place[relation.faces[0]], place[relation.faces[1]]
        found = evaluate(relation.equations, shapes[i], shapes[j])
        m = len(found.value)
        at = np.concatenate([np.arange(starts[i], starts[i + 1]), np.arange(starts[j], starts[j + 1])])
        rows.append(np.repeat(np.arange(n, n + m), len(at)))
        columns.append(np.tile(at, m))
        entries.append(found.slope.ravel())
        values.append(found.value)
        owner += [k] * m
        units += found.unit
        n += m
    if n == 0:
        return np.zeros(0), csc_array((0, int(starts[-1]))), np.zeros(0, np.int64), np.zeros(0, np.int64)
    slope = coo_array((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=(n, int(starts[-1])))
    return np.concatenate(values), csc_array(slope), np.array(owner), np.array(units)


def _variance(slope: csc_array, systems: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Return the variance of each equation's value if every face is known as well as by itself."""
    inverses = block_diag([inverse(matrix) for matrix, _ in systems], format="csc")
    return np.asarray(csc_array(slope @ inverses).multiply(slope).sum(axis=1)).ravel()


def _step(systems: Sequence[tuple[Floats, Floats]], value: Floats, slope: csc_array, project: bool) -> tuple[Floats, Floats, float]:
    """Solve the quadratic programme of one step, or only the equations by the least move.

    Returns the step, the multipliers and how far the step moves, in χ². The equations are slightly soft.
    """
    matrix = block_diag([m for m, _ in systems], format="csc")
    gradient = np.concatenate([g for _, g in systems])
    # Parameters in their standard deviations, so that all rows are of order one.
    size = 1.0 / np.sqrt(matrix.diagonal())
    matrix = csc_array(matrix.multiply(size[:, None]).multiply(size[None, :]))
    slope = csc_array(slope.multiply(size[None, :]))
    n, m = len(gradient), len(value)
    system = csc_array(bmat([[matrix, slope.T], [slope, -_SOFT * eye_array(m)]])) if m else matrix
    solution = splu(system).solve(np.concatenate([np.zeros(n) if project else -gradient * size, -value]))
    step = solution[:n]
    return step * size, solution[n:], float(step @ (matrix @ step))


def room(shape: Primitive, step: Floats) -> float:
    """Return the share of a step that keeps radii positive and turns within where they are nearly linear."""
    _, _, a, b = pose(shape)
    full = np.zeros(7)
    full[COLUMNS[shape.kind]] = np.abs(step)
    largest = max(full[3], full[4]) / _LARGEST
    if shape.kind != "plane":
        largest = max(largest, full[5] / (_LARGEST * a))
    if shape.kind in ("cone", "torus"):
        largest = max(largest, full[6] / (_LARGEST * b))
    if shape.kind == "cone":
        largest = max(largest, full[6] / (_LARGEST * (0.5 * np.pi - b)))
    return 1.0 / max(largest, 1.0)
