"""How far a model lies from the scan, both ways: a valid, closed crumb is a failure all the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart, tessellate
from scan2nurbs.kernels.runner import thread_count

Floats = NDArray[np.float64]

_MOST_POINTS = 200_000
_MOST_SAMPLES = 400_000
_SPACING = 0.5
_NEAR = 3.0


@dataclass(frozen=True)
class Deviation:
    """Scan and model compared.

    Attributes
    ----------
    coverage : float
        Share of the points that lie within the reach of the model.
    precision : float
        Share of the model's area that lies within the reach of the scan.
    rms : float
        Root mean square distance of the covered points to the model.
    reach : float
        In the points' unit.
    """

    coverage: float
    precision: float
    rms: float
    reach: float


def deviation(shape: Any, points: Floats, *, h: float, reach: float, scale: float = 1.0) -> Deviation:
    """Compare a shape with the points it was made from.

    Parameters
    ----------
    shape : TopoDS_Shape
        Its lengths are those of the points times `scale`.
    points : (N, 3) float64
        Large clouds are asked at every so many points.
    h : float
        Spacing of the points.
    reach : float
        Largest distance at which a point and the model belong together.

    Notes
    -----
    The model is sampled evenly, twice as close as the points. Where a sample is near, the distance is that along its normal; so the
    spacing of the samples does not matter.
    """
    part = tessellate(shape, deflection=0.1 * h * scale, least=0.1 * h * scale)
    spacing = max(_SPACING * h, float(np.sqrt(part.area / _MOST_SAMPLES)) / scale)
    samples, normals = sample(part, spacing * scale)
    samples = samples / scale
    some = points[:: max(1, -(-len(points) // _MOST_POINTS))]
    # Beyond this nothing belongs together, however far it is: a bound spares the search.
    bound, workers = 2.0 * reach + _NEAR * max(h, spacing), thread_count()
    apart, nearest = KDTree(samples).query(some, distance_upper_bound=bound, workers=workers)
    nearest = np.minimum(nearest, len(samples) - 1)
    along = np.abs(np.einsum("nk,nk->n", some - samples[nearest], normals[nearest]))
    to_model = np.where(apart <= _NEAR * max(h, spacing), along, apart)
    gap = max(h, h * np.sqrt(len(points) / len(some)))
    to_scan = KDTree(some).query(samples, distance_upper_bound=2.0 * (reach + gap), workers=workers)[0]
    covered = to_model <= reach
    rms = float(np.sqrt(np.mean(to_model[covered] ** 2))) if covered.any() else np.inf
    return Deviation(float(covered.mean()), float((to_scan <= reach + gap).mean()), rms, reach)


def sample(part: CadPart, spacing: float) -> tuple[Floats, Floats]:
    """Return points and unit normals spread evenly over the triangles of a part, about `spacing` apart; deterministic.

    Notes
    -----
    The triangles' areas are laid end to end and cut into equal shares; a low-discrepancy sequence (the R2 sequence of the plastic
    number) says where in its triangle each point lies.
    """
    area = part.triangle_area
    count = max(1000, int(part.area / spacing**2))
    ends = np.cumsum(area)
    triangle = np.minimum(np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1]), len(area) - 1)
    k = np.arange(1, count + 1)[:, None]
    share = (k * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    share = np.where(share.sum(axis=1, keepdims=True) > 1.0, 1.0 - share, share)
    corners = part.corners[triangle]
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    return corners[:, 0] + np.einsum("nk,nkc->nc", share, sides), normals / np.linalg.norm(normals, axis=1, keepdims=True)
