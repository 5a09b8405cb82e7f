"""What does not belong to the boundary: sparse points, small isolated groups, points far from the loops.

Every function here returns masks over the points it was given and removes nothing itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.thinning import join_groups
from scan2nurbs.ranges import require_choice, require_float, require_int

# A median absolute deviation times this is the standard deviation of a normal distribution.
_MAD = 1.4826


@dataclass(frozen=True, kw_only=True)
class CleanParams:
    """How boundary points are cleaned; lengths in units of the spacing h.

    Attributes
    ----------
    method : "statistical" or "radius"
        The density filter: by the mean distance to the nearest neighbours, or by the number of points in a ball.
    neighbours : int, >= 1
        Nearest boundary points whose mean distance is taken (statistical).
    deviations : float, > 0
        A point is sparse where its mean distance exceeds the centre of all by this many spreads (statistical).
    robust : bool
        Centre and spread are the median and the scaled median absolute deviation; otherwise mean and standard deviation, as
        in the original filter (statistical).
    radius : float, > 0
        Radius of the ball for noiseless points (radius count).
    min_points : int, >= 1
        Points that the ball must hold, the point itself included (radius count).
    noise_factor : float, >= 0
        How far the density filter's threshold follows the noise: the ball's radius grows by this many standard deviations of
        the noise, and no spread of the mean distances below this part of it counts.
    group_gap : float, > 0
        Points closer than this belong to one group.
    group_extent : float, >= 0
        A group is small where twice the largest distance from its mean is shorter than this.
    group_share : float, in [0, 1]
        A small group stays where it holds at least this share of all points.
    """

    method: Literal["statistical", "radius"] = "statistical"
    neighbours: int = 8
    deviations: float = 4.0
    robust: bool = True
    radius: float = 3.0
    min_points: int = 4
    noise_factor: float = 2.0
    group_gap: float = 4.0
    group_extent: float = 8.0
    group_share: float = 0.1

    def __post_init__(self) -> None:
        require_choice(self.method, "method", "clean_boundary", ("statistical", "radius"))
        require_int(self.neighbours, "neighbours", "clean_boundary", 1)
        require_int(self.min_points, "min_points", "clean_boundary", 1)
        for name in ("deviations", "radius", "group_gap"):
            require_float(getattr(self, name), name, "clean_boundary", 0.0)
        for name in ("noise_factor", "group_extent"):
            require_float(getattr(self, name), name, "clean_boundary", 0.0, closed="low")
        require_float(self.group_share, "group_share", "clean_boundary", 0.0, 1.0, closed="both")


@dataclass(frozen=True)
class Cleaned:
    """Which boundary points stay, and why the others do not.

    Attributes
    ----------
    keep : (M,) bool
        Points that stay.
    sparse : (M,) bool
        Points the density filter removed.
    isolated : (M,) bool
        Points that passed it, and were removed with their small group.
    """

    keep: NDArray[np.bool_]
    sparse: NDArray[np.bool_]
    isolated: NDArray[np.bool_]

    @property
    def counts(self) -> dict[str, int]:
        """Points given, sparse, isolated and kept, for the report."""
        named = {"given": np.ones_like(self.keep), "sparse": self.sparse, "isolated": self.isolated, "kept": self.keep}
        return {name: int(np.count_nonzero(mask)) for name, mask in named.items()}


def clean_boundary(points: NDArray[np.float64], *, spacing: float, noise: float = 0.0, params: CleanParams | None = None) -> Cleaned:
    """Remove sparse boundary points, then small isolated groups among those that stay.

    Parameters
    ----------
    points : (M, 3) float64
        Boundary points.
    spacing : float
        The noise-stable spacing h of the cloud, in the points' unit.
    noise : float
        Standard deviation of the points across the surface, in the points' unit.
    params : CleanParams, optional

    Raises
    ------
    ParameterError
        If spacing or noise is out of range.

    Notes
    -----
    O(M log M), deterministic, the same for every order of the points and under rigid motion.
    """
    params = params or CleanParams()
    require_float(float(spacing), "spacing", "clean_boundary", 0.0)
    require_float(float(noise), "noise", "clean_boundary", 0.0, closed="low")
    dense = density_filter(points, spacing=spacing, noise=noise, params=params)
    keep = dense.copy()
    keep[dense] = in_large_group(points[dense], spacing=spacing, params=params)
    return Cleaned(keep=keep, sparse=~dense, isolated=dense & ~keep)


def density_filter(
    points: NDArray[np.float64], *, spacing: float, noise: float = 0.0, params: CleanParams | None = None
) -> NDArray[np.bool_]:
    """Tell which points lie as dense as the others (paper, section 2.1, with its reference [11]).

    Statistical: the mean distance to the k nearest other points is at most centre + c·spread over all points. By radius count:
    a ball holds at least so many points. The threshold follows the noise, since noise spreads a boundary's points without
    making them less of a boundary.

    Returns
    -------
    (M,) bool
        True for the points that stay.
    """
    params = params or CleanParams()
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    tree = KDTree(points)
    if params.method == "radius":
        reach = params.radius * spacing + params.noise_factor * noise
        return np.asarray(tree.query_ball_point(points, reach, return_length=True) >= params.min_points)
    k = min(params.neighbours, len(points) - 1)
    if k == 0:
        return np.ones(1, np.bool_)
    mean = tree.query(points, k + 1)[0][:, 1:].mean(axis=1)
    if params.robust:
        centre = float(np.median(mean))
        spread = _MAD * float(np.median(np.abs(mean - centre)))
    else:
        centre, spread = float(mean.mean()), float(mean.std())
    # Evenly thinned points have almost no spread: a difference below a part of the spacing or of the noise says nothing.
    return mean <= centre + params.deviations * max(spread, params.noise_factor * noise / params.deviations, 0.1 * centre)


def in_large_group(points: NDArray[np.float64], *, spacing: float, params: CleanParams | None = None) -> NDArray[np.bool_]:
    """Tell which points belong to a group that is no small isolated one.

    Returns
    -------
    (M,) bool
        True for points of groups (joined over gaps of at most `group_gap`) that are long enough or hold a share of all points.
    """
    params = params or CleanParams()
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    n, group = _groups(points, params.group_gap * spacing)
    # Unlike a box along the axes, the distance from the mean does not change under rotation.
    size = np.bincount(group, minlength=n)
    mean = np.stack([np.bincount(group, points[:, a], n) for a in range(3)], axis=1) / size[:, None]
    reach = np.zeros(n)
    np.maximum.at(reach, group, np.linalg.norm(points - mean[group], axis=1))
    large = (2.0 * reach >= params.group_extent * spacing) | (size >= params.group_share * len(points))
    return large[group]


def near_curves(points: NDArray[np.float64], curves: Sequence[NDArray[np.float64]], distance: float) -> NDArray[np.bool_]:
    """Tell which points lie within a distance of the curves.

    Parameters
    ----------
    points : (M, 3) float64
    curves : sequence of (K, 3) float64
        Points along each loop, e.g. ``BoundaryCurve.sample(step)``.
    distance : float
        In the points' unit; the curves should be sampled more finely than this.

    Returns
    -------
    (M,) bool
        All False where there is no curve.
    """
    samples = [curve for curve in curves if len(curve)]
    if not samples or len(points) == 0:
        return np.zeros(len(points), np.bool_)
    nearest = KDTree(np.concatenate(samples)).query(points, distance_upper_bound=np.nextafter(distance, np.inf))[0]
    return np.isfinite(nearest)


def _groups(points: NDArray[np.float64], gap: float) -> tuple[int, NDArray[np.int64]]:
    """Give a number to each group of points joined over gaps of at most `gap`."""
    cells = build_cells(np.ascontiguousarray(points), gap)
    first = np.empty(len(points), np.int64)
    first[cells.order] = join_groups(cells, gap)
    roots, group = np.unique(first, return_inverse=True)
    return len(roots), group
