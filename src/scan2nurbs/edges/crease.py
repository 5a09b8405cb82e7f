"""The default operator: a point is on an edge where two faces meet more sharply than any rounding, or one curved face, explains."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.border import find_borders
from scan2nurbs.edges.chains import chain_extent
from scan2nurbs.edges.operators import RADIUS_RANGE, Lengths, Strength, compare_planes, one_sided_planes_of
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.kernels.alongside import mean_along, nearest_piece
from scan2nurbs.kernels.bend_widths import FLOOR, Bends, fit_bends
from scan2nurbs.kernels.cells import Cells, build_cells
from scan2nurbs.kernels.creases import fit_wedges
from scan2nurbs.kernels.nearest import nearest_to
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.kernels.sides import Meetings, meeting_sides

# Where one-sided normals differ by less than this, in degrees, nothing is tried: fainter creases are lost in noise.
CANDIDATE = 10.0
# Radius in h within which the planes of the two sides are averaged, and how far from its line of meeting a point still tells of it.
SIDES, TELLING = 3.0, 2.5
# Half-widths of roundings in h that a sharp bend is compared with.
WIDTHS = (0.0, 1.2, 2.0, 3.0, 4.5)
# The half-width of the window across a crease, in h: this times the root of the noise in h, within the bounds; it is half as long again.
WINDOW, WINDOW_RANGE, LONGER = 7.0, (3.5, 8.0), 1.5
# Mean logarithm of the likelihood ratio along a crease: what is asked for against one curved face, and against a rounding, which
# is rarer and has a width to choose. Means over 4 h, repeated eight times, reach about 10 h either way.
EVIDENCE, ROUNDING = 2.5, -0.3
MEAN_REACH, MEANS = 4.0, 8
# The best of the bumps that noise makes look like short shallow creases. Pieces 10 h apart share no points, so that evidence adds up
# along a chain of pieces, which follow each other closer than 1.5 h, and of its sum more is asked for; less of a second look through
# narrower windows, as more of them lie along a chain.
APART, FOLLOWS, SUM, FINE_SUM = 10.0, 1.5, 10.0, 4.0
# Where residuals come from the shape of faces and not from noise, they do not average out: a sharp bend must be so much likelier
# there than a rounding, unless it turns by so many degrees that a rounding of that turn would be narrower than the spacing shows,
# or the bends leave so little of what they may leave that they are exact.
CLEARLY, BLUNT, ACUTE, EXACT = 2.0, 30.0, 75.0, 0.25
# A second look with the narrowest window is worth its time where the first is wider than this times it; how near to a piece of
# rounding, in h, what looks sharp in it does not count.
FINER, VETO, SAME = 1.15, 1.5, 2.0
ALIGN = 2.5
# How far from the crease points are marked, in h, and half the length of a piece of it.
REACH, HALF_PIECE = 0.5, 1.0
# The comparison that tells where the surface breaks: a wedge is the best of 57 splits (4 = log 57), and its extra parameters must
# pay too (4: two of them, at half the logarithm of some fifty points each).
WEDGE_EVIDENCE = 8.0
WEDGE_FLOOR = 0.03
# The angle by which noise may tilt a fitted half-plane, in degrees, and the radii of the fits, in h.
TILT = 2.0
RADII = (4.0, 8.0)
WIDER = 2.0
# How far from an edge, in h, the bands of one-sided normals reach.
BAND = 3.0


def crease(cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> Strength:
    """Measure by how many degrees the surface turns at a crease beside each point; 0 where there is none within reach.

    Where one-sided normals differ (see `one_sided`), the planes about a point are averaged into two sides, which meet in a line. Bends
    of several widths are fitted to the points about that line, as far as two faces explain them: sharp ones, rounded ones and one
    curved face. The logarithms of their likelihoods are averaged along the crease. Where the sharp bend is likely enough, the
    points within `reach` of it are on the edge. So are, with 90 degrees, the points where the surface ends (see `find_borders`).

    Notes
    -----
    Normals that differ say that a surface bends; only the width says whether it bends or breaks. A window of a few spacings holds too
    few points to tell in noise, and a wider one other edges; but a crease is long, and what a rounding looks like is the same all
    along it. Candidates are a few per cent of the points, at about 100 µs each.
    """
    wide = _look(cells, lengths, params, _window(lengths), progress)
    seen, candidates = wide.creases, wide.candidates
    border = find_borders(cells, candidates.normal, np.full(len(cells.points), lengths.h), lengths.h, lengths.noise).outline
    pieces = _sharp(wide.creases, SUM, lengths)
    window = {"window": wide.window}
    if params.radius is None and wide.window > FINER * WINDOW_RANGE[0] * lengths.h:
        fine = _look(cells, lengths, replace(params, radius=RADIUS_RANGE[0], absolute=False), WINDOW_RANGE[0] * lengths.h, progress)
        more = _apart_from(_sharp(fine.creases, FINE_SUM, lengths), pieces, SAME * lengths.h, lengths)
        pieces = _joined(pieces, _without_rounded(more, seen, lengths), lengths)
        window["fine_window"] = fine.window
    reach = REACH * lengths.h if params.reach is None else params.reach * (1.0 if params.absolute else lengths.h)
    strength = np.where(np.isnan(candidates.strength), np.nan, 0.0)
    strength[border] = 90.0
    if len(pieces.turn) > 0:
        pieces = _aligned(pieces, lengths)
        nearest = _marked(cells, pieces, lengths, reach)
        found = (nearest >= 0) & ~np.isnan(strength) & ~border
        strength[found] = np.minimum(np.degrees(pieces.turn[nearest[found]]), 90.0)
    return Strength(
        strength=strength,
        normal=candidates.normal,
        radii=candidates.radii | window | {"reach": reach},
        counts=candidates.counts
        | {"crease_candidates": wide.n_places, "crease_pieces": len(pieces.turn), "border_points": int(border.sum())},
    )


class Pieces(NamedTuple):
    """Short pieces of creases, sorted into cells by their middles, with direction (K, 3) and turn (K,) in radians."""

    feet: Cells
    direction: NDArray[np.float64]
    turn: NDArray[np.float64]


class Creases(NamedTuple):
    """Pieces of creases, and of each what was averaged along it.

    Attributes
    ----------
    pieces : Pieces
        K of them.
    sharp, rounded : (K,) float64
        Mean logarithms of the likelihoods of a sharp bend, and of the best rounded one, over one curved face.
    leftover : (K,) float64
        Mean square of the best bend's residuals over what noise and the shape of faces may leave.
    """

    pieces: Pieces
    sharp: NDArray[np.float64]
    rounded: NDArray[np.float64]
    leftover: NDArray[np.float64]


class Look(NamedTuple):
    """What was seen through windows of one width."""

    window: float
    candidates: Strength
    n_places: int
    creases: Creases


def _window(lengths: Lengths) -> float:
    return float(np.clip(WINDOW * math.sqrt(lengths.noise / lengths.h), *WINDOW_RANGE)) * lengths.h


def _look(cells: Cells, lengths: Lengths, params: EdgeParams, window: float, progress: Progress | None) -> Look:
    """Fit bends in windows of one width wherever one-sided normals differ."""
    planes = one_sided_planes_of(cells, lengths, params, progress)
    candidates = compare_planes(cells, planes, lengths, progress)
    places = np.flatnonzero(candidates.strength > CANDIDATE)
    meetings = meeting_sides(cells, planes.normals.balls, planes.chosen, places, SIDES * lengths.h)
    meetings, bends = _bends(cells, places, meetings, window, lengths)
    return Look(window, candidates, len(places), _weigh(meetings, bends, lengths))


def _bends(cells: Cells, places: NDArray[np.int64], meetings: Meetings, window: float, lengths: Lengths) -> tuple[Meetings, Bends]:
    """Fit the bends twice, the second time about the crease that the first found."""

    def fit(about: Meetings) -> Bends:
        about.turn[farther(about.foot, SIDES)] = np.nan
        return fit_bends(
            cells,
            places,
            about,
            across=window,
            along=LONGER * window,
            noise=lengths.noise,
            spacing=lengths.h,
            widths=np.array(WIDTHS) * lengths.h,
        )

    def farther(foot: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        return ~(np.linalg.norm(foot - cells.points[places], axis=1) < reach * lengths.h)

    meetings = meetings._replace(foot=fit(meetings).foot)
    bends = fit(meetings)
    bends.turn[farther(bends.foot, TELLING)] = np.nan
    return meetings, bends


def _weigh(meetings: Meetings, bends: Bends, lengths: Lengths) -> Creases:
    """Average the likelihoods along the creases."""
    kept = np.flatnonzero(np.isfinite(bends.turn) & np.isfinite(bends.misfit).all(axis=1))
    if len(kept) == 0:
        return Creases(_pieces(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), lengths), np.zeros(0), np.zeros(0), np.zeros(0))
    feet = build_cells(bends.foot[kept], MEAN_REACH * lengths.h)
    kept = kept[feet.order]
    misfit = bends.misfit[kept]
    # Where even the best bend fits worse than the noise allows, all count for less.
    leftover = misfit.min(axis=1) / np.maximum(bends.n_points[kept] - 7, 1)
    likelihood = -0.5 * (misfit - misfit[:, -1:]) / np.maximum(leftover, 1.0)[:, None]
    values = np.ascontiguousarray(np.c_[likelihood[:, :-1], bends.turn[kept], leftover])
    direction, across = meetings.direction[kept], meetings.across[kept]
    up = np.cross(direction, across)
    for _ in range(MEANS):
        values = mean_along(feet, direction, up, values, MEAN_REACH * lengths.h, lengths.h)
    return Creases(Pieces(feet, direction, values[:, -2]), values[:, 0], values[:, 1:-2].max(axis=1), values[:, -1])


def _sharp(creases: Creases, total: float, lengths: Lengths) -> Pieces:
    """Keep the pieces that are sharp, with evidence enough for the length of their chain."""
    pieces, sharp = creases.pieces, creases.sharp
    good = np.flatnonzero((sharp > EVIDENCE) & (sharp - creases.rounded > ROUNDING + _allowance(creases, lengths)))
    extent = chain_extent(pieces.feet.points[good], FOLLOWS * lengths.h) / lengths.h
    return _chosen(pieces, good[sharp[good] * (1.0 + extent / APART) > total], lengths)


def _allowance(creases: Creases, lengths: Lengths) -> NDArray[np.float64]:
    """Return by how much the shape of smooth faces may speak for a sharp bend and against a rounding."""
    shape = (FLOOR * lengths.h) ** 2
    shape /= shape + lengths.noise**2
    inexact = np.clip(creases.leftover / EXACT, 0.0, 1.0)
    blunt = np.clip((ACUTE - np.degrees(creases.pieces.turn)) / (ACUTE - BLUNT), 0.0, 1.0)
    return CLEARLY * shape**2 * inexact * blunt


def _without_rounded(pieces: Pieces, seen: Creases, lengths: Lengths) -> Pieces:
    """Leave out the pieces beside which a wider window saw a rounding, which may look sharp through a narrow one."""
    rounded = np.flatnonzero((seen.rounded > EVIDENCE) & (seen.sharp - seen.rounded <= ROUNDING))
    if len(rounded) == 0 or len(pieces.turn) == 0:
        return pieces
    return _apart_from(pieces, _chosen(seen.pieces, rounded, lengths), VETO * lengths.h, lengths)


def _apart_from(pieces: Pieces, others: Pieces, reach: float, lengths: Lengths) -> Pieces:
    """Leave out the pieces closer than `reach` to others."""
    if len(pieces.turn) == 0 or len(others.turn) == 0:
        return pieces
    beside = nearest_piece(pieces.feet, others.feet, others.direction, HALF_PIECE * lengths.h, reach)
    return _chosen(pieces, np.flatnonzero(beside < 0), lengths)


def _aligned(pieces: Pieces, lengths: Lengths) -> Pieces:
    """Move the pieces across onto the mean line of those that carry on them."""
    if len(pieces.turn) == 0:
        return pieces
    points, direction = pieces.feet.points, pieces.direction
    step = mean_along(pieces.feet, direction, direction, points, ALIGN * lengths.h, lengths.h) - points
    step -= np.einsum("ki,ki->k", step, direction)[:, None] * direction
    return _pieces(points + step, direction, pieces.turn, lengths)


def _marked(cells: Cells, pieces: Pieces, lengths: Lengths, reach: float) -> NDArray[np.int32]:
    """Return for each point the piece that it lies on, or -1: one closer than `reach`, or one of which it is the nearest point."""
    half = HALF_PIECE * lengths.h
    on = nearest_piece(cells, pieces.feet, pieces.direction, half, reach)
    index, distance = nearest_to(cells, pieces.feet.points, 1)
    alone = np.flatnonzero((distance[:, 0] < half) & (on[index[:, 0]] < 0))
    on[index[alone, 0]] = alone
    return on


def _chosen(pieces: Pieces, which: NDArray[np.int64], lengths: Lengths) -> Pieces:
    return _pieces(pieces.feet.points[which], pieces.direction[which], pieces.turn[which], lengths)


def _joined(a: Pieces, b: Pieces, lengths: Lengths) -> Pieces:
    points = np.concatenate((a.feet.points[: len(a.turn)], b.feet.points[: len(b.turn)]))
    return _pieces(points, np.concatenate((a.direction, b.direction)), np.concatenate((a.turn, b.turn)), lengths)


def _pieces(points: NDArray[np.float64], direction: NDArray[np.float64], turn: NDArray[np.float64], lengths: Lengths) -> Pieces:
    if len(points) == 0:
        return Pieces(build_cells(np.zeros((1, 3)), 1.0), np.zeros((0, 3)), np.zeros(0))
    feet = build_cells(points, 2.0 * lengths.h)
    return Pieces(feet, np.ascontiguousarray(direction[feet.order]), turn[feet.order])


def breaks(cells: Cells, places: NDArray[np.float64], lengths: Lengths) -> NDArray[np.bool_]:
    """Tell near which places the surface breaks: a band's width away, two half-planes explain it better than one curved face.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    places : (M, 3) float64
        Points of bands along edges.
    lengths : Lengths
        Spacing and noise.
    """
    radius, reach = fit_radius(lengths.noise / lengths.h) * lengths.h, BAND * lengths.h
    near = _compare(cells, places, radius, lengths, reach)
    found = (near.evidence > WEDGE_EVIDENCE) & (near.turn > 0.0)
    open_ = np.flatnonzero((near.evidence > 0.0) & ~found)
    far = _compare(cells, places[open_], WIDER * radius, lengths, reach)
    found[open_] = (far.evidence > WEDGE_EVIDENCE) & (far.turn > 0.0)
    return found


class _Comparison(NamedTuple):
    """Two half-planes against one quadric: the log likelihood ratio, and the turn in degrees of a crease within reach, else 0."""

    evidence: NDArray[np.float64]
    turn: NDArray[np.float64]


def _compare(cells: Cells, places: NDArray[np.float64], radius: float, lengths: Lengths, reach: float) -> _Comparison:
    places = np.ascontiguousarray(places)
    wedges = fit_wedges(cells, places, radius, lengths.noise, rounds=2)
    floor = max(WEDGE_FLOOR * lengths.h, 0.2 * lengths.noise) ** 2
    half = np.maximum(wedges.n_points, 1)
    with np.errstate(invalid="ignore"):
        # Weights that fall to the rim leave three quarters of the points' evidence; log(a²/b²) is twice log(a/b).
        evidence = 0.75 * half * np.log((wedges.quadric_rms**2 + floor) / (wedges.wedge_rms**2 + floor))
        tilt = 3.0 * lengths.noise / (0.5 * radius * np.sqrt(half))
        good = (wedges.angle > tilt) & (np.linalg.norm(wedges.foot - places, axis=1) <= reach)
        return _Comparison(np.nan_to_num(evidence, nan=-np.inf), np.where(good, np.degrees(wedges.angle), 0.0))


def fit_radius(noise: float) -> float:
    """Return the radius of the fits, in h, for a noise in h.

    A plane through a half-disc of radius r errs by an angle of about 1.13 (σ/h) / (r/h)². The smallest radius that keeps this
    below two degrees sees most: within a larger one a fillet looks sharper, and neighbouring edges blur.
    """
    return float(np.clip(np.sqrt(1.13 * noise / np.radians(TILT)), *RADII))
