"""Pictures of a whole part: its faces, each in a colour of its own, and the model that was built of them."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from scan2nurbs.report.pictures import GREY, Array, Picture, draw_curves, stage, thin_out, to_png
from scan2nurbs.report.view import View

_GOLDEN = 0.618034
SAMPLES = 400_000
"""Points by which a mesh is drawn: about one a pixel."""


def face_colours(n: int) -> Array:
    """Return n colours (n, 3), any two that follow each other far apart in hue, in three levels of lightness."""
    turns = (np.arange(n) * _GOLDEN) % 1.0
    return np.array([colorsys.hls_to_rgb(hue, (0.55, 0.42, 0.68)[k % 3], 0.62) for k, hue in enumerate(turns)]).reshape(-1, 3)


def faces_picture(points: Array, label: NDArray[np.int32], *, unit: str, curves: Sequence[Array] = (), view: View | None = None) -> Picture:
    """Show which face each point belongs to.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud.
    label : (N,) int32
        Faces from 0; −1 for none, drawn in grey.
    curves : sequence of (K, 3) float64
        The borders between faces, drawn over the points.
    """
    keep = thin_out(len(points))
    shown = label[keep]
    colour = np.vstack([face_colours(int(label.max(initial=-1)) + 1), to_rgb(GREY)])[shown]
    figure, axes, scene = stage(points[keep], colour, view, unit)
    draw_curves(axes, scene, curves, "black", 1.0)
    n_none = int(np.count_nonzero(label < 0))
    caption = f"{len(np.unique(label[label >= 0]))} faces, each in its colour; {n_none:,} points belong to none (grey)."
    return Picture("Faces", caption, to_png(figure))


def model_picture(
    vertices: Array,
    triangles: NDArray[np.int64],
    face: NDArray[np.int32],
    *,
    unit: str,
    edges: Sequence[Array] = (),
    free: Sequence[Array] = (),
    view: View | None = None,
) -> Picture:
    """Show the CAD model: its faces in their colours, its edges black, free borders red.

    Parameters
    ----------
    vertices : (V, 3) float64
        Of the model's triangles.
    triangles : (T, 3) int64
    face : (T,) int32
        The face of each triangle, in the numbering of `faces_picture`.
    edges, free : sequences of (K, 3) float64
        Edges with a face on both sides, and with a face on one side only.
    """
    points, owner = spread(vertices, triangles, SAMPLES)
    figure, axes, scene = stage(points, face_colours(int(face.max(initial=0)) + 1)[face[owner]], view, unit)
    draw_curves(axes, scene, edges, "black", 1.0)
    draw_curves(axes, scene, free, "red", 1.8)
    caption = "The CAD model: faces in the colours of the picture of faces, edges black, dotted where they run behind"
    return Picture("The model", caption + ("; free borders red." if free else "."), to_png(figure))


def spread(vertices: Array, triangles: NDArray[np.int64], n: int) -> tuple[Array, NDArray[np.int64]]:
    """Spread about n points evenly over triangles; return them (M, 3) and the triangle of each (M,)."""
    corner = vertices[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    total = float(area.sum())
    # Every triangle gets its share, rounded by where the running sum passes whole numbers.
    steps = np.floor(np.cumsum(area) * (n / total if total > 0 else 0.0)).astype(np.int64)
    owner = np.repeat(np.arange(len(triangles)), np.diff(steps, prepend=0))
    # An additive recurrence fills the unit square evenly without random numbers (Roberts 2018).
    a = np.mod(np.arange(len(owner))[:, None] * [0.7548776662466927, 0.5698402909980532], 1.0)
    a = np.where(a.sum(axis=1, keepdims=True) > 1.0, 1.0 - a, a)
    weight = np.column_stack([1.0 - a.sum(axis=1), a])
    return np.einsum("ni,nij->nj", weight, corner[owner]), owner
