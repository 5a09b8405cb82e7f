"""Places where points lie farther apart than elsewhere: there, lengths that count in spacings have to be longer."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.nearest import nearest_to

# The spacing at a place is measured by as many nearest points: to within 7 %.
NEIGHBOURS = 48
# Each spacing is that much longer than the one before, and serves places whose own is nearer to it than to the others, but for a
# margin by which the ranges overlap. One is worth its time where this part of the points lies in it.
STEP, STEPS, MARGIN, SHARE = math.sqrt(2.0), 4, 1.1, 0.03
_SAMPLE = 4000


class Spacing(NamedTuple):
    """A spacing, and the range of local spacings that it serves."""

    h: float
    low: float
    high: float


def spacings_of(cells: Cells, h: float) -> list[Spacing]:
    """Return the spacings at which a cloud has to be looked at, the first of them its own.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    h : float
        The spacing of the whole cloud.
    """
    n = len(cells.points)
    local = _local(cells, np.linspace(0, n - 1, min(n, _SAMPLE)).astype(np.int64)) / h
    bounds = math.sqrt(STEP) * STEP ** np.arange(STEPS)
    used = 1 + int(np.sum([(local > bound).mean() > SHARE for bound in bounds]))
    return [
        Spacing(h * STEP**k, h * bounds[k - 1] / MARGIN if k else 0.0, h * bounds[k] * MARGIN if k + 1 < used else np.inf)
        for k in range(used)
    ]


def at_spacing(cells: Cells, places: NDArray[np.int64], spacing: Spacing) -> NDArray[np.int64]:
    """Return those of the sorted points where the local spacing is in the range."""
    if spacing.low == 0.0 and spacing.high == np.inf:
        return places
    local = _local(cells, places)
    return places[(local >= spacing.low) & (local < spacing.high)]


def _local(cells: Cells, places: NDArray[np.int64]) -> NDArray[np.float64]:
    k = min(NEIGHBOURS, len(cells.points) - 1)
    return nearest_to(cells, cells.points[places], k + 1)[1][:, k] * math.sqrt(math.pi / k)
