"""Orthogonal-distance least squares for primitives: Levenberg-Marquardt with Tukey's biweight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scan2nurbs.kernels.shapes import SPHERE, TORUS, distances_range, normal_equations
from scan2nurbs.surfaces.shape import Floats
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, from_pose, moved, pose

TUKEY = 4.685  # 95 % efficient under Gaussian noise
_LARGEST_GROWTH = 3.0


class Solution(NamedTuple):
    """A primitive, its cost Σ w·ρ(d), the sum of the robust weights, and the information matrix Σ w·gᵀg of its parameters."""

    shape: Primitive
    cost: float
    total: float
    square: float
    information: Floats


def distances(shape: Primitive, points: Floats) -> Floats:
    """Return the signed distances (N,) of points (N, 3)."""
    out = np.empty(len(points))
    distances_range(points, *pose(shape), 0, len(points), out)
    return out


def minimise(shape: Primitive, points: Floats, weights: Floats, cut: float, rounds: int) -> Solution:
    """Return the primitive that minimises Σ w·ρ(d), from a start.

    Parameters
    ----------
    shape : Primitive
        Where to start; its point of reference should lie amid the points.
    points : (N, 3) float64
    weights : (N,) float64
    cut : float
        Tukey's cut; infinite for plain least squares.
    rounds : int
        Most evaluations.

    References
    ----------
    D. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963, with the damping update of H. Nielsen, 1999.
    """
    columns = COLUMNS[shape.kind]
    matrix, row = np.empty((8, 8)), np.empty(8)

    def evaluate(at: Primitive) -> Solution:
        cost, total = normal_equations(points, weights, *pose(at), cut, matrix, row)
        full = np.triu(matrix) + np.triu(matrix, 1).T
        return Solution(at, cost, total, float(full[7, 7]), full)

    anchor = points[np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1))][None]
    best = evaluate(shape)
    damping, worse = 1e-3, 2.0
    for _ in range(rounds):
        information, gradient = best.information[np.ix_(columns, columns)], best.information[columns, 7]
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        scaled = information / np.outer(scale, scale)
        step = np.linalg.solve(scaled + damping * np.eye(len(columns)), -gradient / scale)
        expected = float(step @ (damping * step - gradient / scale))
        trial = _step(best.shape, step / scale, anchor)
        found = evaluate(trial) if trial is not None else None
        if found is not None and found.cost < best.cost:
            gain = best.cost - found.cost
            damping = max(damping * max(1.0 / 9.0, 1.0 - (2.0 * min(gain / max(expected, 1e-300), 1.0) - 1.0) ** 3), 1e-12)
            worse = 2.0
            best = found
            if gain <= 1e-9 * best.cost:
                break
        else:
            if expected <= 1e-9 * best.cost:
                break
            damping, worse = min(damping * worse, 1e12), 2.0 * worse
    return best._replace(information=best.information[np.ix_(columns, columns)])


def _step(shape: Primitive, step: Floats, anchor: Floats) -> Primitive | None:
    """Return the shape after a step in which radii change as their curvatures do, with the surface kept where it is at the anchor."""
    kind, frame, a, b = pose(shape)
    step = step.copy()
    if kind in (SPHERE, TORUS) or shape.kind == "cylinder":
        radius, place = (b, -1) if kind == TORUS else (a, len(step) - 1)
        share = step[place] / radius
        grown = 1.0 / (1.0 - share) if share < 1.0 - 1.0 / _LARGEST_GROWTH else _LARGEST_GROWTH
        extra = radius * (grown - 1.0) - step[place]
        normal = shape.normal(anchor)[0]
        step[place] += extra
        shifts = frame[3:].reshape(3, 3)[: 2 if shape.kind == "cylinder" else 3]
        step[: len(shifts)] -= extra * (shifts @ normal)
    new = moved(shape, step)
    _, frame, a, b = pose(new)
    if shape.kind != "plane" and not a > 0.0:
        return None
    if shape.kind == "cone" and not 0.0 < b < 0.5 * np.pi:
        return _turned(new, frame, a, b)
    if kind == TORUS and not b > 0.0:
        return None
    return new


def _turned(shape: Primitive, frame: Floats, a: float, b: float) -> Primitive | None:
    """Return a cone that would narrow along its axis with the axis turned round."""
    if not -0.5 * np.pi < b < 0.0:
        return None
    frame = frame.copy()
    frame[9:] *= -1.0
    return from_pose(shape.kind, frame, a, -b)
