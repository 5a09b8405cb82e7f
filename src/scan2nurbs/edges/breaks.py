"""Whether a surface breaks near a place, told by one fit of two half-planes and one of a quadric."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.operators import Lengths
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.creases import Wedges, fit_wedges

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
    evidence, tilt = wedge_evidence(wedges, radius, lengths.h, lengths.noise)
    with np.errstate(invalid="ignore"):
        good = (wedges.angle > tilt) & (np.linalg.norm(wedges.foot - places, axis=1) <= reach)
        return _Comparison(np.nan_to_num(evidence, nan=-np.inf), np.where(good, np.degrees(wedges.angle), 0.0))


def wedge_evidence(wedges: Wedges, radius: float, h: float, noise: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the log likelihood ratios of two half-planes against one quadric, and the angles that noise alone would give, in radians."""
    floor = max(WEDGE_FLOOR * h, 0.2 * noise) ** 2
    half = np.maximum(wedges.n_points, 1)
    with np.errstate(invalid="ignore"):
        # Weights that fall to the rim leave three quarters of the points' evidence; log(a²/b²) is twice log(a/b).
        evidence = 0.75 * half * np.log((wedges.quadric_rms**2 + floor) / (wedges.wedge_rms**2 + floor))
    return evidence, 3.0 * noise / (0.5 * radius * np.sqrt(half))


def fit_radius(noise: float) -> float:
    """Return the radius of the fits, in h, for a noise in h.

    A plane through a half-disc of radius r errs by an angle of about 1.13 (σ/h) / (r/h)². The smallest radius that keeps this
    below two degrees sees most: within a larger one a fillet looks sharper, and neighbouring edges blur.
    """
    return float(np.clip(np.sqrt(1.13 * noise / np.radians(TILT)), *RADII))
