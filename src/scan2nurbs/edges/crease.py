"""The default operator: a point is on an edge where two faces meet more sharply than any rounding, or one curved face, explains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.border import find_borders
from scan2nurbs.edges.evidence import WeighedPieces, sharp_pieces, weigh, without_rounded
from scan2nurbs.edges.operators import NEIGHBOURS, QUANTILE, RADIUS_RANGE, Lengths, Strength, in_input_order, one_sided_planes_of
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.edges.pieces import Pieces, aligned, apart_from, join, pieces_under
from scan2nurbs.edges.spacings import Spacing, at_spacing, spacings_of
from scan2nurbs.kernels.bend_widths import Bends, fit_bends
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.differences import normals_differ
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
# A second look with the narrowest window is worth its time where the first is wider than this times it; within so many h the first
# look has found the crease itself.
FINER, SAME = 1.15, 2.0
# The evidence of a bend that is asked for, at each piece and along a chain of them: less through narrow windows, as more of them lie
# along it.
WIDE_EVIDENCE, NARROW_EVIDENCE = (2.5, 10.0), (2.0, 4.0)
# How far from the crease points are marked, in h.
REACH = 0.6


def crease(cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> Strength:
    """Measure by how many degrees the surface turns at a crease beside each point; 0 where there is none within reach.

    Where one-sided normals differ (see `one_sided`), the planes about a point are averaged into two sides, which meet in a line. Bends
    of several widths are fitted to the points about that line, as far as two faces explain them: sharp ones, rounded ones and one
    curved face. The logarithms of their likelihoods are averaged along the crease. Where the sharp bend is likely enough, the
    points within `reach` of it are on the edge. So are, with 90 degrees, the points where the surface ends (see `find_borders`).
    Where points lie farther apart than elsewhere, all lengths are longer (see `spacings`).

    Notes
    -----
    Normals that differ say that a surface bends; only the width says whether it bends or breaks. A window of a few spacings holds too
    few points to tell in noise, and a wider one other edges; but a crease is long, and what a rounding looks like is the same all
    along it. So wide windows are looked through first, and narrow ones for what is too fine for these. Candidates are a few per cent of the
    points, at about 100 µs each.
    """
    strength = np.zeros(len(cells.points))
    first: Look | None = None
    windows: list[float] = []
    n_places = n_pieces = 0
    for spacing in spacings_of(cells, lengths.h):
        local = replace(lengths, h=spacing.h)
        pieces, looks = _creases(cells, local, params, spacing, progress)
        nearest = pieces_under(cells, aligned(pieces, local.h), _reach(params, local.h), local.h)
        on = np.flatnonzero(nearest >= 0)
        strength[on] = np.maximum(strength[on], np.minimum(np.degrees(pieces.turn[nearest[on]]), 90.0))
        first = first or looks[0]
        windows += [look.window for look in looks]
        n_places += sum(look.n_places for look in looks)
        n_pieces += len(pieces.turn)
    assert first is not None  # a cloud has its own spacing, at least
    borders = find_borders(cells, first.normal, lengths.h, lengths.noise)
    strength[first.differs < 0] = np.nan
    strength[borders.outline] = 90.0
    named = {f"window_{k + 1}" if k else "window": window for k, window in enumerate(windows)}
    found = Strength(
        strength=strength,
        normal=first.normal,
        radii={"one_sided": first.radius} | named | {"reach": _reach(params, lengths.h)},
        counts=first.counts | {"crease_candidates": n_places, "crease_pieces": n_pieces, "border_points": int(borders.outline.sum())},
        borders=borders,
    )
    return in_input_order(found, cells)


def _reach(params: EdgeParams, h: float) -> float:
    """Return how far from a crease points are marked, in the cloud's unit."""
    if params.reach is None:
        return REACH * h
    return params.reach * (1.0 if params.absolute else h)


class Look(NamedTuple):
    """What was seen through windows of one width; normals, and where they differ, are of all points."""

    window: float
    radius: float
    normal: NDArray[np.float64]
    differs: NDArray[np.int8]
    counts: dict[str, int]
    n_places: int
    weighed: WeighedPieces


def _creases(cells: Cells, lengths: Lengths, params: EdgeParams, where: Spacing, progress: Progress | None) -> tuple[Pieces, list[Look]]:
    """Find the sharp pieces of creases, through wide windows first, and through narrow ones where noise asked for wide ones."""
    h, narrowest = lengths.h, WINDOW_RANGE[0] * lengths.h
    window = float(np.clip(WINDOW * math.sqrt(lengths.noise / h), *WINDOW_RANGE)) * h
    wide = _look(cells, lengths, params, window, where, progress)
    pieces = sharp_pieces(wide.weighed, *WIDE_EVIDENCE, lengths)
    if params.radius is not None or window <= FINER * narrowest:
        return pieces, [wide]
    fine = _look(cells, lengths, replace(params, radius=RADIUS_RANGE[0], absolute=False), narrowest, where, progress)
    more = apart_from(sharp_pieces(fine.weighed, *NARROW_EVIDENCE, lengths), pieces, SAME * h, h)
    return join(pieces, without_rounded(more, wide.weighed, h), h), [wide, fine]


def _look(cells: Cells, lengths: Lengths, params: EdgeParams, window: float, where: Spacing, progress: Progress | None) -> Look:
    """Fit bends in windows of one width wherever one-sided normals differ."""
    planes = one_sided_planes_of(cells, lengths, params, progress)
    normal = planes.normal
    differs = normals_differ(cells, normal, NEIGHBOURS * lengths.h, QUANTILE, CANDIDATE, progress=progress)
    places = at_spacing(cells, np.flatnonzero(differs > 0), where)
    meetings = meeting_sides(cells, planes.normals.balls, planes.chosen, places, SIDES * lengths.h)
    meetings, bends = _bends(cells, places, meetings, window, lengths)
    return Look(window, planes.radius, normal, differs, planes.counts, len(places), weigh(meetings, bends, lengths.h))


def _bends(cells: Cells, places: NDArray[np.int64], meetings: Meetings, window: float, lengths: Lengths) -> tuple[Meetings, Bends]:
    """Fit the bends twice, the second time about the crease that the first found."""

    def fit(about: Meetings, widths: Sequence[float]) -> Bends:
        about.turn[farther(about.foot, SIDES)] = np.nan
        return fit_bends(
            cells,
            places,
            about,
            across=window,
            along=LONGER * window,
            noise=lengths.noise,
            spacing=lengths.h,
            widths=np.array(widths) * lengths.h,
        )

    def farther(foot: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        return ~(np.linalg.norm(foot - cells.points[places], axis=1) < reach * lengths.h)

    meetings = meetings._replace(foot=fit(meetings, WIDTHS[:1]).foot)  # the crease is where the sharp bend is
    bends = fit(meetings, WIDTHS)
    bends.turn[farther(bends.foot, TELLING)] = np.nan
    return meetings, bends
