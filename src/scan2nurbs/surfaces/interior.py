"""Tell the points inside a face from those along its border, where labels err."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.surfaces.shape import Floats

_NEIGHBOURS = 16
_ONE_SIDED = 0.35  # a half-plane's points have their centroid 0.42 radii away
_CLOSE = 9
_FEWEST = 150
_LEAST_SHARE = 0.5


def interior(points: Floats) -> NDArray[np.bool_]:
    """Mark the points (N,) that have neighbours of their face all around; all of them where the face is small or narrow.

    Parameters
    ----------
    points : (N, 3) float64
        Of one face.
    """
    everywhere = np.ones(len(points), np.bool_)
    if len(points) < _FEWEST:
        return everywhere
    distance, index = KDTree(points).query(points, k=_NEIGHBOURS)
    index = np.asarray(index)
    away = np.linalg.norm(points[index].mean(axis=1) - points, axis=1)
    inside = away < _ONE_SIDED * distance[:, -1]
    # Labels err two spacings deep where they err.
    for mask in (inside[index[:, :_CLOSE]].all(axis=1), inside):
        if np.mean(mask) >= _LEAST_SHARE:
            return mask
    return everywhere
