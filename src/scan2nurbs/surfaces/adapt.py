"""The loop of the fit: solve, find foot points, weigh, insert knots where the residuals are not noise."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.surfaces.axis import Axis
from scan2nurbs.surfaces.parametrize import Parameters
from scan2nurbs.surfaces.prune import prune
from scan2nurbs.surfaces.residuals import Weighing, systematic, weigh
from scan2nurbs.surfaces.solve import Spline, fit_spline

if TYPE_CHECKING:
    from scan2nurbs.surfaces.fit import FitParams

logger = logging.getLogger(__name__)

_STEPS = 4
_POINTS_PER_COEFFICIENT = 8.0
_POINTS_PER_FIRST_COEFFICIENT = 4.0
_NARROWEST_SPAN = 1.5
_TOLERANCE_OF_NOISE = 0.5
_TOLERANCE_OF_SPACING = 0.03
_WEIGHT_FLOOR = 0.02
_SLACK = 0.05
_FAR = 10.0
_MISSES = "The surface misses the tolerance in places"
# 60 degrees: rougher than any noise makes the normals of nodes.
_FOLDED_COSINE = 0.5


@dataclass(frozen=True)
class Task:
    """What is to be fitted: the (sampled) points in units of their extent, their parameters, and the bounds that follow from them."""

    points: NDArray[np.float64]
    parameters: Parameters
    degrees: tuple[int, int]
    smoothness: float
    tolerance: float | None
    noise: float | None
    spacing: float
    most_control_points: int
    most_rounds: int
    robust: bool

    @classmethod
    def make(cls, points: NDArray[np.float64], parameters: Parameters, params: FitParams, scale: float, n_all: int) -> Task:
        """Turn the user's parameters into the units of the fit."""
        affordable = min(params.max_control_points, max(4, int(len(points) / _POINTS_PER_FIRST_COEFFICIENT)))
        p, q = params.degrees
        while (p + 1) * (q + 1) > affordable and max(p, q) > 1:
            p, q = (p - 1, q) if p >= q else (p, q - 1)
        return cls(
            points=points,
            parameters=parameters,
            degrees=(p, q),
            smoothness=params.smoothness,
            tolerance=None if params.tolerance is None else params.tolerance / scale,
            noise=None if params.noise is None else params.noise / scale,
            spacing=parameters.nodes.spacing * np.sqrt(len(points) / n_all),
            most_control_points=min(params.max_control_points, max((p + 1) * (q + 1), int(len(points) / _POINTS_PER_COEFFICIENT))),
            most_rounds=params.max_iterations,
            robust=params.robust,
        )

    @property
    def size(self) -> tuple[float, float]:
        """Sides of the rectangle of parameters."""
        return self.parameters.size

    def weigh(self, uv: NDArray[np.float64], normal: NDArray[np.float64], whole: NDArray[np.float64], lenience: float = np.inf) -> Weighing:
        """Weigh points; all alike where the fit is not robust."""
        floor = max(_WEIGHT_FLOOR * self.spacing, 0.3 * (self.tolerance or 0.0))
        return weigh(uv, self.size, normal, whole, floor, lenience if self.robust else None)

    def slack(self, u: Axis, v: Axis, noise: float) -> float:
        """Return by how much fairness may raise the sum of squares: little against what noise alone puts into the coefficients."""
        return _SLACK * u.n * v.n * noise**2

    def resolve(self, found: float) -> tuple[float, float]:
        """Return the noise to believe in and the tolerance, both given or from the noise found in the residuals."""
        noise = found if self.noise is None else self.noise
        tolerance = max(_TOLERANCE_OF_NOISE * noise, _TOLERANCE_OF_SPACING * self.spacing) if self.tolerance is None else self.tolerance
        # Residuals rougher than the noise that was given are noise all the same.
        return max(noise, found), tolerance


@dataclass(frozen=True)
class State:
    """A fitted spline with foot points, distances, weights and what they were judged by."""

    spline: Spline
    uv: NDArray[np.float64]
    normal: NDArray[np.float64]
    whole: NDArray[np.float64]
    weights: NDArray[np.float64]
    noise: float
    tolerance: float
    rounds: int
    notes: tuple[str, ...] = ()


def adapt(task: Task, progress: Progress | None) -> State:
    """Fit with as few knots as leave nothing but noise in the residuals."""
    state = _start(task)
    notes: list[str] = []
    for done in range(1, task.most_rounds + 1):
        if progress is not None:
            progress(done, task.most_rounds)
        state = replace(_refit(task, state, state.spline.u, state.spline.v), rounds=done)
        logger.debug(
            "round %d: %d x %d, rms %.3g, noise %.3g (in spacings)",
            done,
            state.spline.u.n,
            state.spline.v.n,
            np.sqrt(np.mean(state.normal**2)) / task.spacing,
            state.noise / task.spacing,
        )
        u, v, bounded = _insert(task, state.spline, *_marks(state))
        if u.n_spans == state.spline.u.n_spans and v.n_spans == state.spline.v.n_spans:
            if bounded:
                notes.append(f"{_MISSES}: there are too few points, or control points allowed, for more knots.")
            break
        state = _refit(task, state, u, v)
    else:
        notes.append(f"{_MISSES}: max_iterations was reached.")
    return replace(_pruned(task, state), notes=tuple(notes))


def _pruned(task: Task, state: State) -> State:
    """Leave out knots as long as neither the sum of squares nor any systematic residual asks for them."""
    best = state
    asked = sum(int(m.sum()) for m in _marks(state))

    def fit_without(u: Axis, v: Axis) -> Spline | None:
        nonlocal best
        found = _refit(task, _refit(task, best, u, v, keep_fairness=True), u, v, keep_fairness=True)
        # The weights of the fuller net judge both, so that a point turned outlier does not pay for a knot.
        rise = float(
            np.sum(best.weights * (np.minimum(found.whole, _FAR * best.noise) ** 2 - np.minimum(best.whole, _FAR * best.noise) ** 2))
        )
        freed = best.spline.u.n * best.spline.v.n - u.n * v.n
        fair = rise <= 2.0 * best.noise**2 * freed or rise <= 0.002 * best.tolerance**2 * float(best.weights.sum())
        if not fair or sum(int(m.sum()) for m in _marks(found)) > asked:
            return None
        best = replace(found, noise=best.noise, tolerance=best.tolerance)
        return best.spline

    prune(state.spline, float(state.weights.sum()), max(state.noise, 0.1 * state.tolerance), fit_without)
    return best


def _marks(state: State) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    return systematic(state.spline.u, state.spline.v, state.uv, state.normal, state.weights, state.noise, state.tolerance)


def settle(task: Task, state: State, points: NDArray[np.float64], uv: NDArray[np.float64]) -> State:
    """Fit the knots found to all points, until foot points and weights agree with the surface."""
    u, v = state.spline.u, state.spline.v
    uv, normal, whole = state.spline.foot_points(points, uv, 2 * _STEPS)
    # A surface that has settled has no regions left to wait for: what deviates now is a neighbouring face or worse.
    lenience = np.inf if state.notes else 1.25
    before, spline, decade = np.inf, state.spline, None
    for _ in range(5):
        weights = task.weigh(uv, normal, whole, lenience).weights
        spline = fit_spline(u, v, uv, points, weights, task.smoothness, task.slack(u, v, state.noise), decade)
        decade = spline.decade
        uv, normal, whole = spline.foot_points(points, uv, _STEPS)
        rms = float(np.sqrt(np.average(normal**2, weights=weights)))
        if abs(before - rms) <= 1e-3 * rms:
            break
        before = rms
    weighing = task.weigh(uv, normal, whole, lenience)
    noise, tolerance = task.resolve(weighing.noise)
    return replace(state, spline=spline, uv=uv, normal=normal, whole=whole, weights=weighing.weights, noise=noise, tolerance=tolerance)


def folds(parameters: Parameters, spline: Spline) -> tuple[str, ...]:
    """Compare the surface's normals with those that the points have by themselves; return a warning where some are turned over.

    Raises
    ------
    NoResultError
        If the surface is folded or crumpled over a tenth of the points.
    """
    nodes = parameters.nodes
    uv = np.clip(parameters.node_uv, 0.0, parameters.size)
    uv, _, whole = spline.foot_points(nodes.points, uv, 4 * _STEPS)
    on = whole <= max(2.0 * nodes.spacing, 3.0 * float(np.median(whole)))
    d = spline.derivatives(uv[on], 1)
    normals = np.cross(d[:, 1], d[:, 2])
    area = np.linalg.norm(normals, axis=1)
    cosine = np.einsum("ni,ni->n", normals, nodes.normals[on]) / np.maximum(area, 1e-300)
    cosine = cosine if cosine.sum() >= 0 else -cosine
    bad = float(np.mean((cosine < _FOLDED_COSINE) | (area < 1e-3 * np.median(area))))
    if bad > 0.1 or np.mean(on) < 0.8:
        share = max(bad, 1.0 - float(np.mean(on)))
        raise NoResultError(
            f"The points are no single smooth sheet: the surface is folded or misses them at {share:.0%} of the places checked."
        )
    if bad > 0.01:
        return (f"The surface leans away from the points' own normals at {bad:.1%} of the places checked: look for creases or folds.",)
    return ()


def _start(task: Task) -> State:
    """Fit a coarse net at the first parameters; refine it evenly until foot points can be trusted."""
    size, parameters = task.size, task.parameters
    short = min(size)
    counts = [int(np.clip(round(s / short), 1, 64)) for s in size]
    if parameters.closed:
        counts[0] = max(counts[0], 2 * task.degrees[0] + 1)
    while (
        (counts[0] + task.degrees[0]) * (counts[1] + task.degrees[1]) > task.most_control_points
        and max(counts) > 1
        and not parameters.closed
    ):
        counts[int(np.argmax(counts))] -= 1
    weights = np.ones(len(task.points))
    while True:
        u = Axis(task.degrees[0], np.linspace(0.0, size[0], counts[0] + 1), parameters.closed)
        v = Axis(task.degrees[1], np.linspace(0.0, size[1], counts[1] + 1))
        spline = fit_spline(u, v, parameters.uv, task.points, weights, task.smoothness)
        off = np.linalg.norm(spline.derivatives(parameters.uv, 0)[:, 0] - task.points, axis=1)
        # Iterating a fit to a few points' outliers is not needed: the median says whether the shape is there.
        trusted = np.quantile(off, 0.9) < max(0.03 * short, 2.0 * task.spacing)
        finer = (2 * counts[0] + task.degrees[0]) * (2 * counts[1] + task.degrees[1])
        if trusted or finer > task.most_control_points or max(counts) >= 128:
            break
        counts = [2 * c for c in counts]
        weights = np.where(off <= max(6.0 * float(np.median(off)), task.spacing), 1.0, 0.0) if task.robust else weights
    uv, normal, whole = spline.foot_points(task.points, parameters.uv, 2 * _STEPS)
    weighing = task.weigh(uv, normal, whole)
    noise, tolerance = task.resolve(weighing.noise)
    return State(spline, uv, normal, whole, weighing.weights, noise, tolerance, 0)


def _refit(task: Task, state: State, u: Axis, v: Axis, keep_fairness: bool = False) -> State:
    # Fairness is chosen once for a net.
    known = state.spline.decade if keep_fairness or (u is state.spline.u and v is state.spline.v) else None
    spline = fit_spline(u, v, state.uv, task.points, state.weights, task.smoothness, task.slack(u, v, state.noise), known)
    uv, normal, whole = spline.foot_points(task.points, state.uv, _STEPS)
    weighing = task.weigh(uv, normal, whole)
    noise, tolerance = task.resolve(weighing.noise)
    return replace(state, spline=spline, uv=uv, normal=normal, whole=whole, weights=weighing.weights, noise=noise, tolerance=tolerance)


def _insert(task: Task, spline: Spline, mark_u: NDArray[np.bool_], mark_v: NDArray[np.bool_]) -> tuple[Axis, Axis, bool]:
    """Halve the marked spans as far as points and bounds allow; tell whether something was left undone."""
    narrow = 2.0 * _NARROWEST_SPAN * task.spacing
    wide_u, wide_v = np.diff(spline.u.breaks) > narrow, np.diff(spline.v.breaks) > narrow
    bounded = bool((mark_u & ~wide_u).any() or (mark_v & ~wide_v).any())
    u, v = spline.u.split(mark_u & wide_u), spline.v.split(mark_v & wide_v)
    if u.n * v.n <= task.most_control_points:
        return u, v, bounded
    for a, b in ((u, spline.v), (spline.u, v)):
        if a.n * b.n <= task.most_control_points and (a.n, b.n) != (spline.u.n, spline.v.n):
            return a, b, True
    return spline.u, spline.v, True
