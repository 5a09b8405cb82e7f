"""Pictures of edges beside the truth: scan, true edges, what was found."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from examples.parts import WHOLE
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

import scan2nurbs as s2n
from benchmarks.truth import CONDITIONS, sample, true_part
from scan2nurbs.api import measure
from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.kinds import BORDER, with_kinds
from scan2nurbs.edges.network import edge_network
from scan2nurbs.report.pictures import BLUE, GREY, ORANGE
from scan2nurbs.report.view import Raster, View, choose_view, rasterise

Floats = NDArray[np.float64]

SHOWN = (("bracket", "noise .25"), ("roof", "noise .5"), ("flange", "noise .25"), ("impeller", "noise .25"))
SIZE = (300, 240)
CURVED = ("bracket", "gear", "handwheel", "open_panel")
KIND_COLOURS = ((0.80, 0.82, 0.85), (0.84, 0.20, 0.10), (0.0, 0.55, 0.25), (0.95, 0.65, 0.0), (0.55, 0.0, 0.70))
"""Of points on no edge, convex, concave, at a border, and at a corner."""


def draw_edges(path: Path) -> None:
    """Draw true edges, edge points of the paper's EDN and of the default for a few parts."""
    figure = Figure(figsize=(7.2, 7.4), dpi=110, layout="constrained")
    axes = figure.subplots(len(SHOWN), 3, squeeze=False)
    for row, (name, condition) in zip(axes, SHOWN, strict=True):
        truth = sample(true_part(WHOLE[name].build()), CONDITIONS[condition])
        view = with_aspect(choose_view(truth.points), SIZE[0] / SIZE[1])
        show(row[0], f"{name}, {condition}", truth.points, None, view)
        scatter(row[0], truth.points, truth.edges.sharp, view, BLUE)
        show(row[1], "EDN, the paper's setting", truth.points, s2n.detect_edges(truth.points, s2n.EdgeParams(operator="edn")).mask, view)
        show(row[2], "default", truth.points, s2n.detect_edges(truth.points).mask, view)
    save(figure, path)


def draw_kinds(path: Path) -> None:
    """Draw kinds of edge points and the curves along edges for a few parts."""
    figure = Figure(figsize=(7.6, 8.6), dpi=110, layout="constrained")
    axes = figure.subplots(len(CURVED), 2, squeeze=False)
    for row, name in zip(axes, CURVED, strict=True):
        measured = measure(sample(true_part(WHOLE[name].build()), CONDITIONS["noise .25"]).points)
        points = measured.cloud.points
        edges = with_kinds(measured.scale, detect(points, measured.scale, s2n.EdgeParams()))
        kind = np.zeros(len(points), np.uint8) if edges.kind is None else edges.kind
        network = edge_network(points, measured.scale, edges.mask, border=kind == BORDER)
        view = with_aspect(choose_view(points), SIZE[0] / SIZE[1])
        show(row[0], f"{name}: kinds", points, None, view, np.array(KIND_COLOURS)[kind])
        show(row[1], f"{len(network.curves)} curves, {len(network.corners)} corners", points, None, view)
        colours = colormaps["tab20"](np.arange(len(network.curves)) % 20)
        for edge, colour in zip(network.curves, colours, strict=True):
            line = edge.curve.sample(0.5 * measured.scale.h)
            line = np.concatenate([line, line[:1]]) if edge.curve.closed else line
            row[1].plot(*view.project(line)[:, :2].T, color=colour, linewidth=1.4)
        if len(network.corners):
            row[1].plot(*view.project(network.corners)[:, :2].T, "k.", markersize=4)
    save(figure, path)


def show(axes: Axes, title: str, points: Floats, marked: NDArray[np.bool_] | None, view: View, colours: Floats | None = None) -> None:
    """Draw the points as a shaded surface, some of them in colour."""
    colour = np.tile(to_rgb(GREY), (len(points), 1)) if colours is None else colours
    if marked is not None:
        colour[marked] = to_rgb(ORANGE)
    lay(axes, title, rasterise(points, view, width=SIZE[0], height=SIZE[1]), colour, view)


def lay(axes: Axes, title: str, raster: Raster, colour: Floats, view: View) -> None:
    """Draw what is seen, each point or triangle in its colour."""
    image = np.ones((SIZE[1], SIZE[0], 3))
    hit = raster.index >= 0
    image[hit] = colour[raster.index[hit]] * (0.62 + 0.38 * raster.shade[hit])[:, None]
    (left, low), (right, high) = view.low, view.high
    axes.imshow(image, origin="lower", extent=(left, right, low, high), interpolation="antialiased")
    axes.set_axis_off()
    axes.set_title(title, fontsize=8, loc="left")


def scatter(axes: Axes, points: Floats, places: Floats, view: View, colour: str) -> None:
    """Draw places on top."""
    if len(places):
        axes.plot(*view.project(places)[:, :2].T, ".", color=colour, markersize=0.8)


def with_aspect(view: View, aspect: float) -> View:
    """Widen a view to an aspect."""
    size, centre = view.high - view.low, 0.5 * (view.low + view.high)
    width = max(size[0], size[1] * aspect)
    half = 0.5 * np.array([width, width / aspect])
    return View(view.axes, centre - half, centre + half)


def save(figure: Figure, path: Path) -> None:
    """Write a figure with a palette: a fifth of the size, and nothing of it to be seen."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.open(stream).convert("RGB").quantize(160, dither=Image.Dither.NONE).save(path, optimize=True)
