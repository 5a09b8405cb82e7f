"""What a reader returns: the rows of a scan file, as they stand in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scan:
    """The points of a scan file, row for row.

    Attributes
    ----------
    points : (N, 3) float64
        Every row of the file in its order, in the file's own unit and coordinates. Rows that are no point hold NaN.
    unit : str or None
        "mm", "m", "cm", "um", "in" or "ft" as the format or its header says; None where the file carries no unit.
    format : str
        Name of the format as a user would say it, e.g. "PLY (binary little-endian)".
    notes : tuple of str
        What was guessed or left out, one sentence each.
    """

    points: NDArray[np.float64]
    unit: str | None
    format: str
    notes: tuple[str, ...] = field(default=())
