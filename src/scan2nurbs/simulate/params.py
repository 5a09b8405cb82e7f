"""What a simulated scan depends on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scan2nurbs.errors import ParameterError
from scan2nurbs.ranges import require_choice, require_float, require_int

Mode = Literal["scanner", "grid", "random", "uneven"]
Direction = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class SimulateParams:
    """Parameters of `simulate_scan`.

    Lengths called relative are in units of the scan's mean spacing h = sqrt(scanned area / points).

    Attributes
    ----------
    n_points : int or None
        Points of the scan, outliers included, [10, 1e9]; hit exactly.
    spacing : float or None
        Mean spacing h wanted instead, in the part's unit, (0, inf). Just one of the two is given; default 100,000 points.
    mode : str
        "scanner": rays from `views` into a depth buffer, so that what is hidden or grazed is missing; "grid": a jittered raster over
        every face, hidden or not; "random": uniform; "uneven": random, with a density that varies sixfold over the part.
    views : int or tuple of directions
        From where the scanner looks: so many directions spread over a cap around `up`, [1, 1000], or the directions towards the scanner.
    spread : float
        Half angle of the cap in degrees, [0, 180]: 0 looks from `up` only, 90 covers the upper half, 180 goes all around.
    up : (3,) float
        Direction of the middle of the cap, and of the only view where `views` is 1.
    overlap : str
        "thin": every place is measured by the view that sees it most squarely, so that the density is even; "keep": by all views
        that see it, each with its own noise.
    parallax : float
        Angle in degrees between the scanner's eye and its projector, [0, 80]: what the projector does not light is missing too.
    grazing_limit : float
        Largest angle in degrees between a ray and the surface's normal that is measured, (0, 90).
    grazing_fade : float
        Degrees below the limit over which the chance to be measured falls from one to zero, [0, 80].
    jitter : float
        How far rays stray from a perfect raster, in pixels, [0, 0.5].
    noise : float
        Standard deviation along the ray at square incidence (along the normal in the modes without rays), relative, [0, inf).
    noise_across : float
        Standard deviation in the two directions across the ray, relative, [0, inf).
    noise_growth : float
        The noise along the ray is divided by cos(incidence) to this power, [0, 3]; 1 makes the deviation from the surface the same
        everywhere.
    noise_unit : str
        "spacing": `noise` and `noise_across` are relative; "length": they are in the part's unit.
    outliers : float
        Share of all points that belong to no face, [0, 0.9]: half of them anywhere in the part's box, half 3 to 15 h beside a point.
    holes : int
        Number of round patches that are missing, [0, 1e6].
    hole_radius : float
        Their radius, relative, (0, inf).
    shuffle : bool
        Whether the rows come in random order; else view by view (or face by face), outliers last.
    seed : int
        Of everything random, [0, 2**63).
    """

    n_points: int | None = None
    spacing: float | None = None
    mode: Mode = "scanner"
    views: int | tuple[Direction, ...] = 12
    spread: float = 180.0
    up: Direction = (0.0, 0.0, 1.0)
    overlap: Literal["thin", "keep"] = "thin"
    parallax: float = 0.0
    grazing_limit: float = 75.0
    grazing_fade: float = 15.0
    jitter: float = 0.25
    noise: float = 0.1
    noise_across: float = 0.0
    noise_growth: float = 1.0
    noise_unit: Literal["spacing", "length"] = "spacing"
    outliers: float = 0.0
    holes: int = 0
    hole_radius: float = 8.0
    shuffle: bool = True
    seed: int = 1

    def __post_init__(self) -> None:
        if self.n_points is not None and self.spacing is not None:
            raise ParameterError("Only one of 'n_points' and 'spacing' of simulate_scan may be given.")
        if self.n_points is not None:
            require_int(self.n_points, "n_points", _OWNER, 10, MOST_POINTS)
        if self.spacing is not None:
            require_float(self.spacing, "spacing", _OWNER, 0)
        require_choice(self.mode, "mode", _OWNER, ("scanner", "grid", "random", "uneven"))
        require_choice(self.overlap, "overlap", _OWNER, ("thin", "keep"))
        require_choice(self.noise_unit, "noise_unit", _OWNER, ("spacing", "length"))
        if isinstance(self.views, int):
            require_int(self.views, "views", _OWNER, 1, 1000)
        else:
            _require_directions(self.views, "views")
        _require_directions((self.up,), "up")
        for name, high in _FROM_ZERO.items():
            require_float(getattr(self, name), name, _OWNER, 0, high, closed="low" if high == math.inf else "both")
        require_float(self.grazing_limit, "grazing_limit", _OWNER, 0, 90)
        require_float(self.hole_radius, "hole_radius", _OWNER, 0)
        require_int(self.holes, "holes", _OWNER, 0, 10**6)
        require_int(self.seed, "seed", _OWNER, 0, 2**63 - 1)


MOST_POINTS = 10**9
_OWNER = "simulate_scan"

_FROM_ZERO = {
    "spread": 180.0,
    "parallax": 80.0,
    "grazing_fade": 80.0,
    "jitter": 0.5,
    "noise": math.inf,
    "noise_across": math.inf,
    "noise_growth": 3.0,
    "outliers": 0.9,
}
"""Largest values of the plain numbers, whose ranges start at zero and hold their ends."""


def _require_directions(directions: Any, name: str) -> None:
    try:
        rows = np.asarray(directions, dtype=np.float64)
        right = rows.ndim == 2 and rows.shape[1] == 3 and len(rows) > 0 and np.isfinite(rows).all() and (rows != 0).any(axis=1).all()
    except (TypeError, ValueError):
        right = False
    if not right:
        what = "a direction (x, y, z)" if name == "up" else "an int in [1, 1000] or directions (x, y, z)"
        raise ParameterError(f"The '{name}' parameter of simulate_scan must be {what}, finite and not zero. Got {directions!r} instead.")
