"""The stages of the demo in one picture: ``python -m examples.picture demo/scan.ply PICTURE.png`` from the root of the checkout."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from PIL import Image

import scan2nurbs as s2n
from scan2nurbs.cli.surface_pictures import trimming_loops
from scan2nurbs.report.pictures import BLUE, GREY, ORANGE
from scan2nurbs.report.view import View, choose_view, rasterise

from .demo import PART
from .parts import PARTS

Array = NDArray[np.float64]

PIXELS = (420, 300)
GRID, LINES = 1200, 25
"""Places on the surface in each direction, more than a panel has pixels; lines of constant parameter."""


def draw(model: s2n.SurfaceModel) -> Figure:
    """Draw the scan, its edge strength, the inside with the boundary, and the trimmed face, all from one side."""
    points = model.cloud.points
    view = _with_aspect(choose_view(points), PIXELS[0] / PIXELS[1])
    grey = np.tile(to_rgb(GREY), (len(points), 1))
    strength = np.nan_to_num(model.edges.strength) / (2 * model.edges.threshold)
    groups = grey.copy()
    groups[model.band.on_edge] = to_rgb(ORANGE)
    groups[model.inside] = to_rgb(BLUE)
    feet = _places_on_face(model)
    figure = Figure(figsize=(8.4, 6.4), dpi=150, layout="constrained")
    (scan, edges), (inside, face) = figure.subplots(2, 2)
    _show(scan, f"1  {len(points):,} noisy points", points, grey, view)
    _show(edges, "2  edge strength", points, colormaps["viridis"](np.clip(strength, 0, 1))[:, :3], view)
    _show(inside, "3  what the edges enclose", points, groups, view)
    _show(face, f"4  one NURBS face, {model.fit.n_control_points} control points", feet, np.tile(to_rgb(GREY), (len(feet), 1)), view)
    _lines(face, _net(model), view, BLUE, 0.5)
    _lines(face, trimming_loops(model), view, ORANGE, 1.6)
    return figure


def _show(axes: Axes, title: str, points: Array, colour: Array, view: View) -> None:
    raster = rasterise(points, view, width=PIXELS[0], height=PIXELS[1])
    image = np.ones((PIXELS[1], PIXELS[0], 3))
    hit = raster.index >= 0
    image[hit] = colour[raster.index[hit]] * (0.62 + 0.38 * raster.shade[hit])[:, None]
    (left, low), (right, high) = view.low, view.high
    axes.imshow(image, origin="lower", extent=(left, right, low, high), interpolation="antialiased")
    axes.set_axis_off()
    axes.set_title(title, fontsize=11, loc="left")


def _lines(axes: Axes, curves: list[Array], view: View, colour: str, width: float) -> None:
    for curve in curves:
        axes.plot(*view.project(curve)[:, :2].T, color=colour, linewidth=width)


def _places_on_face(model: s2n.SurfaceModel) -> Array:
    """Return points all over the trimmed face."""
    axes = [np.linspace(low, high, GRID) for low, high in model.fit.surface.domain]
    uv = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return model.fit.surface.evaluate(uv[_on_face(model, uv)])


def _net(model: s2n.SurfaceModel) -> list[Array]:
    """Return lines of constant parameter, NaN where they are trimmed away."""
    (u0, u1), (v0, v1) = model.fit.surface.domain
    along = np.linspace(0.0, 1.0, GRID)
    lines = []
    for at in np.linspace(0.0, 1.0, LINES):
        for unit in (np.stack([np.full(GRID, at), along], axis=1), np.stack([along, np.full(GRID, at)], axis=1)):
            uv = unit * [u1 - u0, v1 - v0] + [u0, v0]
            lines.append(np.where(_on_face(model, uv)[:, None], model.fit.surface.evaluate(uv), np.nan))
    return lines


def _on_face(model: s2n.SurfaceModel, uv: Array) -> NDArray[np.bool_]:
    """Tell what lies within the outer loop and outside its holes."""
    inside = np.zeros(len(uv), bool)
    for loop in model.trim.loops:
        inside ^= Outline(loop.uv).contains_points(uv)
    return inside


def _with_aspect(view: View, aspect: float) -> View:
    size, centre = view.high - view.low, 0.5 * (view.low + view.high)
    width = max(size[0], size[1] * aspect)
    half = 0.5 * np.array([width, width / aspect])
    return View(view.axes, centre - half, centre + half)


def main(scan: Path, picture: Path) -> None:
    params = s2n.SurfaceParams(region=s2n.RegionParams(seed=PARTS[PART].seed))
    figure = draw(s2n.reconstruct_surface(scan, params))
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    picture.parent.mkdir(parents=True, exist_ok=True)
    # A palette: a fifth of the size, and nothing of it to be seen.
    Image.open(stream).convert("RGB").quantize(160, dither=Image.Dither.NONE).save(picture, optimize=True)
    print(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo/scan.ply"), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/images/demo.png"))
