"""All experiments, in the order of the paper's figures."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

import scan2nurbs as s2n
from scan2nurbs.edges.thin import approximate_boundary
from scan2nurbs.faces.inside import enclosed_by_centroid
from scan2nurbs.kernels.runner import thread_count

from . import experiments as ex
from .clouds import Model
from .draw import draw_lines
from .experiments import Detected
from .pictures import marks_sheet, procedure_sheet
from .procedure import THIN_RADIUS, DefaultRun, PaperRun, as_in_the_paper, by_default
from .truth import InsideScore, LineScore, StandIn, score_inside, score_line

SMALL = ("shallow_step", "insert")
OUTLINES = ("shallow_step", "insert", "convex", "star", "ring", "l_shape", "u_shape")
OUTLINE_NOISE = 0.1
WIDE_DELTA = 40.0
"""δ of the second run of the default procedure on the insert, whose ridge turns by more than the default δ."""


@dataclass(frozen=True)
class Outline:
    """Inside and outside of one outline: Algorithm 3 with the exact border, and the default procedure with the scan alone."""

    n_points: int
    algorithm3: InsideScore
    default: InsideScore | None


@dataclass(frozen=True)
class Premise:
    """Algorithm 2's premise, that marked points lie on both sides of the border, and what follows from it.

    Attributes
    ----------
    inner : float
        Share of the points marked within 4 h of the border that are inside.
    ideal : tuple of LineScore
        After 1, 2 and 3 times Algorithm 2 from the perfect band: all points within 2 h of the true border, on both sides.
    """

    inner: float
    ideal: tuple[LineScore, ...]


@dataclass
class Results:
    """What the gallery's experiments gave; `noise` maps part and noise to what was run there."""

    clouds: dict[str, StandIn] = field(default_factory=dict)
    marks: dict[str, dict[str, Detected]] = field(default_factory=dict)
    noise: dict[str, dict[float, dict[str, Detected]]] = field(default_factory=dict)
    paper: dict[str, dict[float, PaperRun]] = field(default_factory=dict)
    default: dict[str, dict[float, DefaultRun | None]] = field(default_factory=dict)
    premise: dict[str, Premise] = field(default_factory=dict)
    outlines: dict[str, Outline] = field(default_factory=dict)
    large: dict[str, Detected] = field(default_factory=dict)
    threads: int = 1


def run(folder: Path, say: Callable[[str], None] = print) -> Results:
    """Run every experiment and write its pictures into a folder."""
    results, start = Results(threads=thread_count()), time.perf_counter()

    def done(what: str) -> None:
        say(f"{time.perf_counter() - start:6.1f} s  {what}")

    _warm_up()
    for name in SMALL:
        _small_scan(name, results)
        done(f"{name}: operators, procedure and noise")
    for name in OUTLINES:
        results.outlines[name] = _outline(name)
    done("outlines")
    _draw_small(folder, results)
    done("pictures of figures 7 to 10 and of the noise")
    _large_scan(folder, results)
    done("figure 11")
    return results


def _warm_up() -> None:
    """Compile or load the kernels, so that the times are those of a second call."""
    points = np.random.default_rng(0).random((3000, 3)) * (1, 1, 0.01)
    ex.detected(_nothing_known(points), "", operator="edn", **ex.FIG7)
    s2n.detect_edges(points)


def _nothing_known(points: np.ndarray) -> StandIn:
    no, none = np.zeros(len(points), bool), np.empty((0, 3))
    return StandIn("", points, points, no, ~no, no.astype(np.int8), no, none, np.zeros(0, bool), none, 1.0, 0.0)


def _small_scan(name: str, results: Results) -> None:
    """Everything that is done with a scan of one functional surface, at every noise."""
    model = Model(name)
    given = model.part.params().noise
    delta = WIDE_DELTA if name == "insert" else None
    results.noise[name], results.paper[name], results.default[name] = {}, {}, {}
    for noise in ex.NOISES:
        cloud = model.scan(noise=noise)
        marks = ex.at_noise(cloud)
        results.noise[name][noise] = marks
        results.paper[name][noise] = as_in_the_paper(cloud, marks[ex.edn_name(0.4)].mask)
        results.default[name][noise] = by_default(cloud, model.part.seed, delta)
        if noise == given:
            results.clouds[name], results.marks[name] = cloud, marks
            results.premise[name] = _premise(cloud, marks[ex.edn_name(0.4)])
            if delta is not None:
                results.default[f"{name}, default δ"] = {noise: by_default(cloud, model.part.seed)}


def _premise(cloud: StandIn, marks: Detected) -> Premise:
    distance, _ = KDTree(cloud.border).query(cloud.clean)
    beside = marks.mask & (distance <= 4 * cloud.h) & (cloud.side != 0)
    band = cloud.points[distance <= 2 * cloud.h]
    ideal = tuple(score_line(cloud, approximate_boundary(band, THIN_RADIUS * cloud.h, times=k)) for k in (1, 2, 3))
    return Premise(float((cloud.side[beside] > 0).mean()) if beside.any() else np.nan, ideal)


def _outline(name: str) -> Outline:
    model = Model(name)
    cloud = model.scan(noise=OUTLINE_NOISE)
    default = by_default(cloud, model.part.seed)
    exact = score_inside(cloud, enclosed_by_centroid(cloud.points, cloud.border))
    return Outline(len(cloud), exact, None if default is None else default.inside)


def _draw_small(folder: Path, results: Results) -> None:
    step, insert = (results.clouds[name] for name in SMALL)
    on_step, on_insert = (results.marks[name] for name in SMALL)
    by_run = [on_step[ex.run_name(operator, k)] for operator in ("dn", "vdn") for k in (1, 2, 3)]
    marks_sheet(folder / "fig7.png", step, [*by_run, None, on_step[ex.SEQUENCE], on_step[ex.ROBUST]], columns=3)
    names = [ex.edn_name(alpha) for alpha in ex.FIG9_ALPHAS]
    for part, cloud, marks in (("insert", insert, on_insert), ("step", step, on_step)):
        marks_sheet(folder / f"fig9-{part}.png", cloud, [None, *(marks[name] for name in names), marks[ex.ROBUST]], columns=3)
    name = ex.edn_name(0.4)
    for part in SMALL:
        cloud = results.clouds[part]
        noise = next(noise for noise, marks in results.noise[part].items() if marks is results.marks[part])
        runs = {"Default": results.default[part][noise]}
        if part == "insert":
            runs = {"Default": results.default["insert, default δ"][noise], f"Default, δ = {WIDE_DELTA:.0f}°": runs["Default"]}
        procedure_sheet(folder / f"fig10-{part.split('_')[-1]}.png", cloud, name, results.paper[part][noise], runs)
    shown = (ex.run_name("dn", 1), ex.run_name("vdn", 3), ex.edn_name(0.4), ex.BEST, ex.ROBUST)
    titles = {"shallow_step": "Shallow surface with a smooth step (Fig. 6)", "insert": "One functional surface (Figs. 1, 10)"}
    series = {titles[p]: {run: [results.noise[p][s][run].score.f1 for s in ex.NOISES] for run in shown} for p in SMALL}
    draw_lines(folder / "noise.png", ex.NOISES, series, labels=("noise σ (units of the spacing h)", "F1 of the marked points"))


def _large_scan(folder: Path, results: Results) -> None:
    cloud = Model("complex_body").scan()
    runs = [*ex.combined(cloud, ex.FIG11_ALPHAS, ex.FIG11), ex.robust(cloud)]
    results.clouds["complex_body"], results.large = cloud, {run.name: run for run in runs}
    marks_sheet(folder / "fig11.png", cloud, [None, *runs], columns=3, detail=True)
