"""The paper's experiments, figure by figure, with its parameters."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import scan2nurbs as s2n
from scan2nurbs.edges.params import EdgeParams

from .truth import EdgeScore, Mask, StandIn, score_edges

DELTA = 20.0
ROBUST = "one-sided normals (default)"
SEQUENCE = "VDN three times, then DN"
FIG7: dict[str, Any] = {"small_radius": 1.5, "large_radius": 10.0, "threshold": DELTA}
FIG9: dict[str, Any] = {"small_radius": 1.5, "large_radius": 20.0, "threshold": DELTA}
FIG11: dict[str, Any] = {"small_radius": 1.5, "large_radius": 30.0, "threshold": DELTA}


@dataclass(frozen=True)
class Detected:
    """What one operator marked on one cloud.

    Attributes
    ----------
    name : str
        The operator as the page calls it.
    mask : (N,) bool
    score : EdgeScore
    seconds, cpu : float
        Wall time, and processor time of all threads, of the whole call: spacing, noise and normals included.
    no_plane, no_sector : float
        Share of the points whose ball of r_s carries no plane, and of those in which fewer than two sectors of it carry one; NaN where
        the operator does not ask.
    delta : float
        δ in degrees.
    """

    name: str
    mask: Mask
    score: EdgeScore
    seconds: float
    cpu: float
    no_plane: float
    no_sector: float
    delta: float = DELTA


def detected(cloud: StandIn, name: str, **params: Any) -> Detected:
    """Run an operator on a stand-in and compare with the truth."""
    start, cpu = time.perf_counter(), time.process_time()
    edges = s2n.detect_edges(cloud.points, EdgeParams(**params))
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    widened, undefined = (edges.counts.get(f"small_normals_{kind}", np.nan) for kind in ("widened", "undefined"))
    sectors = edges.counts.get("small_sectors_undefined", np.nan)
    n, single = len(cloud), len(edges.runs) == 1
    return Detected(
        name=name,
        mask=edges.mask,
        score=score_edges(cloud, edges.mask),
        seconds=seconds,
        cpu=cpu,
        no_plane=(widened + undefined) / n if single else np.nan,
        no_sector=sectors / n if single else np.nan,
        delta=edges.threshold,
    )


def repeated(cloud: StandIn) -> list[Detected]:
    """Fig. 7: DN and VDN, applied 1, 2 and 3 times."""
    return [detected(cloud, run_name(operator, k), operator=operator, repeat=k, **FIG7) for operator in ("dn", "vdn") for k in (1, 2, 3)]


def run_name(operator: str, k: int) -> str:
    """Return how the page calls k runs of an operator."""
    return f"{operator.upper()}, {('once', 'twice', 'three times')[k - 1]}"


def in_sequence(cloud: StandIn) -> Detected:
    """Fig. 8: VDN three times, then DN."""
    return detected(cloud, SEQUENCE, sequence="vdn*3, dn", **FIG7)


def combined(cloud: StandIn, alphas: Sequence[float], given: dict[str, Any]) -> list[Detected]:
    """Figs. 9 and 11: EDN with several α and β = 1 − α."""
    return [detected(cloud, edn_name(alpha), operator="edn", alpha=alpha, **given) for alpha in alphas]


def edn_name(alpha: float) -> str:
    """Return how the page calls EDN with that α."""
    return f"EDN, α = {alpha:.1f}, β = {1 - alpha:.1f}"


def robust(cloud: StandIn) -> Detected:
    """Run what `surface` does by default, for comparison: one-sided normals, everything chosen from the cloud."""
    return detected(cloud, ROBUST, operator="one-sided")


FIG9_ALPHAS = (1.0, 0.4, 0.6, 0.0)
FIG11_ALPHAS = (0.0, 0.3, 0.6, 1.0)  # the paper has no α = 1, but speaks of DN there

NOISES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Standard deviations of the noise, in h."""

DELTAS = tuple(range(10, 90, 5))


def at_noise(cloud: StandIn) -> dict[str, Detected]:
    """Run every operator once on a cloud; "EDN, best δ" takes the δ that the truth says is best."""
    runs = [*repeated(cloud), in_sequence(cloud), *combined(cloud, FIG9_ALPHAS, FIG9), best_edn(cloud), robust(cloud)]
    return {run.name: run for run in runs}


def best_edn(cloud: StandIn) -> Detected:
    """Run EDN of Fig. 9 with α = 0.4 and the threshold with the best F1, chosen by the truth: more than a user could do."""
    given = EdgeParams(operator="edn", alpha=0.4, **FIG9)
    strength = s2n.detect_edges(cloud.points, given).strength
    masks = {delta: strength > delta for delta in DELTAS}
    delta = max(masks, key=lambda d: score_edges(cloud, masks[d]).f1)
    return Detected(BEST, masks[delta], score_edges(cloud, masks[delta]), np.nan, np.nan, np.nan, np.nan, delta=float(delta))


BEST = "EDN, best δ"
