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
    """

    surface: BSplineSurface
    loops: tuple[TrimLoop, ...]
    inside: NDArray[np.bool_]
    outline: Outline


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
    inside |= _up_to(loops, points, inside, wide, tree, uv, 3.0 * max(scale.noise, fit.rms, 1e-3 * scale.h), REACH * scale.h)
    every = np.concatenate([loop.uv for loop in loops])
    spare = 0.1 * scale.h / lengths
    return Trim(extend(fit.surface, every.min(axis=0) - spare, every.max(axis=0) + spare), loops, inside, outline)


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
) -> NDArray[np.bool_]:
    """Find the points between the fitted ones and the outline that lie on the surface."""
    others = np.flatnonzero(~inside)
    feet, near = _stand(surface, tree, uv, points[others], reach)
    on = feet.distance <= height
    others, at = others[near[on]], feet.uv[on]
    within = np.zeros(len(at), bool)
    if all(loop.closed for loop in loops):
        for loop in loops:
            within ^= in_polygon(at, loop.uv)
    else:
        # Around a tube there is no polygon to be in; what lies on the surface next to a fitted point belongs to it.
        within[:] = True
    found = np.zeros(len(points), bool)
    found[others[within]] = True
    return found
