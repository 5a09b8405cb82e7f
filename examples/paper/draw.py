"""Sheets of pictures: the same cloud from the same side, once a panel."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from scan2nurbs.report.pictures import BLUE, GREEN, GREY, ORANGE
from scan2nurbs.report.view import View, choose_view, rasterise

from .truth import Array, Mask, StandIn

__all__ = ["BLUE", "GREEN", "GREY", "ORANGE", "Panel", "draw_lines", "draw_sheet", "marked", "plain", "sides", "view_of"]

PINK = "#cc79a7"
_DPI = 100
_GAP, _HEAD, _FOOT = 14, 44, 40
"""Pixels between panels, above each for its title, and below all for the legend."""


@dataclass(frozen=True)
class Panel:
    """One picture of a sheet.

    Attributes
    ----------
    title, note : str
        Above the picture: what it shows, and its figures.
    points, colour : (N, 3) float64
        Shaded points; the colour of each.
    dots : (K, 3) float64
        Drawn over everything, each as a black dot.
    lines : sequence of (K, 3) float64
        Drawn over everything.
    """

    title: str
    note: str
    points: Array
    colour: Array
    dots: Array = field(default_factory=lambda: np.empty((0, 3)))
    lines: Sequence[Array] = ()


def plain(points: Array, shade: str = GREY) -> Array:
    """Give all points one colour."""
    return np.tile(to_rgb(shade), (len(points), 1))


def marked(cloud: StandIn, mask: Mask) -> Array:
    """Colour what is marked: blue within 2 h of a true edge, orange elsewhere."""
    colour = plain(cloud.points)
    colour[mask & cloud.near] = to_rgb(BLUE)
    colour[mask & ~cloud.near] = to_rgb(ORANGE)
    return colour


def sides(cloud: StandIn, found: Mask) -> Array:
    """Colour what is said to be inside: blue where it is, orange where it is not; green is inside and was not found."""
    colour = plain(cloud.points)
    colour[found] = to_rgb(BLUE)
    colour[found & ~cloud.inside & cloud.judged] = to_rgb(ORANGE)
    colour[~found & cloud.inside & cloud.judged] = to_rgb(GREEN)
    return colour


def view_of(cloud: StandIn) -> View:
    return choose_view(cloud.points)


def draw_sheet(path: Path, panels: Sequence[Panel], view: View, *, columns: int, legend: Mapping[str, str], width: int = 380) -> None:
    """Draw panels side by side into a PNG file with a palette, so that it stays small.

    Parameters
    ----------
    legend : mapping of str to str
        Colour of each meaning; "dot" and "line" stand for black dots and lines.
    width : int
        Of a panel, in pixels.
    """
    size = view.high - view.low
    height = int(width * size[1] / size[0])
    rows = -(-len(panels) // columns)
    total = np.array([columns * (width + _GAP) + _GAP, rows * (height + _HEAD) + _FOOT])
    figure = Figure(figsize=tuple(total / _DPI), dpi=_DPI)
    for place, panel in enumerate(panels):
        row, column = divmod(place, columns)
        corner = np.array([_GAP + column * (width + _GAP), total[1] - (row + 1) * (height + _HEAD)])
        axes = figure.add_axes((*(corner / total), *((width, height) / total)))
        _draw_panel(axes, panel, view, width, height)
    entries = [_entry(name, shade) for name, shade in legend.items()]
    figure.legend(handles=entries, loc="lower center", ncols=len(entries), frameon=False, fontsize=9, handletextpad=0.3)
    _save(figure, path)


def _entry(name: str, shade: str) -> Line2D:
    if shade == "line":
        return Line2D([], [], color="black", linewidth=1.2, label=name)
    size, colour = (3, "black") if shade == "dot" else (7, shade)
    return Line2D([], [], marker="o", markersize=size, linestyle="", color=colour, label=name)


def _draw_panel(axes: Axes, panel: Panel, view: View, width: int, height: int) -> None:
    # Twice as fine, then averaged: thin lines of marked points stay visible and do not flicker.
    raster = rasterise(panel.points, view, width=2 * width, height=2 * height)
    image = np.ones((2 * height, 2 * width, 3))
    hit = raster.index >= 0
    image[hit] = panel.colour[raster.index[hit]] * (0.55 + 0.45 * raster.shade[hit])[:, None]
    image = image.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    (left, low), (right, high) = view.low, view.high
    axes.imshow(image, origin="lower", extent=(left, right, low, high), interpolation="none")
    if len(panel.dots):
        across, upwards, _ = view.project(panel.dots).T
        axes.plot(across, upwards, linestyle="", marker="o", markersize=1.6, markeredgewidth=0, color="black")
    for line in panel.lines:
        across, upwards, _ = view.project(line).T
        axes.plot(across, upwards, color="black", linewidth=1.2)
    axes.set_axis_off()
    axes.set(xlim=(left, right), ylim=(low, high))
    for text, above, weight in ((panel.title, 16, "bold"), (panel.note, 3, "normal")):
        axes.annotate(text, (0, 1), (0, above), xycoords="axes fraction", textcoords="offset points", fontsize=9, fontweight=weight)


def draw_lines(path: Path, x: Sequence[float], panels: Mapping[str, Mapping[str, Sequence[float]]], *, labels: tuple[str, str]) -> None:
    """Draw one diagram a panel, one line a series."""
    figure = Figure(figsize=(9.0, 3.7), dpi=_DPI, layout="constrained")
    grid = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    styles = [(ORANGE, "o", "--"), (GREEN, "s", "--"), (PINK, "^", "--"), ("#000000", "v", ":"), (BLUE, "D", "-")]
    for axes, (title, series) in zip(grid, panels.items(), strict=True):
        for (name, values), (shade, marker, line) in zip(series.items(), styles, strict=False):
            axes.plot(x, values, color=shade, marker=marker, linestyle=line, markersize=5, linewidth=1.6, label=name)
        axes.set_title(title, fontsize=10, fontweight="bold")
        axes.set(xlabel=labels[0], ylim=(0, 1.02), xticks=x)
        axes.tick_params(labelsize=8)
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    grid[0].set_ylabel(labels[1])
    handles, names = grid[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=9)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    stream.seek(0)
    path.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(stream) as image:
        image.convert("RGB").quantize(palette=_palette(), dither=Image.Dither.NONE).save(path, optimize=True)


def _palette() -> Image.Image:
    """Make one palette for all pictures: shades of each colour, and what lies between it and grey or white; a rare colour stays itself."""
    grey, white = np.array(to_rgb(GREY)), np.ones(3)
    ramps = [np.linspace(0, 1, 33)[:, None] * white, np.linspace(0.55, 1, 26)[:, None] * grey]
    for shade in (BLUE, ORANGE, GREEN, PINK):
        colour = np.array(to_rgb(shade))
        ramps.append(np.linspace(0.55, 1, 22)[:, None] * colour)
        for other in (grey, 0.75 * grey, white):
            ramps.append(colour + np.linspace(0, 1, 10)[1:-1, None] * (other - colour))
    entries = np.round(255 * np.concatenate(ramps)).astype(np.uint8)
    image = Image.new("P", (1, 1))
    image.putpalette(np.concatenate([entries, np.repeat(entries[-1:], 256 - len(entries), axis=0)]).tobytes())
    return image
