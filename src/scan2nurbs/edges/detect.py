"""Find the points of a cloud that lie on edges: operators run one after the other, each on what the previous one kept."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.border import Borders
from scan2nurbs.edges.crease import crease
from scan2nurbs.edges.operators import Lengths, Strength, run_operator
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.scale import Scale

PAPER_THRESHOLD = 20.0
# Faces that turn by less meet smoothly, as most CAD systems have it.
CREASE_THRESHOLD = 12.0


@dataclass(frozen=True)
class Edges:
    """Which points lie on an edge, and why.

    Attributes
    ----------
    strength : (N,) float64
        What the operator measured, in degrees in [0, 90]: of the last run that saw the point. NaN where it is undefined.
    mask : (N,) bool
        Points on an edge: those whose strength exceeds the threshold in every run.
    normal : (N, 3) float64
        Unit normals as lines, at the larger radius or one-sided; NaN where undefined.
    dn, vdn_small, vdn_large : (N,) float64, or None
        DN, and VDN at the small and the large radius, in degrees, where the operator computes them.
    threshold : float
        δ in degrees.
    spacing, h, noise : float
        d̄ of eq. 2.1, the noise-stable spacing and the standard deviation of the noise, in the cloud's unit.
    radii : dict
        The radii used, in the cloud's unit.
    runs : tuple of (str, int)
        Each run's operator and how many points it kept.
    counts : dict
        Degenerate neighbourhoods of all runs, by kind.
    kind : (N,) uint8, or None
        0 on no edge, 1 convex, 2 concave, 3 border of the scan, 4 corner; where it was asked for (see `edges.kinds`).
    angle, angle_error : (N,) float64, or None
        Degrees by which the surface turns at the edge, and their standard deviation; NaN on no edge.
    confidence : (N,) float64, or None
        How sure edge and kind are, in [0, 1]; 0 on no edge.
    borders : Borders, or None
        Where the scan ends, until the kinds of edges say it.
    """

    strength: NDArray[np.float64]
    mask: NDArray[np.bool_]
    normal: NDArray[np.float64]
    dn: NDArray[np.float64] | None
    vdn_small: NDArray[np.float64] | None
    vdn_large: NDArray[np.float64] | None
    threshold: float
    spacing: float
    h: float
    noise: float
    radii: dict[str, float] = field(default_factory=dict)
    runs: tuple[tuple[str, int], ...] = field(default=())
    counts: dict[str, int] = field(default_factory=dict)
    kind: NDArray[np.uint8] | None = None
    angle: NDArray[np.float64] | None = None
    angle_error: NDArray[np.float64] | None = None
    confidence: NDArray[np.float64] | None = None
    borders: Borders | None = None


def detect(points: NDArray[np.float64], scale: Scale, params: EdgeParams, progress: Progress | None = None) -> Edges:
    """Run the operators of `params` on a cloud.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points.
    scale : Scale
        What `measure_scale` said of them.
    params : EdgeParams
        Operators, radii, weights and threshold.
    progress : callable, optional
        Called with (cells done, cells) by each pass over the cloud.

    Notes
    -----
    "Applied iteratively" (paper, section 3) means: a further run sees only the points that the previous one kept, with
    neighbours among them and radii unchanged.
    """
    params = params.resolved("crease")
    lengths = Lengths(spacing=scale.spacing, h=scale.h, noise=scale.noise)
    threshold = params.threshold if params.threshold is not None else _threshold(params, lengths)
    kept: NDArray[np.int64] | None = None  # all
    collected = _Collector(len(points))
    runs: list[tuple[str, int]] = []
    for name in params.runs():
        cells = scale.cells if kept is None else build_cells(points[kept], scale.cells.size)
        run = crease if name == "crease" else partial(run_operator, name)
        collected.add(run(cells, lengths, params, progress), kept)
        above = collected.strength > threshold  # NaN is never larger
        kept = np.flatnonzero(above) if kept is None else kept[above[kept]]
        runs.append((name, len(kept)))
        if len(kept) < 3:
            break
    mask = np.zeros(len(points), bool)
    mask[kept] = True
    return Edges(
        strength=collected.strength,
        mask=mask,
        normal=collected.values["normal"],
        dn=collected.values.get("dn"),
        vdn_small=collected.values.get("vdn_small"),
        vdn_large=collected.values.get("vdn_large"),
        threshold=threshold,
        spacing=scale.spacing,
        h=scale.h,
        noise=scale.noise,
        radii=collected.radii,
        runs=tuple(runs),
        counts=collected.counts,
        borders=collected.borders,
    )


def _threshold(params: EdgeParams, lengths: Lengths) -> float:
    """Choose δ: the paper's 20 degrees, 12 for creases, or for one-sided normals what their own scatter cannot reach."""
    if "crease" in params.runs():
        return CREASE_THRESHOLD
    if "one-sided" not in params.runs():
        return PAPER_THRESHOLD
    # Wherever the radius meets its bounds the normals' tilt grows with the noise, and their quantile with it.
    return min(18.0 + 10.0 * lengths.noise / lengths.h, 30.0)


class _Collector:
    """Gathers the results of the runs in the cloud's order; a later run overwrites what it saw."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.values: dict[str, NDArray[np.float64]] = {}
        self.radii: dict[str, float] = {}
        self.counts: dict[str, int] = {}
        self.borders: Borders | None = None

    @property
    def strength(self) -> NDArray[np.float64]:
        return self.values["strength"]

    def add(self, result: Strength, kept: NDArray[np.int64] | None) -> None:
        """Take what was measured of the points `kept` (None: of all), in their order."""
        for name in ("strength", "normal", "dn", "vdn_small", "vdn_large"):
            values = getattr(result, name)
            if values is None:
                continue
            if kept is None:
                self.values[name] = values
                continue
            if name not in self.values:
                self.values[name] = np.full((self.n, *values.shape[1:]), np.nan)
            self.values[name][kept] = values
        self.borders = self.borders or result.borders  # only the first run sees all points
        self.radii |= result.radii
        for name, count in result.counts.items():
            self.counts[name] = self.counts.get(name, 0) + count
