"""Short pieces of creases: choosing, joining and straightening them, and the points that lie on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.alongside import mean_along, nearest_piece
from scan2nurbs.kernels.cells import Cells, build_cells
from scan2nurbs.kernels.nearest import nearest_to

# Half the length of a piece, and along how much of a crease its line is averaged, in h.
HALF_PIECE, ALIGN = 1.0, 2.5


class Pieces(NamedTuple):
    """Short pieces of creases, sorted into cells by their middles, with direction (K, 3) and turn (K,) in radians."""

    feet: Cells
    direction: NDArray[np.float64]
    turn: NDArray[np.float64]

    @property
    def middles(self) -> NDArray[np.float64]:
        """The middles (K, 3); the cells of no pieces hold one point that is none."""
        return self.feet.points[: len(self.turn)]


def make_pieces(middles: NDArray[np.float64], direction: NDArray[np.float64], turn: NDArray[np.float64], h: float) -> Pieces:
    """Sort pieces into cells."""
    if len(middles) == 0:
        return Pieces(build_cells(np.zeros((1, 3)), 1.0), np.zeros((0, 3)), np.zeros(0))
    feet = build_cells(middles, 2.0 * h)
    return Pieces(feet, np.ascontiguousarray(direction[feet.order]), turn[feet.order])


def choose(pieces: Pieces, which: NDArray[np.int64], h: float) -> Pieces:
    """Take some of the pieces."""
    return make_pieces(pieces.middles[which], pieces.direction[which], pieces.turn[which], h)


def join(a: Pieces, b: Pieces, h: float) -> Pieces:
    """Put pieces together."""
    middles, direction = np.concatenate((a.middles, b.middles)), np.concatenate((a.direction, b.direction))
    return make_pieces(middles, direction, np.concatenate((a.turn, b.turn)), h)


def apart_from(pieces: Pieces, others: Pieces, reach: float, h: float) -> Pieces:
    """Leave out the pieces closer than `reach` to others."""
    if len(pieces.turn) == 0 or len(others.turn) == 0:
        return pieces
    beside = nearest_piece(pieces.feet, others.feet, others.direction, HALF_PIECE * h, reach)
    return choose(pieces, np.flatnonzero(beside < 0), h)


def aligned(pieces: Pieces, h: float) -> Pieces:
    """Move the pieces across onto the mean line of those that carry on them."""
    if len(pieces.turn) == 0:
        return pieces
    step = mean_along(pieces.feet, pieces.direction, pieces.direction, pieces.middles, ALIGN * h, h) - pieces.middles
    step -= np.einsum("ki,ki->k", step, pieces.direction)[:, None] * pieces.direction
    return make_pieces(pieces.middles + step, pieces.direction, pieces.turn, h)


def pieces_under(cells: Cells, pieces: Pieces, reach: float, h: float) -> NDArray[np.int32]:
    """Return for each point the piece that it lies on, or −1: one closer than `reach`, or one of which it is the nearest point."""
    if len(pieces.turn) == 0:
        return np.full(len(cells.points), -1, np.int32)
    half = HALF_PIECE * h
    on = nearest_piece(cells, pieces.feet, pieces.direction, half, reach)
    index, distance = nearest_to(cells, pieces.middles, 1)
    alone = np.flatnonzero((distance[:, 0] < half) & (on[index[:, 0]] < 0))
    on[index[alone, 0]] = alone
    return on
