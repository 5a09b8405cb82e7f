"""Divide regions that took in their narrow neighbours: many points along a sweep show a profile that no small patch shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import MODEL_COST, Sheet, depths, grouped
from scan2nurbs.faces.lost import least_squares_plane
from scan2nurbs.faces.model_shapes import field
from scan2nurbs.faces.unite import contacts
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import CONE, CYLINDER, FREEDOM, PATCH, PLANE, TORUS
from scan2nurbs.kernels.refits import misfit, refit_all
from scan2nurbs.surfaces.shape import Floats, perpendicular, unit

LEAST = 120
"""Fewer points show no profile."""
ACROSS = 0.1
"""Sine by which the normals of a region lean along a sweep that it may come from, root mean square."""
BIN = 0.25
"""Width of a profile's bins, in h."""
NARROWEST = 6
"""Bins of a piece, at least."""
WIDEST = 64
"""Bins of a profile, at most: wider regions have room for normals of their own."""
PER_PIECE = 2.5
"""Half the parameters of a piece: what it costs besides its model, times the logarithm of its points."""
STRAIGHT = 0.05
"""Radians by which normals turn along a profile that counts as straight."""


@dataclass(frozen=True)
class _Sweep:
    """A motion that carries a surface along itself: a rotation about an axis, or a translation along it."""

    point: Floats
    axis: Floats
    turning: bool

    def along(self, points: Floats) -> Floats:
        """Return the unit directions of the motion at points (N, 3)."""
        if not self.turning:
            return np.broadcast_to(self.axis, points.shape)
        return unit(np.cross(self.axis, points - self.point))

    def profile(self, vectors: Floats, points: Floats | None = None) -> Floats:
        """Return positions (N, 2) in the plane across the motion; of directions at `points` where these are given."""
        x, y = perpendicular(self.axis)
        base = vectors - self.point if points is None else vectors
        if not self.turning:
            return np.column_stack([base @ x, base @ y])
        offset = (vectors if points is None else points) - self.point
        radial = offset - (offset @ self.axis)[:, None] * self.axis
        return np.column_stack([np.einsum("ij,ij->i", base, unit(radial)), base @ self.axis])


def split_profiles(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], kinds: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Divide regions along their profile, wherever several surfaces explain it for less than one.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
    models : (M, SIZE) float64
    kinds : (6,) bool
        Kinds that the pieces may have.

    Returns
    -------
    label, models : arrays
        With the models of all pieces but the first of each region appended.

    Notes
    -----
    Ribs, grooves and fillets a few spacings wide lie in their neighbours' noise wherever one looks at a few of their points, but run on
    for many spacings. Where a region comes from a sweep, its points, moved along the sweep into one plane, make one curve. The least
    squares of its pieces, lines and parabolas in the region's own chart, are found by dynamic programming over bins (Bellman 1961), each
    piece at the price of a model.
    """
    label, models = label.copy(), models.copy()
    order, starts = grouped(label, len(models))
    near: dict[int, set[int]] = {}
    for i, j in contacts(label, sheet.neighbours)[0].tolist():
        near.setdefault(i, set()).add(j)
        near.setdefault(j, set()).add(i)
    for region in range(len(models)):
        mine = order[starts[region] : starts[region + 1]]
        if len(mine) < LEAST or int(models[region, 0]) == PATCH:
            continue
        cuts = [_cut(sheet, models[region], mine, sweep) for sweep in _sweeps(models, region, sorted(near.get(region, ())))]
        gain, piece = max(cuts, key=lambda cut: cut[0], default=(0.0, np.zeros(0, np.int32)))
        if gain <= 0.0:
            continue
        fitted, gain = _fitted(sheet, mine, piece, models[region], kinds)
        if gain > 0.0:
            label[mine[piece > 0]] = len(models) - 1 + piece[piece > 0]
            models[region] = fitted[0]
            models = np.vstack([models, fitted[1:]])
    return label, models


def _sweeps(models: NDArray[np.float64], region: int, near: list[int]) -> list[_Sweep]:
    """List the sweeps that a region may come from, by its own surface and its neighbours'."""
    out: list[_Sweep] = []
    flat = []
    for i in (region, *near):
        kind, point, axis = int(models[i, 0]), models[i, 1:4], models[i, 4:7]
        if kind in (CYLINDER, CONE, TORUS):
            out.append(_Sweep(point, axis, turning=True))
        if kind == CYLINDER:
            out.append(_Sweep(point, axis, turning=False))
        if kind == PLANE:
            flat.append(i)
    for a, i in enumerate(flat):
        for j in flat[a + 1 :]:
            edge = np.cross(models[i, 4:7], models[j, 4:7])
            if np.linalg.norm(edge) > 0.3:
                out.append(_Sweep(models[region, 1:4], unit(edge), turning=False))
    kept: list[_Sweep] = []
    for sweep in out:
        if not any(_same(sweep, other) for other in kept):
            kept.append(sweep)
    return kept


def _same(a: _Sweep, b: _Sweep) -> bool:
    if a.turning != b.turning or abs(a.axis @ b.axis) < 0.9998:
        return False
    offset = b.point - a.point
    return not a.turning or float(np.linalg.norm(offset - (offset @ a.axis) * a.axis)) < 0.2


def _cut(sheet: Sheet, model: NDArray[np.float64], mine: NDArray[np.int32], sweep: _Sweep) -> tuple[float, NDArray[np.int32]]:
    """Return what cutting a region's profile saves, and the piece of each of its points."""
    whole = np.zeros(len(mine), np.int32)
    points = sheet.points[mine]
    values = field(model, points)
    off, gradient = values[:, 0], values[:, 1:]
    if np.sqrt(np.mean(np.einsum("ij,ij->i", gradient, sweep.along(points)) ** 2)) > ACROSS:
        return 0.0, whole
    place, normal = sweep.profile(points), unit(sweep.profile(gradient, points))
    s = _along(place, normal)
    bins = ((s - s.min()) / BIN).astype(np.int64)
    if not 2 * NARROWEST <= bins.max() + 1 <= WIDEST:
        return 0.0, whole
    near = np.abs(off) < np.sqrt(2.0 * DISTANCE_CAP) * sheet.sigma
    cost, size = _costs(s[near] - s.min(), off[near] / sheet.sigma, bins[near], int(bins.max()) + 1)
    ends, total = _divided(cost, size)
    if len(ends) < 2:
        return 0.0, whole
    return float(cost[0, -1] - total), np.searchsorted(np.array(ends), bins, side="right").astype(np.int32)


def _along(place: Floats, normal: Floats) -> Floats:
    """Return how far along the profile of the region's own surface points lie."""
    middle = unit(normal.mean(axis=0))
    turn = np.arctan2(middle[0] * normal[:, 1] - middle[1] * normal[:, 0], normal @ middle)
    if np.ptp(turn) < STRAIGHT:
        return place @ np.array([-middle[1], middle[0]])
    spread = normal - normal.mean(axis=0)
    radius = float((spread * (place - place.mean(axis=0))).sum() / max((spread**2).sum(), 1e-300))
    return radius * turn


def _costs(s: Floats, t: Floats, bins: NDArray[np.int64], n: int) -> tuple[Floats, Floats]:
    """Return what the points of every range of bins cost, [first, last], and how many there are."""
    powers = np.stack([s**k for k in range(5)] + [t * s**k for k in range(3)] + [t * t])
    sums = np.stack([np.bincount(bins, weights=row, minlength=n) for row in powers])
    run = np.concatenate([np.zeros((len(sums), 1)), np.cumsum(sums, axis=1)], axis=1)
    first, last = np.triu_indices(n)
    m = run[:, last + 1] - run[:, first]
    size = np.zeros((n, n))
    size[first, last] = m[0]
    best = np.full(len(first), np.inf)
    for degree in (1, 2):
        rows = np.arange(degree + 1)
        matrix = np.moveaxis(m[rows[:, None] + rows[None, :]], 2, 0) + 1e-6 * np.eye(degree + 1)
        right = m[5 : 6 + degree].T
        left = m[8] - np.einsum("ij,ij->i", right, np.linalg.solve(matrix, right[:, :, None])[:, :, 0])
        price = MODEL_COST + (PER_PIECE - 1.0 + 0.5 * degree) * np.log(np.maximum(m[0], 2.0))
        best = np.minimum(best, 0.5 * np.maximum(left, 0.0) + price)
    cost = np.full((n, n), np.inf)
    cost[first, last] = best
    return cost, size


def _divided(cost: Floats, size: Floats) -> tuple[list[int], float]:
    """Return the ends of the pieces, as bins after the last one of each, and their total cost."""
    n = len(cost)
    best, back = np.full(n + 1, np.inf), np.zeros(n + 1, np.int64)
    best[0] = 0.0
    for end in range(NARROWEST, n + 1):
        begin = np.arange(end - NARROWEST + 1)
        totals = np.where(size[begin, end - 1] >= 2 * NARROWEST, best[begin] + cost[begin, end - 1], np.inf)
        k = int(np.argmin(totals))
        best[end], back[end] = totals[k], k
    ends, at = [], n
    if not np.isfinite(best[n]):
        return [], np.inf
    while at > 0:
        ends.append(at)
        at = int(back[at])
    return ends[::-1], float(best[n])


def _fitted(
    sheet: Sheet, mine: NDArray[np.int32], piece: NDArray[np.int32], model: NDArray[np.float64], kinds: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], float]:
    """Fit the pieces of a region; return their models and what they save."""
    label = np.full(len(sheet.points), -1, np.int32)
    label[mine] = piece
    n = int(piece.max()) + 1
    models, values = np.repeat(model[None], n, axis=0), np.empty(n)
    depth = depths(label, sheet.neighbours)
    order, starts = grouped(label, n)
    refit_all(sheet.points, sheet.normals, sheet.neighbours, order, starts, depth, kinds, sheet.sigma, 0, n, models, values)
    if kinds[PLANE]:
        _flattened(sheet, (order, starts), models, values)
    before = misfit(model, sheet.points, mine, len(mine), sheet.sigma) + PER_PIECE * np.log(len(mine))
    return models, float(before - values.sum() - (n - 1) * MODEL_COST)


def _flattened(
    sheet: Sheet, regions: tuple[NDArray[np.int32], NDArray[np.int64]], models: NDArray[np.float64], values: NDArray[np.float64]
) -> None:
    """Let planes take the place of models that explain their points less, in place: normals of a narrow strip start no fit well."""
    order, starts = regions
    for i in range(len(models)):
        mine = order[starts[i] : starts[i + 1]]
        plane = least_squares_plane(sheet.points[mine])
        value = misfit(plane, sheet.points, mine, len(mine), sheet.sigma) + 0.5 * FREEDOM[PLANE] * np.log(len(mine))
        if value < values[i]:
            models[i], values[i] = plane, value
