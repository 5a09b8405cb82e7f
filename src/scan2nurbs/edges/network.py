"""The curves of all edges of a scan: thinned, followed over gaps, closed where they close, meeting in corner points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.edges.clean import CleanParams
from scan2nurbs.edges.curves import BoundaryCurve, CurveParams, fit_curve
from scan2nurbs.edges.follow import follow_ends, supported
from scan2nurbs.edges.graph import Chain, free_ends, order_points
from scan2nurbs.edges.meet import Meeting, meet_ends
from scan2nurbs.edges.polyline import arc_length
from scan2nurbs.edges.thin import ThinParams, cover, thin_boundary
from scan2nurbs.kernels.thinning import ball_covariances
from scan2nurbs.scale import Scale

# Pieces of so few spacings may be chance; they are kept to be followed, and count once they are long enough: edges end in corners, and
# what does so needs no length; a curve that ends freely on both sides, or in itself, may be chance.
SEED, CORNERED, HALF_FREE, FREE = 3.0, 4.0, 8.0, 16.0
# Along a curve a crease must be seen at this part of its points, or a border.
SUPPORT = 0.5


@dataclass(frozen=True)
class EdgeCurve:
    """A curve along an edge.

    Attributes
    ----------
    curve : BoundaryCurve
        The ordered points and the B-spline.
    ends : (int, int)
        The corners in which it begins and ends, as rows of `EdgeNetwork.corners`; −1 where it ends freely, and where it is closed.
    """

    curve: BoundaryCurve
    ends: tuple[int, int]


@dataclass(frozen=True)
class EdgeNetwork:
    """All edge curves, in the cloud's local frame.

    Attributes
    ----------
    curves : tuple of EdgeCurve
        By falling length.
    corners : (C, 3) float64
        Where curves meet.
    counts : dict
        Edge points given, thinned, and added by following; pieces that were too short.
    """

    curves: tuple[EdgeCurve, ...]
    corners: NDArray[np.float64]
    counts: dict[str, int]


def edge_network(
    points: NDArray[np.float64],
    scale: Scale,
    on_edge: NDArray[np.bool_],
    params: CurveParams | None = None,
    *,
    border: NDArray[np.bool_] | None = None,
) -> EdgeNetwork:
    """Draw curves along all edges.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    scale : Scale
        What `measure_scale` said of them.
    on_edge : (N,) bool
        The detected edge points, in the cloud's order.
    params : CurveParams, optional
        How points are joined, and how B-splines are fitted.
    border : (N,) bool, optional
        Which of them lie on a border of the scan, where there is no crease.

    Notes
    -----
    Edge points move onto the crease and are thinned. Pieces are followed from their free ends as far as creases go on in line; curves are
    traced again through all points, and their ends drawn together where their tangents meet. Undesired points fall out on the way:
    those in sparse places, side branches, curves along which no crease is seen, and short ones that end freely.
    """
    params = params or CurveParams()
    h = scale.h
    # Short pieces are seeds here: what they come to decides.
    clean = CleanParams(group_extent=SEED)
    thin = ThinParams(clean=clean)
    band = points[on_edge]
    if border is not None:
        band = np.concatenate([points[on_edge & ~border], _outward(points[on_edge & border], scale)])
    thinned = thin_boundary(band, points, spacing=h, noise=scale.noise, params=thin, cells=scale.cells).points
    counts = {"edge_points": len(band), "thinned": len(thinned), "followed": 0, "too_short": 0}
    if len(thinned) < 3:
        return EdgeNetwork((), np.empty((0, 3)), counts)
    thinned = thinned[np.lexsort(thinned.T)]
    chains = _order(thinned, h, params)
    ends, outward = free_ends(thinned, chains, 2.0 * params.link * h)
    if len(ends):
        more = follow_ends(thinned, ends, outward, scale)
        counts["followed"] = len(more)
        thinned = cover(np.concatenate([thinned, more]), thin.step * h)[0]
        thinned = thinned[np.lexsort(thinned.T)]
        chains = _order(thinned, h, params)
    kept = [chain for chain in chains if _length(thinned, chain) >= SEED * h]
    seen = _seen(thinned, kept, scale, points[border] if border is not None else points[:0])
    kept = [chain for chain, good in zip(kept, seen, strict=True) if good]
    meeting = meet_ends(thinned, kept, h, scale.noise)
    long_enough = _long_enough(thinned, kept, meeting, h)
    counts["unseen"] = int(np.count_nonzero(~seen))
    counts["too_short"] = len(chains) - counts["unseen"] - int(np.count_nonzero(long_enough))
    curves = [
        _curve(thinned, chain, ends, meeting, scale, params)
        for chain, ends, good in zip(kept, meeting.ends, long_enough, strict=True)
        if good
    ]
    return EdgeNetwork(tuple(sorted(curves, key=lambda edge: -edge.curve.length)), meeting.corners, counts)


def _outward(points: NDArray[np.float64], scale: Scale) -> NDArray[np.float64]:
    """Move points of a border, which lie up to a spacing inside it, half a spacing outwards: away from the mean of what is about them."""
    mean, _, _ = ball_covariances(scale.cells, np.ascontiguousarray(points), 4.0 * scale.h)
    return points - 0.5 * scale.h * mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)


def _order(points: NDArray[np.float64], h: float, params: CurveParams) -> list[Chain]:
    return order_points(points, link=params.link * h, gap=params.gap * h, prune=params.prune * h, loop=params.min_loop * h)


def _length(points: NDArray[np.float64], chain: Chain) -> float:
    return float(arc_length(points[chain.nodes], closed=chain.closed)[-1]) if len(chain.nodes) > 1 else 0.0


def _seen(points: NDArray[np.float64], chains: list[Chain], scale: Scale, border: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell along which chains there is a crease, or a border."""
    if not chains:
        return np.zeros(0, bool)
    owner = np.repeat(np.arange(len(chains)), [len(chain.nodes) for chain in chains])
    rows = np.concatenate([chain.nodes for chain in chains])
    along = np.concatenate([_directions(points[chain.nodes], chain.closed) for chain in chains])
    good = supported(points[rows], along, scale)
    if len(border):
        good |= KDTree(border).query(points[rows])[0] <= 2.0 * scale.h
    return np.bincount(owner, good, len(chains)) >= SUPPORT * np.bincount(owner, minlength=len(chains))


def _directions(ordered: NDArray[np.float64], closed: bool) -> NDArray[np.float64]:
    """Return the unit direction of a row of points at each, over two neighbours on either side."""
    k, reach = len(ordered), 2
    rows = np.arange(k)
    if closed:
        chord = ordered[(rows + reach) % k] - ordered[rows - reach]
    else:
        chord = ordered[np.minimum(rows + reach, k - 1)] - ordered[np.maximum(rows - reach, 0)]
    return chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-300)


def _long_enough(points: NDArray[np.float64], chains: list[Chain], meeting: Meeting, h: float) -> NDArray[np.bool_]:
    """Ask for the more length, the less a curve's ends are held by others."""
    least = []
    for chain, (a, b) in zip(chains, meeting.ends, strict=True):
        held = (a >= 0) + (b >= 0)
        least.append(CORNERED if chain.closed or (held == 2 and a != b) else FREE if held != 1 else HALF_FREE)
    return np.array([_length(points, chain) for chain in chains]) >= h * np.array(least)


def _curve(
    points: NDArray[np.float64], chain: Chain, ends: tuple[int, int], meeting: Meeting, scale: Scale, params: CurveParams
) -> EdgeCurve:
    """Fit one curve, drawn to its corners."""
    ordered = meeting.drawn(points, chain, ends, scale.h)
    curve = fit_curve(ordered, scale.h, closed=chain.closed, params=params, noise=scale.noise)
    if not chain.closed:
        coefficients = curve.spline.c.copy()
        for end, row in zip(ends, (0, -1), strict=True):
            if end >= 0:
                coefficients[row] = meeting.corners[end]
        spline = type(curve.spline)(curve.spline.t, coefficients, curve.spline.k)
        curve = replace(curve, spline=spline)
    return EdgeCurve(curve, (-1, -1) if chain.closed else ends)
