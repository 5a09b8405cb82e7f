"""Fit plane, cylinder, cone, sphere or torus to points: multi-start, then robust orthogonal-distance least squares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.shape import Floats, Kind, inverse
from scan2nurbs.surfaces.shape_parameters import COLUMNS, Primitive, lengths, pose, recentred, scaled, uncertainty
from scan2nurbs.surfaces.shape_result import ShapeFit
from scan2nurbs.surfaces.shape_solve import TUKEY, Solution, accumulate, distances, improve
from scan2nurbs.surfaces.shape_start import starting_values
from scan2nurbs.surfaces.torus_start import tube_torus

_SAMPLE = 600
# Mean absolute distance, in standard deviations, under which a start is good enough: 0.8 is that of Gaussian noise.
_EXPLAINED = 0.9
_THINNEST = 3.0  # least radius, in standard deviations of the points
# A fit has settled when a step would lower χ² by no more: steps of a few hundredths of a standard deviation are left.
_SETTLED = 1e-3


def fit_primitive(
    kind: Kind, points: Floats, *, noise: float, normals: Floats | None, start: Primitive | None, weights: Floats
) -> ShapeFit:
    """Fit a primitive; see `shape_fit.fit_shape`."""
    freedom = len(COLUMNS[kind])
    if len(points) < freedom:
        raise NoResultError(f"{len(points)} points do not determine a {kind}: it takes {freedom} at least.")
    middle, extent = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    if not extent > 0.0:
        raise NoResultError(f"The points coincide; they do not determine a {kind}.")
    local = np.ascontiguousarray((points - middle) / extent)
    sigma = max(noise / extent, 1e-9)
    begin = scaled(start, -middle, 1.0 / extent) if start is not None else None
    solution = _solve(kind, local, sigma, normals, begin, weights)
    _require_determined(solution, local, sigma)
    shape = solution.shape
    size = np.where(lengths(kind), extent, 1.0)
    covariance = sigma**2 * inverse(solution.information) * np.outer(size, size)
    d = distances(shape, local)
    on = weights * (np.abs(d) <= TUKEY * max(sigma, 1.4826 * float(np.median(np.abs(d)))))
    return ShapeFit(
        shape=scaled(shape, np.zeros(3), extent, middle),
        n_points=len(points),
        rms=weighted_rms(d, on) * extent,
        covariance=covariance,
        criterion=criterion(d / sigma, weights, freedom),
    )


def weighted_rms(d: Floats, weights: Floats) -> float:
    """Return the root of the weighted mean square of N distances; by a sum that, unlike a product of BLAS, no number of threads changes."""
    return float(np.sqrt(np.sum(weights * d**2) / max(weights.sum(), 1e-300)))


def criterion(d: Floats, weights: Floats, freedom: int) -> float:
    """Return Σ w·ρ(d) + freedom · log n of distances in standard deviations; lower is better (Schwarz 1978, with Tukey's ρ)."""
    inside = np.maximum(1.0 - (d / TUKEY) ** 2, 0.0)
    return float(np.sum(weights * (1.0 - inside**3))) * TUKEY**2 / 3.0 + freedom * float(np.log(len(d)))


def _solve(kind: Kind, points: Floats, sigma: float, normals: Floats | None, start: Primitive | None, weights: Floats) -> Solution:
    """Start from a sample, then anneal Tukey's cut over all points."""
    sample = np.arange(0, len(points), -(-len(points) // _SAMPLE))
    few, light = np.ascontiguousarray(points[sample]), np.ascontiguousarray(weights[sample])
    middle = np.zeros(3)
    shape, best = start, np.inf
    for k, group in enumerate([] if start is not None else _starts(kind, points, sample, normals, sigma)):
        for begin in group:
            near = recentred(begin, middle)
            tried = improve(near, few, light, _cut(near, few, sigma, 9.0), 15, 0.1 * sigma**2)
            cost = float(light @ np.minimum(np.abs(distances(tried, few)) / sigma, TUKEY)) / max(light.sum(), 1e-300)
            if cost < best:
                best, shape = cost, tried
        # Narrow pieces of a torus look like many a shape.
        if best < _EXPLAINED and (kind != "torus" or k > 0):
            break
    if shape is None:
        raise NoResultError(f"The points suggest no {kind} to start from.")
    shape = recentred(improve(shape, few, light, _cut(shape, few, sigma, 9.0), 20, 0.1 * sigma**2), middle)
    before = cut = np.inf
    for _ in range(4):
        # The sample took the fit to where a few steps over all points end it.
        before, cut = cut, _cut(shape, points, sigma, TUKEY)
        if cut > 0.999 * before:
            break
        shape = recentred(improve(shape, points, weights, cut, 30, _SETTLED * sigma**2), middle)
    return accumulate(shape, points, weights, min(cut, before))


def _starts(kind: Kind, points: Floats, sample: NDArray[np.int64], normals: Floats | None, sigma: float) -> Iterator[Sequence[Primitive]]:
    yield from starting_values(kind, points, sample, normals)
    if kind == "torus":
        yield [t for t in (tube_torus(points, sigma, share) for share in (0.1, 0.03)) if t is not None]


def _cut(shape: Primitive, points: Floats, sigma: float, factor: float) -> float:
    return factor * max(sigma, 1.4826 * float(np.median(np.abs(distances(shape, points)))))


def _require_determined(solution: Solution, points: Floats, sigma: float) -> None:
    """Raise where the parameters are not determined by the points at their noise."""
    shape, kind = solution.shape, solution.shape.kind
    scale = np.sqrt(np.maximum(np.diag(solution.information), 1e-300))
    values = np.linalg.eigvalsh(solution.information / np.outer(scale, scale))
    if not (np.isfinite(values).all() and values[0] > 1e-13 * values[-1]):
        raise NoResultError(f"The points do not determine a {kind}: its parameters depend on each other.")
    known = uncertainty(shape, sigma**2 * inverse(solution.information))
    _, _, a, b = pose(shape)
    smallest = {"plane": np.inf, "cone": np.inf, "torus": b}.get(kind, a)
    if smallest < _THINNEST * sigma:
        raise NoResultError(f"The points do not determine a {kind}: its radius would be lost in their noise.")
    # A radius that may as well be infinite, by three standard deviations of the curvature.
    curved = {"cylinder": "a plane", "sphere": "a plane", "cone": "a plane"}
    if kind in curved and known["radius"] * 3.0 > a:
        raise NoResultError(f"The points do not determine a {kind}: {curved[kind]} explains them within their noise.")
    if kind == "cone" and np.degrees(b) < 3.0 * known["half_angle"]:
        raise NoResultError("The points do not determine a cone: a cylinder explains them within their noise.")
    if kind == "cone" and 90.0 - np.degrees(b) < 3.0 * known["half_angle"]:
        raise NoResultError("The points do not determine a cone: a plane explains them within their noise.")
    if kind == "torus" and known["minor"] * 3.0 > b:
        raise NoResultError("The points do not determine a torus: its tube's radius may be infinite within their noise.")
    if kind == "torus" and known["major"] * 3.0 > a:
        simpler = "a sphere" if a < b else "a cylinder"
        raise NoResultError(f"The points do not determine a torus: {simpler} explains them within their noise.")
