"""How sure it is that a surface breaks along a crease, and is not rounded: likelihoods of bends, averaged along it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.chains import chains_of
from scan2nurbs.edges.operators import Lengths
from scan2nurbs.edges.pieces import Pieces, apart_from, choose, make_pieces
from scan2nurbs.kernels.alongside import mean_along
from scan2nurbs.kernels.bend_widths import FLOOR, Bends
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.sides import Meetings

# Mean logarithm of the likelihood ratio along a crease: how surely it bends where its being rounded rules out what narrower windows
# see. Against a rounding it may be negative where noise, from a quarter of h to h, hides where exactly the crease runs, which matters
# to a sharp bend most. Means over 4 h, repeated eight times, reach about 10 h either way.
EVIDENCE, HIDDEN, HIDING = 2.5, 0.9, (0.25, 1.0)
MEAN_REACH, MEANS = 4.0, 8
# The best of the bumps that noise makes look like short shallow creases. Pieces 10 h apart share no points, so that evidence adds up
# along a chain of pieces: that of a bend where they follow each other closer than 1.5 h, that of its sharpness closer than 2 h. Those
# belong to a chain that are by no more than so much likelier rounded. The whole chain has to be so much likelier sharp than rounded:
# folds of smooth surfaces are as common as creases, if blunt.
APART, FOLLOWS, WEAK = 10.0, (1.5, 2.0), 0.3
CREASE_SUM, FOLD_SUM = 0.5, 3.0
# Where residuals come from the shape of faces and not from noise, they do not average out: a sharp bend must be so much likelier
# there than a rounding, unless it turns by so many degrees that a rounding of that turn would be narrower than the spacing shows,
# or the bends leave so little of what they may leave that they are exact: half of what noise leaves, which tells nothing of the shape, and
# a quarter of the rest.
CLEARLY, BLUNT, ACUTE, EXACT = 2.0, 30.0, 75.0, 0.25
SURELY_NOISE = 0.5
# How near to a piece that is rather rounded, in h, what looks sharp through narrower windows does not count.
VETO, DOUBT = 2.0, -0.2


class WeighedPieces(NamedTuple):
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


def weigh(meetings: Meetings, bends: Bends, h: float) -> WeighedPieces:
    """Average the likelihoods of bends along the creases."""
    kept = np.flatnonzero(np.isfinite(bends.turn) & np.isfinite(bends.misfit).all(axis=1))
    if len(kept) == 0:
        return WeighedPieces(make_pieces(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), h), *np.zeros((3, 0)))
    feet = build_cells(bends.foot[kept], MEAN_REACH * h)
    kept = kept[feet.order]
    misfit = bends.misfit[kept]
    # Where even the best bend fits worse than the noise allows, all count for less.
    leftover = misfit.min(axis=1) / np.maximum(bends.n_points[kept] - 7, 1)
    likelihood = -0.5 * (misfit - misfit[:, -1:]) / np.maximum(leftover, 1.0)[:, None]
    values = np.ascontiguousarray(np.c_[likelihood[:, :-1], bends.turn[kept], leftover])
    direction, across = meetings.direction[kept], meetings.across[kept]
    up = np.cross(direction, across)
    for _ in range(MEANS):
        values = mean_along(feet, direction, up, values, MEAN_REACH * h, h)
    return WeighedPieces(Pieces(feet, direction, values[:, -2]), values[:, 0], values[:, 1:-2].max(axis=1), values[:, -1])


def sharp_pieces(weighed: WeighedPieces, least: float, total: float, lengths: Lengths) -> Pieces:
    """Keep the pieces that are sharp.

    Parameters
    ----------
    weighed : WeighedPieces
        What the windows said.
    least, total : float
        By how much a sharp bend must be likelier than one curved face: of each piece, and added up along its chain.
    lengths : Lengths
        Spacing and noise.

    Notes
    -----
    Whether a crease is sharp or a fold, its pieces tell together. A short crease of a freeform surface has little to say, so that
    it must say it clearly; a long edge of a part may be doubtful in places.
    """
    sharp, h = weighed.sharp, lengths.h
    shape = (FLOOR * h) ** 2 / ((FLOOR * h) ** 2 + lengths.noise**2)
    inexact = np.clip((weighed.leftover - SURELY_NOISE * (1.0 - shape)) / (EXACT * shape), 0.0, 1.0)
    blunt = np.clip((ACUTE - np.degrees(weighed.pieces.turn)) / (ACUTE - BLUNT), 0.0, 1.0)
    hidden = HIDDEN * np.interp(lengths.noise / h, HIDING, (0.0, 1.0))
    unrounded = sharp - weighed.rounded + hidden - CLEARLY * shape**2 * inexact * blunt
    good = np.flatnonzero((sharp > least) & (unrounded > -WEAK))
    close, loose = (chains_of(weighed.pieces.middles[good], follows * h) for follows in FOLLOWS)
    bends = sharp[good] * (1.0 + close.extent / (APART * h)) > total
    asked = (CREASE_SUM + FOLD_SUM * blunt[good]) * inexact[good]
    breaks = loose.mean(unrounded[good]) * (1.0 + loose.extent / (APART * h)) > asked
    return choose(weighed.pieces, good[bends & breaks], h)


def without_rounded(pieces: Pieces, seen: WeighedPieces, h: float) -> Pieces:
    """Leave out the pieces beside which a wider window saw a rounding, which may look sharp through a narrow one."""
    rounded = np.flatnonzero((seen.rounded > EVIDENCE) & (seen.sharp - seen.rounded <= DOUBT))
    return apart_from(pieces, choose(seen.pieces, rounded, h), VETO * h, h)
