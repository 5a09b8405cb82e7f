"""The default operator: a point is on an edge where two faces that meet explain its neighbourhood better than one curved face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.operators import Lengths, Strength, one_sided
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.creases import fit_wedges
from scan2nurbs.kernels.runner import Progress

# Where one-sided normals differ by less than this, in degrees, nothing is tried: fainter creases are lost in noise.
CANDIDATE = 10.0
# Logarithm of the likelihood ratio that is asked for. A wedge is the best of 57 splits (4 = log 57), and its extra parameters
# must pay too (4: two of them, at half the logarithm of some fifty points each).
EVIDENCE = 8.0
# Residuals of less than this part of the spacing are no evidence: sampled shapes are never exact planes or quadrics.
FLOOR = 0.03
# The angle by which noise may tilt a fitted half-plane, in degrees, and the radii of the fits, in h.
TILT = 2.0
RADII = (4.0, 8.0)
WIDER = 2.0
# How far from an edge, in h, the bands of one-sided normals reach.
BAND = 3.0


def crease(cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> Strength:
    """Measure by how many degrees the surface turns at a crease near each point; 0 where one curved face explains it as well.

    Where one-sided normals differ (see `one_sided`), two half-planes and a quadric are fitted to the points about, with weights
    that fall to the rim and against points of a third face. The half-planes must be so much better that the logarithm of the
    likelihood ratio, n·log(rms of the quadric / rms of the half-planes), exceeds 8, and turn by more than noise could tilt
    them; and the line in which they meet must pass within `reach` of the point.

    Notes
    -----
    Normals that differ say that a surface bends; only the comparison says whether it bends or breaks. A fillet or a ridge whose radius
    is several spacings is a better quadric than a wedge, and is no edge. Small neighbourhoods tell fillets from creases, but see
    shallow creases only in little noise: where they leave it open, twice the radius decides. Candidates are few: about 50 to
    200 µs each.
    """
    candidates = one_sided(cells, lengths, params, progress)
    chosen = np.flatnonzero(candidates.strength > CANDIDATE)
    reach = lengths.h + lengths.noise if params.reach is None else params.reach * (1.0 if params.absolute else lengths.h)
    radius = fit_radius(lengths.noise / lengths.h) * lengths.h
    near = _compare(cells, cells.points[chosen], radius, lengths, reach)
    turn = np.where(near.evidence > EVIDENCE, near.turn, 0.0)
    open_ = np.flatnonzero((near.evidence > 0.0) & (near.evidence <= EVIDENCE))
    far = _compare(cells, cells.points[chosen[open_]], WIDER * radius, lengths, reach)
    turn[open_] = np.where(far.evidence > EVIDENCE, far.turn, 0.0)
    strength = np.where(np.isnan(candidates.strength), np.nan, 0.0)
    strength[chosen] = np.minimum(turn, 90.0)
    return Strength(
        strength=strength,
        normal=candidates.normal,
        radii=candidates.radii | {"wedge": radius, "wedge_wider": WIDER * radius},
        counts=candidates.counts | {"crease_candidates": len(chosen), "crease_candidates_wider": len(open_)},
    )


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
    found = (near.evidence > EVIDENCE) & (near.turn > 0.0)
    open_ = np.flatnonzero((near.evidence > 0.0) & ~found)
    far = _compare(cells, places[open_], WIDER * radius, lengths, reach)
    found[open_] = (far.evidence > EVIDENCE) & (far.turn > 0.0)
    return found


class _Comparison(NamedTuple):
    """Two half-planes against one quadric: the log likelihood ratio, and the turn in degrees of a crease within reach, else 0."""

    evidence: NDArray[np.float64]
    turn: NDArray[np.float64]


def _compare(cells: Cells, places: NDArray[np.float64], radius: float, lengths: Lengths, reach: float) -> _Comparison:
    places = np.ascontiguousarray(places)
    wedges = fit_wedges(cells, places, radius, lengths.noise, rounds=2)
    floor = max(FLOOR * lengths.h, 0.2 * lengths.noise) ** 2
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
