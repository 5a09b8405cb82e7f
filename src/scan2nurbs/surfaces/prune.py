"""Take out knots that the points do not need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.surfaces.axis import Axis
from scan2nurbs.surfaces.solve import Spline

Check = Callable[[Axis, Axis], Spline | None]

_TRIES = 12


def prune(spline: Spline, points_weight: float, noise: float, fit_without: Check) -> None:
    """Propose smaller and smaller sets of knots to leave out, cheapest first, until none is accepted.

    Parameters
    ----------
    spline : Spline
        Where to begin.
    points_weight : float
        Sum of the points' weights.
    noise : float
        Standard deviation of the points; a knot is a candidate where leaving it out costs less than the noise it lets in (Mallows' Cp).
    fit_without : callable
        Fits on the given axes; returns the spline when it is good enough, else None.
    """
    share = 1.0
    for _ in range(_TRIES):
        costs = [
            removal_costs(spline.u, spline.v, spline.control, points_weight),
            removal_costs(spline.v, spline.u, spline.control.transpose(1, 0, 2), points_weight),
        ]
        limits = [4.0 * noise**2 * spline.v.n, 4.0 * noise**2 * spline.u.n]
        chosen = [_apart(cost, limit) for cost, limit in zip(costs, limits, strict=True)]
        ranked = sorted((costs[side][k] / limits[side], side, k) for side in (0, 1) for k in chosen[side])
        if not ranked:
            return
        taken = ranked[: max(1, round(share * len(ranked)))]
        u = _without(spline.u, [k for _, side, k in taken if side == 0])
        v = _without(spline.v, [k for _, side, k in taken if side == 1])
        found = fit_without(u, v)
        if found is not None:
            spline, share = found, min(1.0, 2.0 * share)
        elif len(taken) == 1:
            return
        else:
            share *= 0.3


def removal_costs(along: Axis, across: Axis, control: NDArray[np.float64], points_weight: float) -> NDArray[np.float64]:
    """Estimate by how much leaving out each inner break would raise the sum of squares, were the points spread evenly.

    Leaving out a knot confines the coefficients to a subspace with one normal d a row of the net; the nearest surface in it lies
    dᵀC / (dᵀ G⁻¹ d) away in the metric G of the functions' integrals.

    Returns
    -------
    (m + 1,) float64
        Infinite for the borders and for what cannot be left out.
    """
    costs = np.full(len(along.breaks), np.inf)
    if along.closed and along.n <= 2 * along.degree + 1:
        return costs
    gram_u, gram_v = _gram(along), _gram(across)
    inner = range(0 if along.closed else 1, along.n_spans)
    density = points_weight / (along.n_spans * across.n_spans)
    for k in inner:
        if along.closed and k == 0:
            continue
        normal = _normal_of(along, k)
        x = np.einsum("i,ijc->jc", normal, control)
        costs[k] = density * np.einsum("jc,jk,kc->", x, gram_v, x) / (normal @ np.linalg.solve(gram_u, normal))
    return costs


def _normal_of(axis: Axis, k: int) -> NDArray[np.float64]:
    """Return the coefficients' functional that vanishes on all splines without break k: the jump of the highest derivative there."""
    p = axis.degree
    eps = np.diff(axis.breaks)[[k - 1, k]] * 1e-3
    place = axis.breaks[k] + np.array([-eps[0], eps[1]])
    jump = np.zeros(axis.n)
    for side, u in zip((-1.0, 1.0), place, strict=True):
        span = int(np.searchsorted(axis.knots, u, side="right") - 1)
        for a, value in enumerate(_top_derivative(axis.knots, p, span)):
            jump[(span - p + a) % axis.n] += side * value
    return jump / np.abs(jump).max()


def _top_derivative(knots: NDArray[np.float64], degree: int, span: int) -> NDArray[np.float64]:
    """Return the derivative of order `degree` of the functions on a span, where it is constant (The NURBS Book, eq. 2.9)."""
    values = np.zeros(degree + 1)
    values[0] = 1.0
    for d in range(1, degree + 1):
        lower = values[:d].copy()
        left = 0.0
        for a in range(d + 1):
            i = span - d + a
            right = lower[a] / (knots[i + d + 1] - knots[i + 1]) if a < d else 0.0
            values[a] = d * (left - right)
            left = right
    return values


def _gram(axis: Axis) -> NDArray[np.float64]:
    gram = np.zeros((axis.n, axis.n))
    functions = axis.span_functions
    np.add.at(gram, (functions[:, :, None], functions[:, None, :]), axis.span_integrals[:, 0])
    return gram


def _apart(costs: NDArray[np.float64], limit: float) -> list[int]:
    """Return candidates below the limit, cheapest first, no two of them neighbours: their costs hold one at a time."""
    chosen: list[int] = []
    for k in np.argsort(costs, kind="stable"):
        if costs[k] >= limit:
            break
        if all(abs(int(k) - other) > 1 for other in chosen):
            chosen.append(int(k))
    return chosen


def _without(axis: Axis, which: list[int]) -> Axis:
    if axis.closed:
        which = which[: max(0, axis.n - 2 * axis.degree - 1)]
    return Axis(axis.degree, np.delete(axis.breaks, which), axis.closed)
