"""Colours of faces, the same in pictures and in CAD files."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

_GOLDEN = 0.618034


def face_colours(n: int) -> NDArray[np.float64]:
    """Return n colours (n, 3), any two that follow each other far apart in hue, in three levels of lightness."""
    turns = (np.arange(n) * _GOLDEN) % 1.0
    return np.array([colorsys.hls_to_rgb(hue, (0.55, 0.42, 0.68)[k % 3], 0.62) for k, hue in enumerate(turns)]).reshape(-1, 3)
