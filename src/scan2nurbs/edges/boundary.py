"""The boundary of a functional surface: edge points filtered, corrected by hand, thinned, and ordered into curves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.cloud import PointCloud
from scan2nurbs.edges.clean import CleanParams, clean_boundary, near_curves
from scan2nurbs.edges.corrections import Selection
from scan2nurbs.edges.curves import BoundaryCurve, CurveParams, trace_curves
from scan2nurbs.edges.detect import Edges
from scan2nurbs.edges.ranges import require_choice, require_float, require_int
from scan2nurbs.edges.thin import ThinParams, approximate_boundary, thin_boundary
from scan2nurbs.scale import Scale


@dataclass(frozen=True, kw_only=True)
class BoundaryParams:
    """How edge points become a boundary; lengths in units of h.

    Attributes
    ----------
    clean : CleanParams
        The density filter, and which groups are small and isolated.
    thinning : {"crease", "algorithm-2"}
        Move the points onto the crease before they are thinned, or run Algorithm 2 of the paper.
    thin : ThinParams
        Parameters of "crease".
    thin_radius : float
        r_u of "algorithm-2", (0, inf).
    thin_times : int
        How often "algorithm-2" runs, each time on its own result, [1, 100].
    curves : CurveParams
        How thinned points are joined into curves.
    far : float
        Thinned points farther than this from every curve are undesired, (0, inf).
    keep_only : Selection, optional
        Boundary points outside this selection are dropped.
    drop : Selection, optional
        Boundary points in this selection are dropped.
    """

    clean: CleanParams = field(default_factory=CleanParams)
    thinning: Literal["crease", "algorithm-2"] = "crease"
    thin: ThinParams = field(default_factory=ThinParams)
    thin_radius: float = 3.0
    thin_times: int = 3
    curves: CurveParams = field(default_factory=CurveParams)
    far: float = 3.0
    keep_only: Selection | None = None
    drop: Selection | None = None

    def __post_init__(self) -> None:
        """Check every range."""
        require_choice(self.thinning, "thinning", "find_boundary", ("crease", "algorithm-2"))
        require_float(self.thin_radius, "thin_radius", "find_boundary", 0.0)
        require_int(self.thin_times, "thin_times", "find_boundary", 1, 100)
        require_float(self.far, "far", "find_boundary", 0.0)


@dataclass(frozen=True)
class Boundary:
    """The boundary, from the band of edge points to curves.

    Attributes
    ----------
    on_edge : (N,) bool
        Edge points of the cloud that are left after filters and corrections.
    points : (M, 3) float64
        Thinned boundary points near the curves, in the cloud's local frame.
    curves : tuple of BoundaryCurve
        Open curves and closed loops, the longest first.
    counts : dict
        How many points each step took or left.
    """

    on_edge: NDArray[np.bool_]
    points: NDArray[np.float64]
    curves: tuple[BoundaryCurve, ...]
    counts: dict[str, int]


def find_boundary(cloud: PointCloud, scale: Scale, edges: Edges, params: BoundaryParams) -> Boundary:
    """Turn edge points into a boundary (paper, section 2.1 from the filter on).

    Parameters
    ----------
    cloud : PointCloud
        The points; corrections by hand are in the coordinates of its input.
    scale : Scale
        What `measure_scale` said of them.
    edges : Edges
        The detected edges, in the cloud's order.
    params : BoundaryParams
        Filters, thinning, curves and corrections.
    """
    corrected = _corrected(cloud, edges.mask, params)
    band = np.flatnonzero(corrected)
    cleaned = clean_boundary(cloud.points[band], spacing=scale.h, noise=scale.noise, params=params.clean)
    kept = band[cleaned.keep]
    if params.thinning == "crease":
        thinned = thin_boundary(
            cloud.points[kept], cloud.points, spacing=scale.h, noise=scale.noise, params=params.thin, cells=scale.cells
        ).points
    else:
        thinned = approximate_boundary(cloud.points[kept], params.thin_radius * scale.h, times=params.thin_times)
    curves = trace_curves(thinned, scale.h, params.curves, noise=scale.noise)
    near = near_curves(thinned, [curve.sample(0.5 * scale.h) for curve in curves], params.far * scale.h)
    on_edge = np.zeros(len(cloud.points), bool)
    on_edge[kept] = True
    counts = {
        "detected": int(np.count_nonzero(edges.mask)),
        "dropped_by_hand": int(np.count_nonzero(edges.mask & ~corrected)),
        "sparse": cleaned.counts["sparse"],
        "isolated": cleaned.counts["isolated"],
        "kept": len(kept),
        "thinned": len(thinned),
        "far_from_curves": int(np.count_nonzero(~near)),
    }
    return Boundary(on_edge=on_edge, points=thinned[near], curves=curves, counts=counts)


def _corrected(cloud: PointCloud, mask: NDArray[np.bool_], params: BoundaryParams) -> NDArray[np.bool_]:
    """Apply the corrections to the rows of the input, and bring the answer back to the points."""
    if params.keep_only is None and params.drop is None:
        return mask
    rows = cloud.to_rows(cloud.points + cloud.origin, np.nan)
    # Where rows coincide, naming one of them is enough, to keep the point or to drop it.
    result = mask.copy()
    if params.keep_only is not None:
        result &= _any_row(cloud, params.keep_only.of(rows))
    if params.drop is not None:
        result &= ~_any_row(cloud, params.drop.of(rows))
    return result


def _any_row(cloud: PointCloud, selected: NDArray[np.bool_]) -> NDArray[np.bool_]:
    points = np.zeros(len(cloud.points), bool)
    points[cloud.rows[selected & (cloud.rows >= 0)]] = True
    return points
