"""Pictures of a run, made from plain arrays; every colour scale keeps its order for colour-blind eyes and in grey."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.spatial import KDTree

from scan2nurbs.report.view import Raster, View, choose_view, rasterise

Array = NDArray[np.float64]

GREY, BLUE, ORANGE, GREEN = "#b8bec6", "#0072b2", "#d55e00", "#009e73"  # Okabe and Ito's, made for colour-blind readers
MOST_POINTS, MOST_AVERAGED = 1_000_000, 200_000
NEARBY = 40
_WIDTH, _DPI = 1000, 110


@dataclass(frozen=True)
class Picture:
    """A picture and what it says.

    Attributes
    ----------
    title, caption : str
        The caption says how to read it.
    png : bytes
        The file.
    """

    title: str
    caption: str
    png: bytes


def strength_picture(points: Array, strength: Array, *, unit: str, threshold: float | None = None, view: View | None = None) -> Picture:
    """Show the edge strength of every point.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud.
    strength : (N,) float64
        Degrees; NaN where undefined.
    threshold : float, optional
        Degrees from which a point counts as an edge; marked beside the colour scale.
    """
    finite = strength[np.isfinite(strength)]
    top = float(max(np.quantile(finite, 0.995), 2 * (threshold or 0.0), 1e-6)) if len(finite) else 1.0
    said = "Points whose normal is undefined are grey."
    if threshold is not None:
        said = f"The line marks the threshold of {threshold:.3g}°. " + said
    return _coloured(
        points, strength, (0.0, min(top, 90.0)), "viridis", "Edge strength (degrees)", "Edge strength", said, unit, view, threshold
    )


def deviation_picture(points: Array, deviation: Array, *, unit: str, tolerance: float | None = None, view: View | None = None) -> Picture:
    """Show how far every point lies from the surface: red above it, blue below.

    Draw the points at their feet on the surface: where they lie themselves, those on the eye's side hide the others.

    Parameters
    ----------
    points : (N, 3) float64
        The points that the surface was fitted to.
    deviation : (N,) float64
        Signed distance, in `unit`; NaN is left grey.
    """
    reach = reach_of(deviation)
    said = f"Signed distance of each point from the surface; {scale_said(reach, unit)}"
    if tolerance is not None:
        said += f" The tolerance is {_short(tolerance)} {unit}."
    return _coloured(points, deviation, (-reach, reach), "coolwarm", f"Deviation ({unit})", "Deviation from the surface", said, unit, view)


def reach_of(deviation: Array) -> float:
    """Return where the scale of deviations ends."""
    finite = np.abs(deviation[np.isfinite(deviation)])
    return float(max(np.quantile(finite, 0.99), 1e-300)) if len(finite) else 1.0


def scale_said(reach: float, unit: str) -> str:
    """Say where the scale of deviations ends."""
    return f"the scale ends at ±{_short(reach)} {unit}, which 99 % of the points keep."


def trend_picture(points: Array, deviation: Array, *, unit: str, tolerance: float | None = None, view: View | None = None) -> Picture:
    """Show the mean deviation of each point's neighbourhood, in which the noise averages out and errors of shape stay.

    Parameters
    ----------
    points : (N, 3) float64
        Feet of the points on the surface.
    deviation : (N,) float64
        Signed distance, in `unit`; NaN takes no part.
    """
    known = np.flatnonzero(np.isfinite(deviation))
    known = known[thin_out(len(known), MOST_AVERAGED)]
    points, deviation = points[known], deviation[known]
    k = min(NEARBY, len(known))
    mean = deviation[KDTree(points).query(points, k, workers=-1)[1]].reshape(len(known), k).mean(axis=1) if k else deviation
    reach = float(max(np.quantile(np.abs(mean), 0.99) if k else 0.0, tolerance or 0.0)) or 1.0
    said = f"Mean over the {k} nearest points: noise averages out, and what stays is shape that the surface misses."
    if tolerance is not None:
        said += f" The tolerance is {_short(tolerance)} {unit}."
    return _coloured(points, mean, (-reach, reach), "coolwarm", f"Mean deviation ({unit})", "Deviation without the noise", said, unit, view)


def groups_picture(
    points: Array,
    groups: Mapping[str, NDArray[np.bool_]],
    *,
    title: str,
    caption: str,
    unit: str,
    curves: Sequence[Array] = (),
    curve_name: str = "boundary curve",
    view: View | None = None,
) -> Picture:
    """Show groups of points, each in its colour, the rest in grey.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud.
    groups : mapping of str to (N,) bool
        At most three; a later one is drawn over an earlier one.
    curves : sequence of (K, 3) float64
        Drawn over everything, e.g. the boundary's loops; `curve_name` says what they are.
    """
    keep = thin_out(len(points))
    colour = np.tile(to_rgb(GREY), (len(keep), 1))
    chosen = dict(zip(groups, (BLUE, ORANGE, GREEN), strict=False))
    for name, shade in chosen.items():
        colour[groups[name][keep]] = to_rgb(shade)
    figure, axes, scene = stage(points[keep], colour, view, unit)
    draw_curves(axes, scene, curves, "black", 1.6)
    entries = [
        Line2D([], [], marker="o", linestyle="", color=shade, label=f"{name} ({np.count_nonzero(groups[name]):,})")
        for name, shade in chosen.items()
    ]
    entries += [Line2D([], [], color="black", label=curve_name)] if curves else []
    if entries:
        figure.legend(handles=entries, loc="lower center", ncols=len(entries), frameon=False, fontsize=9)
    return Picture(title, caption, to_png(figure))


def surface_picture(points: Array, lines: Sequence[Array], boundary: Sequence[Array], *, unit: str, view: View | None = None) -> Picture:
    """Show the surface as lines of constant parameter over the scan, with the boundary that trims it."""
    keep = thin_out(len(points))
    figure, axes, scene = stage(points[keep], np.tile(to_rgb(GREY), (len(keep), 1)), view, unit)
    draw_curves(axes, scene, lines, BLUE, 0.8)
    draw_curves(axes, scene, boundary, ORANGE, 2.0)
    entries = [Line2D([], [], color=BLUE, label="lines of constant parameter"), Line2D([], [], color=ORANGE, label="trimming boundary")]
    figure.legend(handles=entries, loc="lower center", ncols=2, frameon=False, fontsize=9)
    return Picture(
        "The surface", "Lines of constant parameter of the NURBS surface inside its trimming boundary, over the scan.", to_png(figure)
    )


def deviation_histogram(deviation: Array, *, unit: str, noise: float | None = None, tolerance: float | None = None) -> Picture:
    """Show how the deviations are distributed, beside the scan's noise and the tolerance.

    Parameters
    ----------
    deviation : (N,) float64
        Signed distances, in `unit`.
    noise, tolerance : float, optional
        Standard deviation of the scan's noise, and what was asked of the fit; in `unit`.
    """
    finite = deviation[np.isfinite(deviation)]
    p95 = float(np.quantile(np.abs(finite), 0.95)) if len(finite) else 0.0
    reach = max(float(np.quantile(np.abs(finite), 0.998)) if len(finite) else 0.0, noise or 0.0, tolerance or 0.0, 1e-300) * 1.1
    figure = Figure(figsize=(_WIDTH / _DPI, 3.4), dpi=_DPI, layout="constrained")
    axes = figure.add_subplot()
    axes.hist(np.clip(finite, -reach, reach), bins=81, range=(-reach, reach), color=GREY)
    marks = [(noise, GREEN, "--", "noise (1 sigma)"), (p95, BLUE, "-", "95 % of the points"), (tolerance, ORANGE, "-.", "tolerance")]
    for at, colour, style, name in marks:
        if at is not None:
            axes.axvline(-at, color=colour, linestyle=style, linewidth=1.4)
            axes.axvline(at, color=colour, linestyle=style, linewidth=1.4, label=f"{name}: ±{_short(at)} {unit}")
    axes.set(xlabel=f"Deviation ({unit})", ylabel="Points", xlim=(-reach, reach))
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    said = (
        "Deviations within the noise are scatter of the scan; what lies far beyond it is shape that the surface misses, or a stray point."
    )
    return Picture("Distribution of the deviations", said, to_png(figure))


def _coloured(
    points: Array,
    values: Array,
    limits: tuple[float, float],
    scale: str,
    label: str,
    title: str,
    caption: str,
    unit: str,
    view: View | None,
    mark: float | None = None,
) -> Picture:
    keep = thin_out(len(points))
    fitted, width, height = frame(view or choose_view(points[keep]))
    raster = rasterise(points[keep], fitted, width=width, height=height)
    seen = values[keep][raster.index[raster.index >= 0]]
    return Picture(title, caption, paint(raster, seen, fitted, unit, limits=limits, scale=scale, label=label, mark=mark))


def paint(
    raster: Raster,
    values: Array,
    fitted: View,
    unit: str,
    *,
    limits: tuple[float, float],
    scale: str,
    label: str,
    mark: float | None = None,
    unknown: str = GREY,
) -> bytes:
    """Draw what is seen in the colours of values (N,), one a pixel with something, with the scale beside it; NaN is `unknown`."""
    mapping = ScalarMappable(Normalize(*limits), scale)
    known = np.isfinite(values)
    colour = np.asarray(mapping.to_rgba(np.where(known, values, 0.0)))[:, :3]
    colour[~known] = to_rgb(unknown)
    figure, axes, _ = show(raster, colour, fitted, unit)
    bar = figure.colorbar(mapping, ax=axes, shrink=0.75, aspect=28, pad=0.01, extend="max" if limits[0] == 0 else "both", label=label)
    if mark is not None:
        bar.ax.axhline(mark, color="white", linewidth=2.2)
        bar.ax.axhline(mark, color="black", linewidth=0.9)
    return to_png(figure)


def stage(points: Array, colour: Array, view: View | None, unit: str) -> tuple[Figure, Axes, Scene]:
    """Draw shaded points (N, 3) in their colours (N, 3), with a scale bar and the directions of the axes."""
    fitted, width, height = frame(view or choose_view(points))
    raster = rasterise(points, fitted, width=width, height=height)
    return show(raster, colour[raster.index[raster.index >= 0]], fitted, unit)


def frame(view: View) -> tuple[View, int, int]:
    """Return the view in the shape of a picture, and the picture's width and height in pixels."""
    size = view.high - view.low
    height = int(_WIDTH * np.clip(size[1] / size[0], 0.3, 0.85)) if size[0] > 0 else _WIDTH // 2
    return _widen(view, _WIDTH / height), _WIDTH, height


def show(raster: Raster, colour: Array, fitted: View, unit: str) -> tuple[Figure, Axes, Scene]:
    """Draw what is seen, shaded, with a scale bar and the directions of the axes; `colour` (N, 3) is that of the pixels with something."""
    height, width = raster.index.shape
    image = np.ones((height, width, 3))
    hit = raster.index >= 0
    image[hit] = colour * (0.62 + 0.38 * raster.shade[hit])[:, None]
    figure = Figure(figsize=(_WIDTH / _DPI, (height + 70) / _DPI), dpi=_DPI, layout="constrained")
    axes = figure.add_subplot()
    (left, low), (right, high) = fitted.low, fitted.high
    axes.imshow(image, origin="lower", extent=(left, right, low, high), interpolation="antialiased")
    axes.set_axis_off()
    axes.set(xlim=(left, right), ylim=(low, high))
    _draw_scale(axes, fitted, unit)
    return figure, axes, Scene(fitted, raster)


@dataclass(frozen=True)
class Scene:
    """What was drawn, to draw over it."""

    view: View
    raster: Raster

    def hides(self, seen: Array) -> NDArray[np.bool_]:
        """Tell which projected points lie well behind all that is seen about their place."""
        height, width = self.raster.index.shape
        size = self.view.high - self.view.low
        at = np.floor((seen[:, :2] - self.view.low) / size * (width, height)).astype(np.int64)
        column, row = np.clip(at, 0, [width - 1, height - 1]).T
        # A curve is often the very border of what is seen: then it is not hidden by what is on one side of it.
        return np.asarray(self.lowest[row, column] > seen[:, 2] + self.raster.slack)

    @cached_property
    def lowest(self) -> Array:
        """The least nearness (height, width) about each pixel."""
        return np.asarray(minimum_filter(self.raster.nearness, 3))


def _widen(view: View, aspect: float) -> View:
    """Give the view the picture's aspect, so that lengths along both axes are true."""
    size, centre = view.high - view.low, 0.5 * (view.low + view.high)
    width = max(size[0], size[1] * aspect)
    half = 0.5 * np.array([width, width / aspect])
    return View(view.axes, centre - half, centre + half)


def _draw_scale(axes: Axes, view: View, unit: str) -> None:
    width, height = view.high - view.low
    length = _round_down(0.2 * float(width))
    x, y = view.low + np.array([0.02 * width, 0.03 * height])
    axes.plot([x, x + length], [y, y], color="black", linewidth=2.5, solid_capstyle="butt")
    axes.annotate(f"{_short(length)} {unit}", (x + length / 2, y), (0, 4), textcoords="offset points", ha="center", fontsize=8)
    corner = view.high - (0.06 * width, 0.06 * width)
    for name, direction in zip("xyz", view.axes[:2].T, strict=True):
        tip = corner + 0.045 * width * direction
        axes.plot(*np.stack([corner, tip], axis=1), color="#555555", linewidth=1.0)
        if np.linalg.norm(direction) > 0.15:
            across, upwards = corner + 1.25 * (tip - corner)
            axes.annotate(name, (across, upwards), ha="center", va="center", fontsize=8, color="#555555")


def draw_curves(axes: Axes, scene: Scene, curves: Sequence[Array], colour: str, width: float) -> None:
    """Draw curves; what runs behind the points is dotted."""
    for curve in curves:
        seen = scene.view.project(np.asarray(curve))
        hidden = scene.hides(seen)
        for part, style, strength in ((~hidden, "-", 1.0), (hidden, ":", 0.6)):
            # A segment belongs to the part where either of its ends does, so that no gap shows.
            drawn = part | np.r_[part[1:], False] | np.r_[False, part[:-1]] if style == "-" else part
            line = np.where(drawn[:, None], seen[:, :2], np.nan)
            axes.plot(*line.T, color=colour, linewidth=width * strength, linestyle=style)


def thin_out(n: int, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Return every point, or `most` of them evenly chosen; the default is as many as a picture has pixels."""
    return np.arange(n) if n <= most else np.linspace(0, n - 1, most).astype(np.int64)


def _round_down(length: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not above `length`."""
    if not length > 0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(length))
    return float(next(step * decade for step in (5, 2, 1) if step * decade <= length * (1 + 1e-9)))


def _short(value: float) -> str:
    return f"{value:.3g}"


def to_png(figure: Figure) -> bytes:
    """Draw a figure into the bytes of a PNG file."""
    FigureCanvasAgg(figure)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", bbox_inches="tight", pad_inches=0.08, metadata={"Software": None})
    return stream.getvalue()
