"""Trim a fitted surface: its outline in the parameters of the surface, and which points lie within."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.corrections import in_polygon
from scan2nurbs.faces.outline import Outline, OutlineParams, find_outline
from scan2nurbs.kernels.runner import thread_count
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.extend import extend
from scan2nurbs.surfaces.fit import SurfaceFit
from scan2nurbs.surfaces.project import FootPoints, foot_points

# How near, in h, a point must lie to a fitted one to be judged by the surface: the width of a band of edge points.
REACH = 4.0
# Points this far, in h, outside an outline are no scatter about it.
UNCOVERED = 2.0


@dataclass(frozen=True)
class TrimLoop:
    """A loop in the parameters of the surface.

    Attributes
    ----------
    uv : (K, 2) float64
        In order; the first is not repeated at the end.
    closed : bool
        False for a loop that goes around a tube once and ends a period from where it began.
    corners : (C,) int64
        Rows of `uv` that are sharp corners.
    """

    uv: NDArray[np.float64]
    closed: bool
    corners: NDArray[np.int64]


@dataclass(frozen=True)
class Trim:
    """What a surface is trimmed to.

    Attributes
    ----------
    surface : BSplineSurface
        The fitted surface, extended as far as the outline reaches.
    loops : tuple of TrimLoop
        The outer loop first.
    inside : (N,) bool
        Points of the cloud that belong to the face.
    outline : Outline
        The same loops, in lengths on the surface.
    n_uncovered : int
        Fitted points that lie outside the loops by more than 2 h: what the face misses.
    """

    surface: BSplineSurface
    loops: tuple[TrimLoop, ...]
    inside: NDArray[np.bool_]
    outline: Outline
    n_uncovered: int


def trim_region(
    points: NDArray[np.float64],
    scale: Scale,
    fitted: NDArray[np.int64],
    fit: SurfaceFit,
    boundary: NDArray[np.float64],
    params: OutlineParams | None = None,
) -> Trim:
    """Find the outline of a face on its surface.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    scale : Scale
        What `measure_scale` said of them.
    fitted : (K,) int64
        The points that were fitted.
    fit : SurfaceFit
        The surface through them.
    boundary : (M, 3) float64
        Thinned boundary points; those that lie on the surface draw the outline onto the edge.
    params : OutlineParams, optional

    Raises
    ------
    NoResultError
        If the points cover no area on the surface.
    """
    used = fit.weights > 0
    uv, counted = fit.uv[used], points[fitted[used]]
    tree = KDTree(counted)
    lengths = _lengths(fit, uv)
    # Edges lie up to a band's width outside the fitted points.
    low, high = uv.min(axis=0) - REACH * scale.h / lengths, uv.max(axis=0) + REACH * scale.h / lengths
    wide = extend(fit.surface, low, high)
    near_edge, _ = _stand(wide, tree, uv, boundary, REACH * scale.h)
    on_surface = near_edge.distance <= scale.h + 3.0 * scale.noise
    outline = find_outline(
        uv * lengths,
        spacing=scale.h,
        boundary_uv=near_edge.uv[on_surface] * lengths,
        period=lengths[0] if fit.surface.closed[0] else None,
        params=params,
    )
    loops = tuple(TrimLoop(loop.points / lengths, not np.any(loop.shift), loop.corners) for loop in outline.loops)
    inside = np.zeros(len(points), bool)
    inside[fitted[used]] = True
    period = fit.surface.domain[0][1] - fit.surface.domain[0][0] if fit.surface.closed[0] else None
    inside |= _up_to(loops, points, inside, wide, tree, uv, 3.0 * max(scale.noise, fit.rms, 1e-3 * scale.h), REACH * scale.h, period)
    missed = uv[~within(uv, loops, period)] * lengths
    drawn = np.concatenate([loop.points for loop in outline.loops])
    if period is not None:
        turn = np.array([period * lengths[0], 0.0])
        drawn = np.concatenate([drawn - turn, drawn, drawn + turn])
    n_uncovered = int(np.count_nonzero(KDTree(drawn).query(missed, workers=thread_count())[0] > UNCOVERED * scale.h))
    every = np.concatenate([loop.uv for loop in loops])
    spare = 0.1 * scale.h / lengths
    return Trim(extend(fit.surface, every.min(axis=0) - spare, every.max(axis=0) + spare), loops, inside, outline, n_uncovered)


def within(uv: NDArray[np.float64], loops: tuple[TrimLoop, ...], period: float | None) -> NDArray[np.bool_]:
    """Tell which (N, 2) parameters lie within loops: in an odd number of them.

    On a tube, which repeats after a period of u, a loop around it encloses all that lies on one side of it.
    """
    result = np.zeros(len(uv), bool)
    for loop in loops:
        if period is None:
            result ^= in_polygon(uv, loop.uv)
            continue
        # Unrolled as far as the copies of u in the loop's own period may lie.
        first = loop.uv[:, 0].min()
        u, v = first + np.mod(uv[:, 0] - first, period), uv[:, 1]
        if loop.closed:
            copies = [in_polygon(np.stack([u + turn * period, v], axis=1), loop.uv) for turn in (0, 1)]
            result ^= copies[0] | copies[1]
        else:
            result ^= in_polygon(np.stack([v, u], axis=1), _one_side(loop, period, float(v.max(initial=0.0))))
    return result


def _one_side(loop: TrimLoop, period: float, high: float) -> NDArray[np.float64]:
    """Close a loop around a tube over all v above it: a polygon of (v, u)."""
    turn = period if loop.uv[-1, 0] > loop.uv[0, 0] else -period
    line = np.concatenate([loop.uv + np.array([k * turn, 0.0]) for k in (-2, -1, 0, 1, 2)])[:, ::-1]
    above = max(high, float(line[:, 0].max())) + 1.0
    return np.concatenate([line, [[above, line[-1, 1]], [above, line[0, 1]]]])


def _lengths(fit: SurfaceFit, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what one unit of u and of v is worth in length, on average where the points are."""
    some = uv[:: max(1, len(uv) // 20_000)]
    derivatives = fit.surface.derivatives(some)
    return np.linalg.norm(derivatives[:, 1:3], axis=2).mean(axis=0)


def _stand(
    surface: BSplineSurface, tree: KDTree, uv: NDArray[np.float64], points: NDArray[np.float64], reach: float
) -> tuple[FootPoints, NDArray[np.int64]]:
    """Put the points within reach of a fitted one onto the surface; return their foot points and which they are."""
    distance, nearest = tree.query(points, distance_upper_bound=reach, workers=thread_count())
    near = np.flatnonzero(np.isfinite(distance))
    return foot_points(surface, points[near], uv[np.asarray(nearest)[near]]), near


def _up_to(
    loops: tuple[TrimLoop, ...],
    points: NDArray[np.float64],
    inside: NDArray[np.bool_],
    surface: BSplineSurface,
    tree: KDTree,
    uv: NDArray[np.float64],
    height: float,
    reach: float,
    period: float | None,
) -> NDArray[np.bool_]:
    """Find the points between the fitted ones and the outline that lie on the surface."""
    others = np.flatnonzero(~inside)
    feet, near = _stand(surface, tree, uv, points[others], reach)
    on = feet.distance <= height
    others = others[near[on]]
    found = np.zeros(len(points), bool)
    found[others[within(feet.uv[on], loops, period)]] = True
    return found
