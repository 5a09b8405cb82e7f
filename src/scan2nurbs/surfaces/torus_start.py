"""Starting values of a torus whose tube is thin beside its extent: cylinders fitted piece by piece, and a circle through their axes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.shape import Floats, unit
from scan2nurbs.surfaces.shape_solve import improve
from scan2nurbs.surfaces.shape_start import of_curvature, principal
from scan2nurbs.surfaces.torus import Torus

_PIECES = 10
_PIECE = (12, 150)


def tube_torus(points: Floats, sigma: float, share: float) -> Torus | None:
    """Return the torus along whose circle pieces of the points are cylinders.

    Parameters
    ----------
    points : (N, 3) float64
    sigma : float
        Noise of the points.
    share : float
        Size of a piece, as a share of the points.
    """
    size = int(np.clip(share * len(points), *_PIECE))
    if len(points) < 2 * size:
        return None
    seeds = _spread(points, _PIECES)
    _, near = KDTree(points).query(points[seeds], k=size)
    places, tangents, radii = [], [], []
    for piece in points[np.asarray(near)]:
        tube = next((s for s in of_curvature("cylinder", *principal(piece)) if isinstance(s, Cylinder)), None)
        if tube is None:
            continue
        middle = piece.mean(axis=0)
        tube = improve(tube, piece, np.ones(size), 6.0 * sigma, 20, 0.1 * sigma**2)
        if not isinstance(tube, Cylinder):
            continue
        places.append(tube.point + tube.axis * float((middle - tube.point) @ tube.axis))
        tangents.append(tube.axis)
        radii.append(tube.radius)
    if len(places) < 3:
        return None
    return _about_circle(np.array(places), np.array(tangents), float(np.median(radii)))


def _about_circle(places: Floats, tangents: Floats, minor: float) -> Torus | None:
    """Return the torus about a circle with given places and tangents: its axis is perpendicular to chords and tangents alike."""
    middle = np.median(places, axis=0)
    chords = (places - middle) / max(float(np.ptp(places, axis=0).max()), 1e-12)
    axis = np.linalg.eigh(tangents.T @ tangents + chords.T @ chords)[1][:, 0]
    # The circle's centre lies in every plane across a tangent.
    across = unit(tangents - (tangents @ axis)[:, None] * axis)
    weight = 1.0 / (1.0 + 10.0 * np.abs(tangents @ axis))
    rows = np.concatenate([across * weight[:, None], axis[None]])
    right = np.concatenate([np.einsum("ni,ni->n", across, places) * weight, [float(middle @ axis)]])
    center, _, rank, _ = np.linalg.lstsq(rows, right, rcond=1e-9)
    if rank < 3:
        return None
    radial = places - center
    radial = radial - (radial @ axis)[:, None] * axis
    return Torus(np.asarray(center, np.float64), axis, float(np.median(np.linalg.norm(radial, axis=1))), minor)


def _spread(points: Floats, n: int) -> list[int]:
    """Return the numbers of points far from each other, from one amid the points on."""
    chosen = [int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    least = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(n - 1):
        chosen.append(int(np.argmax(least)))
        least = np.minimum(least, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return chosen
