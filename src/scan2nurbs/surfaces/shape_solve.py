"""Orthogonal-distance least squares for primitives, robust by Tukey's biweight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scan2nurbs.kernels.shapes import distances_range, minimise, normal_equations
from scan2nurbs.surfaces.shape import Floats
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, from_pose, pose

TUKEY = 4.685  # 95 % efficient under Gaussian noise


class Solution(NamedTuple):
    """A primitive, its cost Σ w·ρ(d), and the information matrix Σ w·gᵀg of its parameters with the gradient ½∂cost."""

    shape: Primitive
    cost: float
    information: Floats
    gradient: Floats


def distances(shape: Primitive, points: Floats) -> Floats:
    """Return the signed distances (N,) of points (N, 3)."""
    out = np.empty(len(points))
    distances_range(points, *pose(shape), 0, len(points), out)
    return out


def accumulate(shape: Primitive, points: Floats, weights: Floats, cut: float) -> Solution:
    """Return the normal equations at a shape."""
    matrix, columns = np.empty((8, 8)), COLUMNS[shape.kind]
    cost = normal_equations(points, weights, *pose(shape), cut, matrix)
    upper = matrix[np.ix_(columns, columns)]
    return Solution(shape, cost, np.triu(upper) + np.triu(upper, 1).T, matrix[columns, 7])


def improve(shape: Primitive, points: Floats, weights: Floats, cut: float, rounds: int, least: float) -> Primitive:
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
        Most steps.
    least : float
        It ends when a step promises to lower the cost by no more than this; in squared lengths.
    """
    kind, frame, a, b = pose(shape)
    best = np.empty(14)
    anchor = points[np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1))]
    minimise(points, weights, kind, np.concatenate([frame, [a, b]]), anchor, cut, rounds, least, best)
    return from_pose(shape.kind, best[:12], best[12], best[13])
