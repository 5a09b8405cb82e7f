"""Edges followed beyond where they were found: from the ends of strong pieces on, as long as weak evidence goes on in line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.breaks import fit_radius, wedge_evidence
from scan2nurbs.kernels.creases import Wedges, fit_wedges
from scan2nurbs.scale import Scale

# Length of a step and the farthest that a crease may lie off the line, in h; the largest turn of a step.
STEP, ASIDE, BEND = 1.0, 1.2, np.cos(np.radians(30.0))
# Log likelihood ratio asked for on the way: a guided step is one trial, where a search among all splits of all points is many.
WEAK = 2.0
MISSES = 2
# A follower that comes this near to points of another piece, in h, has arrived; so many steps it may take.
ARRIVED, LONGEST = 1.2, 400


def follow_ends(points: NDArray[np.float64], ends: NDArray[np.float64], outward: NDArray[np.float64], scale: Scale) -> NDArray[np.float64]:
    """Follow creases from the ends of pieces.

    Parameters
    ----------
    points : (K, 3) float64
        Points along the pieces found so far.
    ends : (E, 3) float64
        Free ends.
    outward : (E, 3) float64
        Unit directions in which the pieces end.
    scale : Scale
        Spacing, noise and cell index of the cloud.

    Returns
    -------
    (F, 3) float64
        Points along what was found, about a spacing apart.

    Notes
    -----
    Hysteresis along the curve (Canny 1986): a wedge is fitted a step ahead; the step counts where two half-planes explain the points
    better than one curved face, and their crease goes on in line. All ends take their steps together, so that kernels see many at once.
    """
    h, radius = scale.h, fit_radius(scale.noise / scale.h) * scale.h
    place, heading = ends.copy(), outward.copy()
    start = ends.copy()
    tree = KDTree(points)
    active, misses = np.arange(len(ends)), np.zeros(len(ends), np.int64)
    found: list[NDArray[np.float64]] = []
    waiting: list[list[NDArray[np.float64]]] = [[] for _ in ends]
    for _ in range(LONGEST):
        if len(active) == 0:
            break
        target = place[active] + STEP * h * heading[active]
        wedges = fit_wedges(scale.cells, np.ascontiguousarray(target), radius, scale.noise, rounds=2)
        good, along, foot = _in_line(wedges, target, heading[active], radius, scale)
        misses[active] = np.where(good, 0, misses[active] + 1)
        heading[active] = np.where(good[:, None], _unit(heading[active] + along), heading[active])
        place[active] = np.where(good[:, None], foot, target)
        for row, i in enumerate(active):
            waiting[i].append(place[i].copy())
            if good[row]:
                found.extend(waiting[i])
                waiting[i].clear()
        arrived = tree.query(place[active])[0] < ARRIVED * h
        # Near its own end a follower is near points of its own piece.
        arrived &= np.linalg.norm(place[active] - start[active], axis=1) > 3.0 * h
        active = active[(misses[active] <= MISSES) & ~arrived]
    return np.array(found).reshape(-1, 3)


def supported(points: NDArray[np.float64], along: NDArray[np.float64], scale: Scale) -> NDArray[np.bool_]:
    """Tell at which points (K, 3) of curves, of unit directions `along` (K, 3), a crease runs along the curve."""
    radius = fit_radius(scale.noise / scale.h) * scale.h
    wedges = fit_wedges(scale.cells, np.ascontiguousarray(points), radius, scale.noise, rounds=2)
    return _in_line(wedges, points, along, radius, scale)[0]


def _in_line(
    wedges: Wedges, target: NDArray[np.float64], heading: NDArray[np.float64], radius: float, scale: Scale
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Tell which wedges go on in line; return their directions, and their foot points beside the targets."""
    cosine = np.einsum("nc,nc->n", wedges.direction, heading)
    along = np.where(cosine[:, None] < 0.0, -wedges.direction, wedges.direction)
    off = wedges.foot - target
    foot = wedges.foot - np.einsum("nc,nc->n", off, along)[:, None] * along
    evidence, tilt = wedge_evidence(wedges, radius, scale.h, scale.noise)
    with np.errstate(invalid="ignore"):
        good = (evidence > WEAK) & (wedges.angle > tilt) & (np.abs(cosine) > BEND)
        good &= np.linalg.norm(foot - target, axis=1) < ASIDE * scale.h
    return good, np.nan_to_num(along), np.nan_to_num(foot)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
