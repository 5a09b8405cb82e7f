"""The pictures of the gallery, one function a figure of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from scan2nurbs.surfaces.bspline import BSplineSurface

from .draw import BLUE, GREEN, GREY, ORANGE, Panel, draw_sheet, marked, plain, sides, view_of
from .experiments import Detected
from .procedure import DefaultRun, PaperRun
from .truth import Array, EdgeScore, StandIn, score_edges

WIDE, NARROW = 380, 312
"""Width of a panel in pixels, on sheets of three and of four columns."""

MARKS = {"marked, within 2 h of a true edge": BLUE, "marked, far from any edge": ORANGE, "not marked": GREY}


def truth_panel(cloud: StandIn, title: str = "The scan, and its true edges") -> Panel:
    note = f"{len(cloud):,} points, noise σ = {cloud.sigma / cloud.h:.2g} h; {cloud.near.mean():.0%} near a true edge"
    return Panel(title, note, cloud.points, marked(cloud, cloud.near))


def said(score: EdgeScore, *, detail: bool = False) -> str:
    more = f", of details {score.detail:.2f}" if detail else ""
    return f"{score.marked:.0%} marked, precision {score.precision:.2f}, recall {score.recall:.2f}{more}"


def marks_sheet(path: Path, cloud: StandIn, runs: Sequence[Detected | None], *, columns: int, detail: bool = False) -> None:
    """Show what each operator marked; the scan itself in the place of None."""
    panels = []
    for run in runs:
        if run is None:
            panels.append(truth_panel(cloud))
            continue
        panels.append(Panel(run.name, said(run.score, detail=detail), cloud.points, marked(cloud, run.mask)))
    draw_sheet(path, panels, view_of(cloud), columns=columns, legend=MARKS, width=WIDE)


def procedure_sheet(path: Path, cloud: StandIn, name: str, paper: PaperRun, defaults: Mapping[str, DefaultRun | None]) -> None:
    """Show the whole procedure: the paper's in two rows, then one row for each run of this project's own."""
    panels = [
        Panel(f"(1) {name}", f"{np.count_nonzero(paper.marked):,} points marked", cloud.points, marked(cloud, paper.marked)),
        Panel("(2) density filter", f"{np.count_nonzero(paper.dense):,} points left", cloud.points, marked(cloud, paper.dense)),
    ]
    times = ("once", "twice", "three times")
    for k, (points, line) in enumerate(zip(paper.thinned, paper.lines, strict=True)):
        note = f"{line.n_points:,} points, {line.stray:.0%} stray, {line.covered:.0%} of border covered"
        panels.append(Panel(f"({3 + k}) Algorithm 2, {times[k]}", note, cloud.points, plain(cloud.points), points))
    line = paper.chosen_line
    note = f"{line.n_points} points left, {line.covered:.0%} of the border covered"
    panels.append(Panel("(6) undesired points removed by hand", note, cloud.points, plain(cloud.points), paper.chosen))
    note = f"accuracy {paper.inside.accuracy:.3f}, IoU {paper.inside.iou:.2f}"
    panels.append(Panel("(7) Algorithm 3: inside", note, cloud.points, sides(cloud, paper.found), paper.chosen))
    if paper.surface is not None and paper.score is not None:
        note = f"rms {paper.score.in_sigma:.2f} σ from the true surface, where it is"
        panels.append(_patch("(8) B-spline surface", note, paper.surface, cloud.points[paper.found], 1.5 * cloud.h))
    else:
        panels.append(Panel("(8) no surface", "the points determine none", cloud.points, plain(cloud.points)))
    for label, run in defaults.items():
        panels += [] if run is None else _default_panels(cloud, label, run)
    legend = {
        "right": BLUE,
        "wrong": ORANGE,
        "inside, but not found": GREEN,
        "rest of the scan": GREY,
        "thinned boundary point": "dot",
        "boundary curve": "line",
    }
    draw_sheet(path, panels, view_of(cloud), columns=4, legend=legend, width=NARROW)


def _default_panels(cloud: StandIn, name: str, run: DefaultRun) -> list[Panel]:
    model, line = run.model, run.line
    origin, mask = model.cloud.origin, model.cloud.to_rows(model.edges.mask, False)
    curves = [np.asarray(curve.sample(0.5 * model.scale.h)) + origin for curve in model.boundary.curves]
    covered = f"{line.covered:.0%} of the border covered by their points"
    rms = f"rms {run.score.in_sigma:.2f} σ from the true surface, where it is"
    return [
        Panel(f"{name}: marked points", said(score_edges(cloud, mask)), cloud.points, marked(cloud, mask)),
        Panel(f"{name}: boundary curves", covered, cloud.points, plain(cloud.points), lines=curves),
        Panel(f"{name}: inside", f"accuracy {run.inside.accuracy:.3f}, IoU {run.inside.iou:.2f}", cloud.points, sides(cloud, run.found)),
        _patch(f"{name}: surface", rms, run.surface, cloud.points[run.found], 1.5 * cloud.h),
    ]


def _patch(title: str, note: str, surface: BSplineSurface, points: Array, reach: float, n: int = 700, lines: int = 14) -> Panel:
    """Show the surface as far as the scan goes, with lines of constant parameter."""
    (u0, u1), (v0, v1) = surface.domain
    u, v = (side.ravel() for side in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij"))
    grid = surface.evaluate(np.column_stack([u0 + u * (u1 - u0), v0 + v * (v1 - v0)]))
    near = np.isfinite(KDTree(points).query(grid, distance_upper_bound=reach, workers=-1)[0])
    colour = plain(grid, BLUE)
    colour[((u * lines) % 1 < 0.07) | ((v * lines) % 1 < 0.07)] = (0.85, 0.92, 0.97)
    return Panel(title, note, grid[near], colour[near])
