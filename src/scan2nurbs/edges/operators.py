"""The operators that measure how much a point looks like an edge: the paper's DN, VDN and EDN, and one-sided normals."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.border import Borders
from scan2nurbs.edges.normals import UNDEFINED, Normals, angles_between, normals_at
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.kernels.cells import Cells, unsorted
from scan2nurbs.kernels.differences import normal_differences
from scan2nurbs.kernels.one_sided import one_sided_planes
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.kernels.symmetric3 import weighted_angles

# One-sided normals: see one_sided().
NORMAL_PRECISION = math.radians(1.5)
RADIUS_RANGE = (3.0, 8.0)
NEIGHBOURS = 2.0
QUANTILE = 0.9


@dataclass(frozen=True)
class Lengths:
    """The lengths that an operator needs, in the cloud's unit: the spacings d̄ and h, and the noise."""

    spacing: float
    h: float
    noise: float


@dataclass(frozen=True)
class Strength:
    """What one run of an operator measured.

    Attributes
    ----------
    strength : (N,) float64
        Degrees in [0, 90]; NaN where it is undefined.
    normal : (N, 3) float64
        The normal at the larger radius, or the one-sided normal; NaN where undefined.
    dn, vdn_small, vdn_large : (N,) float64, or None
        The operators of the paper that the run computed.
    radii : dict
        Radii used, in the cloud's unit, by name.
    counts : dict
        How many neighbourhoods were degenerate, by kind.
    borders : Borders, or None
        Where the scan ends, if the operator looked.
    """

    strength: NDArray[np.float64]
    normal: NDArray[np.float64]
    dn: NDArray[np.float64] | None = None
    vdn_small: NDArray[np.float64] | None = None
    vdn_large: NDArray[np.float64] | None = None
    radii: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    borders: Borders | None = None


def in_input_order(found: Strength, cells: Cells) -> Strength:
    """Put what was measured of the sorted points into the order of the points that the cells were built from."""
    borders = None if found.borders is None else found.borders.unsorted(cells)
    return replace(found, strength=unsorted(cells, found.strength), normal=unsorted(cells, found.normal), borders=borders)


def run_operator(name: str, cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> Strength:
    """Run the operator of that name once on the points that the cells were built from; what it measured is in their order."""
    if name == "one-sided":
        return in_input_order(one_sided(cells, lengths, params, progress), cells)
    unit = 1.0 if params.absolute else lengths.spacing
    small_radius, large_radius = params.small_radius * unit, params.large_radius * unit
    sectors = 0 if name == "dn" else params.sectors

    def normals(radius: float) -> Normals:
        return normals_at(cells, radius, sectors=sectors, only_normals=True, exact=params.exact, input_order=True, progress=progress)

    large = normals(large_radius)
    if name == "vdn":
        return Strength(
            strength=large.sector_angle,
            normal=large.normal,
            vdn_large=large.sector_angle,
            radii={"large": large_radius},
            counts=_counts("large", large),
        )
    small = normals(small_radius)
    dn = angles_between(small.normal, large.normal)
    radii = {"small": small_radius, "large": large_radius}
    counts = _counts("small", small) | _counts("large", large)
    if name == "dn":
        return Strength(strength=dn, normal=large.normal, dn=dn, radii=radii, counts=counts)
    return Strength(
        strength=edn(dn, small.sector_angle, large.sector_angle, params.alpha),
        normal=large.normal,
        dn=dn,
        vdn_small=small.sector_angle,
        vdn_large=large.sector_angle,
        radii=radii,
        counts=counts,
    )


def edn(dn: NDArray[np.float64], vdn_small: NDArray[np.float64], vdn_large: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    """Combine DN and VDN (paper, eq. 2.4): α·DN + (1 − α)·max(VDN(r_s), VDN(r_l)), in degrees.

    An undefined VDN takes no part in the maximum. Where neither is defined, or DN is not, so is EDN, unless its weight is 0.
    """
    return weighted_angles(dn, vdn_small, vdn_large, alpha)


def one_sided(cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> Strength:
    """Measure how much one-sided normals differ about each sorted point.

    Each point takes the plane of the flattest ball that it fits, so that normals do not blur across an edge; its strength is
    the 90 % quantile of the angles between its normal and those of its neighbours within 2 h.

    Notes
    -----
    The radius follows the noise: a plane through the n = πr²/h² points of a ball is tilted by about 2σ/(r√n) = 2σh/(√π r²),
    and r makes that 1.5 degrees, but never below 3 h (28 points) nor above 8 h.
    """
    planes = one_sided_planes_of(cells, lengths, params, progress)
    strength = normal_differences(cells, planes.normal, NEIGHBOURS * lengths.h, QUANTILE, progress=progress)
    return Strength(strength=strength, normal=planes.normal, radii={"one_sided": planes.radius}, counts=planes.counts)


class SidedPlanes(NamedTuple):
    """Planes of balls of one radius, and which of them each point takes; all in the order of the sorted points."""

    radius: float
    normals: Normals
    chosen: NDArray[np.int32]

    @property
    def normal(self) -> NDArray[np.float64]:
        """The one-sided normals (N, 3); NaN where no ball within reach has a plane."""
        normal = self.normals.normal.take(self.chosen, axis=0, mode="clip")
        normal[self.chosen < 0] = np.nan
        return normal

    @property
    def counts(self) -> dict[str, int]:
        """How many of the balls were degenerate, by kind."""
        return _counts("one_sided", self.normals)


def one_sided_planes_of(cells: Cells, lengths: Lengths, params: EdgeParams, progress: Progress | None = None) -> SidedPlanes:
    """Choose for each point the flattest ball that it fits, of a radius that follows the noise."""
    unit = 1.0 if params.absolute else lengths.h
    if params.radius is not None:
        radius = params.radius * unit
    else:
        wanted = math.sqrt(2.0 / math.sqrt(math.pi) * lengths.noise / lengths.h / NORMAL_PRECISION)
        radius = lengths.h * min(max(wanted, RADIUS_RANGE[0]), RADIUS_RANGE[1])
    normals = normals_at(cells, radius, progress=progress)
    return SidedPlanes(radius, normals, one_sided_planes(cells, normals.balls, radius, lengths.noise, progress=progress))


def _counts(name: str, normals: Normals) -> dict[str, int]:
    status = normals.status
    counts = {
        f"{name}_normals_widened": int(np.count_nonzero((status > 0) & (status < UNDEFINED))),
        f"{name}_normals_undefined": int(np.count_nonzero(status == UNDEFINED)),
    }
    if len(normals.sector_angle):
        counts[f"{name}_sectors_undefined"] = int(np.count_nonzero(np.isnan(normals.sector_angle)))
    return counts
