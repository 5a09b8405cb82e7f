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
from scan2nurbs.edges.thin import ThinParams, approximate_boundary, thin_boundary
from scan2nurbs.ranges import require_choice, require_float, require_int
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
class EdgeBand:
    """The band of edge points that is left after corrections and filters.

    Attributes
    ----------
    on_edge : (N,) bool
        The points that are left.
    counts : dict
        How many points were detected, dropped by hand, sparse, isolated and kept.
    """

    on_edge: NDArray[np.bool_]
    counts: dict[str, int]


@dataclass(frozen=True)
class Boundary:
    """A boundary as thinned points and as curves, in the cloud's local frame.

    Attributes
    ----------
    points : (M, 3) float64
        Thinned boundary points near the curves.
    curves : tuple of BoundaryCurve
        Open curves and closed loops, the longest first.
    counts : dict
        How many points there were, how many after thinning, and how many of those lay far from the curves.
    """

    points: NDArray[np.float64]
    curves: tuple[BoundaryCurve, ...]
    counts: dict[str, int]


def clean_edges(cloud: PointCloud, scale: Scale, edges: Edges, params: BoundaryParams) -> EdgeBand:
    """Apply corrections by hand and the filters to the detected edge points.

    Parameters
    ----------
    cloud : PointCloud
        The points; corrections are in the coordinates and rows of its input.
    scale : Scale
        What `measure_scale` said of them.
    edges : Edges
        The detected edges, in the cloud's order.
    params : BoundaryParams
        Filters and corrections.
    """
    corrected = _corrected(cloud, edges.mask, params)
    band = np.flatnonzero(corrected)
    cleaned = clean_boundary(cloud.points[band], spacing=scale.h, noise=scale.noise, params=params.clean)
    on_edge = np.zeros(len(cloud.points), bool)
    on_edge[band[cleaned.keep]] = True
    counts = {
        "detected": int(np.count_nonzero(edges.mask)),
        "dropped_by_hand": int(np.count_nonzero(edges.mask & ~corrected)),
        "sparse": cleaned.counts["sparse"],
        "isolated": cleaned.counts["isolated"],
        "kept": cleaned.counts["kept"],
    }
    return EdgeBand(on_edge=on_edge, counts=counts)


def draw_boundary(cloud: PointCloud, scale: Scale, on_edge: NDArray[np.bool_], params: BoundaryParams) -> Boundary:
    """Thin a band of edge points and draw curves through it.

    Parameters
    ----------
    cloud : PointCloud
        The points.
    scale : Scale
        What `measure_scale` said of them.
    on_edge : (N,) bool
        The points of the band.
    params : BoundaryParams
        How it is thinned, and how its points are joined into curves.
    """
    band = cloud.points[on_edge]
    if params.thinning == "crease":
        thinned = thin_boundary(band, cloud.points, spacing=scale.h, noise=scale.noise, params=params.thin, cells=scale.cells).points
    else:
        thinned = approximate_boundary(band, params.thin_radius * scale.h, times=params.thin_times)
    curves = trace_curves(thinned, scale.h, params.curves, noise=scale.noise)
    near = near_curves(thinned, [curve.sample(0.5 * scale.h) for curve in curves], params.far * scale.h)
    counts = {"band": len(band), "thinned": len(thinned), "far_from_curves": int(np.count_nonzero(~near))}
    return Boundary(points=thinned[near], curves=curves, counts=counts)


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
