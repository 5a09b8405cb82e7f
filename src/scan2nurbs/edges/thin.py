"""From a band of boundary points to points on the boundary itself: Algorithm 2 of the paper, and a thinning that finds the crease."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.clean import CleanParams, clean_boundary
from scan2nurbs.kernels.cells import Cells, build_cells
from scan2nurbs.kernels.creases import fit_wedges
from scan2nurbs.kernels.thinning import ball_covariances, centroid_cover
from scan2nurbs.ranges import require_float, require_int

CREASE, RIDGE, KEPT = 2, 1, 0
"""Status of a boundary point: moved onto the crease of two faces, onto the middle line of its band, or left where it was."""

# A band with fewer points, or whose variance across exceeds this part of the variance along it, has no middle line.
_LEAST_BAND, _LONG_BAND = 4, 0.5


def approximate_boundary(points: NDArray[np.float64], radius: float, *, times: int = 1) -> NDArray[np.float64]:
    """Approximate the exact boundary by centroids of balls, as the paper's Algorithm 2 prints it.

    Parameters
    ----------
    points : (M, 3) float64
        Boundary points B.
    radius : float
        r_u, in the points' unit. A ball holds the points that are left in B and closer than this, the popped one included.
    times : int, >= 1
        How often the algorithm runs, each time on the result of the last.

    Returns
    -------
    (K, 3) float64
        The approximated boundary points B̂.

    Raises
    ------
    ParameterError
        If the radius or the number of times is out of range.

    Notes
    -----
    The paper leaves the order of the pops open. Here points are popped in a sweep along the longest principal axis of B, from
    its heavier-tailed end; ties go by the other two axes. The order of the rows therefore does not matter, and a rigid motion
    of B moves B̂ with it wherever the three principal variances differ.

    Centroids of a band wider than r_u stay in the band, and near a crease they lie inside the corner: see `thin_boundary`.
    """
    require_float(float(radius), "radius", "approximate_boundary", 0.0)
    require_int(times, "times", "approximate_boundary", 1)
    for _ in range(times):
        points = cover(points, radius)[0]
    return points


def cover(points: NDArray[np.float64], radius: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Run Algorithm 2 once; return the (K, 3) centroids and for each of the (M,) points the centroid that took it out of B."""
    if len(points) == 0:
        return np.empty((0, 3)), np.empty(0, np.int64)
    canonical = np.lexsort(points.T)  # sums over equal sets of points must be equal to the last bit, whatever their order
    cells = build_cells(np.ascontiguousarray(points[canonical]), radius)
    centroids, taken_by_cell_order = centroid_cover(cells, _sweep(cells.points), radius)
    taken_by = np.empty(len(points), np.int64)
    taken_by[canonical[cells.order]] = taken_by_cell_order
    return centroids, taken_by


def _sweep(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order points along their principal axes, each pointing to where the third moment is positive."""
    relative = points - points.mean(axis=0)
    axes = np.linalg.eigh(relative.T @ relative)[1][:, ::-1]
    along = relative @ axes
    skew = (along**3).sum(axis=0)
    along[:, skew < 0.0] *= -1.0
    return np.lexsort(along[:, ::-1].T)[::-1].astype(np.int64)


@dataclass(frozen=True, kw_only=True)
class ThinParams:
    """How boundary points are moved onto creases and thinned; lengths in units of the spacing h.

    Attributes
    ----------
    radius : float or None
        Radius of the neighbourhoods in which two half-planes are fitted, > 0; None chooses 4 to 8 by the noise.
    rounds : int, >= 1
        How often a point is moved; each round looks from where the last one left it.
    min_angle : float, in (0, 180)
        Least angle in degrees between two faces that meet in a crease; raised where the noise blurs more.
    min_gain : float, >= 1
        How many times better than one curved face (a quadric) the two planes must fit.
    reach : float, > 0
        Farthest that a point may move in all.
    step : float, > 0
        Radius r_u of the balls of Algorithm 2 that thin the moved points: they end up about 1.5 of it apart.
    clean : CleanParams
        The density filter between moving and thinning.
    """

    radius: float | None = None
    rounds: int = 3
    min_angle: float = 8.0
    min_gain: float = 1.0
    reach: float = 6.0
    step: float = 1.0
    clean: CleanParams = field(default_factory=CleanParams)

    def __post_init__(self) -> None:
        if self.radius is not None:
            require_float(self.radius, "radius", "thin_boundary", 0.0)
        require_int(self.rounds, "rounds", "thin_boundary", 1)
        require_float(self.min_angle, "min_angle", "thin_boundary", 0.0, 180.0)
        require_float(self.min_gain, "min_gain", "thin_boundary", 1.0, closed="low")
        for name in ("reach", "step"):
            require_float(getattr(self, name), name, "thin_boundary", 0.0)


@dataclass(frozen=True)
class MovedPoints:
    """Boundary points moved onto the boundary, row for row.

    Attributes
    ----------
    points : (M, 3) float64
        Where each point went.
    direction : (M, 3) float64
        Unit direction of the boundary there, as a line; NaN for points left where they were.
    angle : (M,) float64
        Degrees by which the surface turns at the crease; 0 for points on no crease.
    status : (M,) int8
        `CREASE`, `RIDGE` or `KEPT`.
    """

    points: NDArray[np.float64]
    direction: NDArray[np.float64]
    angle: NDArray[np.float64]
    status: NDArray[np.int8]

    def take(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> MovedPoints:
        """Return some of the points."""
        return MovedPoints(self.points[rows], self.direction[rows], self.angle[rows], self.status[rows])


@dataclass(frozen=True)
class ThinnedBoundary:
    """Points along the boundary, about evenly apart.

    Attributes
    ----------
    points : (K, 3) float64
    direction : (K, 3) float64
        Unit direction of the boundary, as a line; NaN where unknown.
    angle : (K,) float64
        Degrees by which the surface turns at the crease; 0 where there is none.
    status : (K,) int8
        The best status among the points that were joined.
    moved : MovedPoints
        All boundary points before cleaning and thinning, in the caller's order.
    kept : (M,) bool
        Which of them the density filter and the removal of small groups left.
    """

    points: NDArray[np.float64]
    direction: NDArray[np.float64]
    angle: NDArray[np.float64]
    status: NDArray[np.int8]
    moved: MovedPoints
    kept: NDArray[np.bool_]


def thin_boundary(
    points: NDArray[np.float64],
    cloud: NDArray[np.float64],
    *,
    spacing: float,
    noise: float = 0.0,
    params: ThinParams | None = None,
    cells: Cells | None = None,
) -> ThinnedBoundary:
    """Move boundary points onto the crease, remove what is sparse or isolated, and thin along the curve.

    Parameters
    ----------
    points : (M, 3) float64
        Boundary points: a band on both sides of the boundary.
    cloud : (N, 3) float64
        The whole cloud, in the same frame.
    spacing : float
        The noise-stable spacing h, in the points' unit.
    noise : float
        Standard deviation of the points across the surface, in the points' unit.
    params : ThinParams, optional
    cells : Cells, optional
        The cloud's cell index, where it exists already.

    Raises
    ------
    ParameterError
        If spacing or noise is out of range.

    Notes
    -----
    Deterministic at any number of threads and for every order of the boundary points; the order of the cloud changes sums in
    their last bits. The last step is Algorithm 2, which no longer shifts anything once the points lie on a curve.
    """
    params = params or ThinParams()
    moved = move_to_boundary(points, cloud, spacing=spacing, noise=noise, params=params, cells=cells)
    kept = clean_boundary(moved.points, spacing=spacing, noise=noise, params=params.clean).keep
    left = moved.take(kept)
    centroids, taken_by = cover(left.points, params.step * spacing)
    n = len(centroids)
    status = np.zeros(n, np.int8)
    np.maximum.at(status, taken_by, left.status)
    size = np.bincount(taken_by, minlength=n)
    angle = np.bincount(taken_by, left.angle, n) / np.maximum(size, 1)
    return ThinnedBoundary(centroids, _mean_lines(left.direction, taken_by, n), angle, status, moved, kept)


def move_to_boundary(
    points: NDArray[np.float64],
    cloud: NDArray[np.float64],
    *,
    spacing: float,
    noise: float = 0.0,
    params: ThinParams | None = None,
    cells: Cells | None = None,
) -> MovedPoints:
    """Move each boundary point onto the crease of the two faces that meet near it.

    The crease is where the two half-planes that fit its neighbourhood best intersect. A point whose neighbourhood is as well
    one smooth face (a rounded edge, a smooth step, the border of the scan) goes to the middle line of its band where the band
    is longer than wide, and else stays. Parameters and errors are those of `thin_boundary`.
    """
    params = params or ThinParams()
    require_float(float(spacing), "spacing", "thin_boundary", 0.0)
    require_float(float(noise), "noise", "thin_boundary", 0.0, closed="low")
    m = len(points)
    if m == 0:
        return MovedPoints(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0, np.int8))
    radius = spacing * (params.radius or wedge_radius(noise / spacing))
    cells = cells or build_cells(np.ascontiguousarray(cloud), 0.5 * radius)
    order = np.lexsort(points.T)  # near points are fitted together, and sums do not depend on the rows' order
    start = np.ascontiguousarray(points[order])
    result = _to_crease(start, cells, radius, spacing, noise, params)
    result = _to_ridge(start, result, 1.5 * radius, spacing, params)
    back = np.empty(m, np.int64)
    back[order] = np.arange(m)
    return result.take(back)


def wedge_radius(relative_noise: float) -> float:
    """Return the radius, in spacings, that keeps the planes' error small under noise (in spacings): 4 without any, at most 8."""
    # A plane through a half-disc of radius r errs by an angle of about 1.13 (sigma / h) / (r / h)^2; a degree is allowed.
    return float(np.clip(np.sqrt(1.13 * relative_noise / np.radians(1.0)), 4.0, 8.0))


def _to_crease(start: NDArray[np.float64], cells: Cells, radius: float, spacing: float, noise: float, params: ThinParams) -> MovedPoints:
    wedges = fit_wedges(cells, start, radius, noise, rounds=params.rounds)
    # An angle that the noise alone would give: three deviations of a plane's slope over its half of the neighbourhood.
    points_of_half = np.maximum(wedges.n_points, 1)
    blur = 3.0 * noise / (0.5 * radius * np.sqrt(points_of_half))
    moved_by = np.linalg.norm(wedges.foot - start, axis=1)
    # Comparisons with NaN are false: no wedge, no crease.
    good = (wedges.angle > np.maximum(np.radians(params.min_angle), blur)) & (moved_by <= params.reach * spacing)
    good &= wedges.quadric_rms >= params.min_gain * wedges.wedge_rms
    return MovedPoints(
        points=np.where(good[:, None], wedges.foot, start),
        direction=np.where(good[:, None], wedges.direction, np.nan),
        angle=np.where(good, np.degrees(wedges.angle), 0.0),
        status=np.where(good, CREASE, KEPT).astype(np.int8),
    )


def _to_ridge(start: NDArray[np.float64], found: MovedPoints, radius: float, spacing: float, params: ThinParams) -> MovedPoints:
    """Move the points on no crease to the middle line of the band of boundary points about them."""
    lost = np.flatnonzero(found.status == KEPT)
    points, direction, status = found.points.copy(), found.direction.copy(), found.status.copy()
    for _ in range(params.rounds if len(lost) else 0):
        # The band narrows as its points move: each round takes the middle of where they are now, those on creases included.
        mean, covariance, count = ball_covariances(build_cells(points, 0.5 * radius), points[lost], radius)
        variance, axes = np.linalg.eigh(covariance)
        along = axes[:, :, 2]
        target = points[lost] + mean - (mean * along).sum(axis=1, keepdims=True) * along
        good = (count >= _LEAST_BAND) & (variance[:, 1] < _LONG_BAND * variance[:, 2])
        good &= np.linalg.norm(target - start[lost], axis=1) <= params.reach * spacing
        points[lost[good]], direction[lost[good]], status[lost[good]] = target[good], along[good], RIDGE
    return MovedPoints(points, direction, found.angle, status)


def _mean_lines(direction: NDArray[np.float64], group: NDArray[np.int64], n: int) -> NDArray[np.float64]:
    """Average directions without sign within groups: the first eigenvector of the sum of their outer products."""
    known = np.isfinite(direction).all(axis=1)
    outer = np.zeros((n, 3, 3))
    np.add.at(outer, group[known], direction[known, :, None] * direction[known, None, :])
    lines = np.linalg.eigh(outer)[1][:, :, 2]
    lines[np.bincount(group[known], minlength=n) == 0] = np.nan
    return lines
