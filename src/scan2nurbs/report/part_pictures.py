"""Pictures of a whole part: its faces, each in a colour of its own, and the model that was built of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.report.colours import face_colours
from scan2nurbs.report.pictures import GREY, Array, Picture, draw_curves, frame, paint, reach_of, scale_said, show, stage, thin_out, to_png
from scan2nurbs.report.triangles import rasterise_triangles
from scan2nurbs.report.view import Raster, View, choose_view, places

_NEAR = 3.0
"""Spacings within which a place of the model has points."""

_BARE = "#59626c"


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
    corners: Array,
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
    corners : (T, 3, 3) float64
        The model's triangles.
    face : (T,) int32
        The face of each triangle, in the numbering of `faces_picture`.
    edges, free : sequences of (K, 3) float64
        Edges with a face on both sides, and with a face on one side only.
    """
    raster, fitted = _seen(corners, face, view)
    colour = face_colours(int(face.max(initial=0)) + 1)
    figure, axes, scene = show(raster, colour[face[raster.index[raster.index >= 0]]], fitted, unit)
    draw_curves(axes, scene, edges, "black", 1.0)
    draw_curves(axes, scene, free, "red", 1.8)
    caption = "The CAD model: faces in the colours of the picture of faces, edges black, dotted where they run behind"
    return Picture("The model", caption + ("; free borders red." if free else "."), to_png(figure))


def model_deviation_picture(
    corners: Array, face: NDArray[np.int32], feet: Array, deviation: Array, *, unit: str, spacing: float, view: View | None = None
) -> Picture:
    """Show the model in the colours of the points nearest to each place: red where they lie above it, blue below.

    Parameters
    ----------
    corners, face
        As in `model_picture`.
    feet : (N, 3) float64
        The points' feet on the model.
    deviation : (N,) float64
        Signed distances, in `unit`; NaN is left grey.
    spacing : float
        How far points lie apart: places with none within some spacings are grey.
    """
    raster, fitted = _seen(corners, face, view)
    known = np.flatnonzero(np.isfinite(deviation))
    known = known[thin_out(len(known))]
    seen = places(raster, fitted)
    value = np.full(len(seen), np.nan)
    if len(known) and len(seen):
        distance, near = map(np.asarray, KDTree(feet[known]).query(seen, distance_upper_bound=_NEAR * spacing, workers=-1))
        found = np.isfinite(distance)
        value[found] = deviation[known[near[found]]]
    reach = reach_of(deviation)
    png = paint(raster, value, fitted, unit, limits=(-reach, reach), scale="coolwarm", label=f"Deviation ({unit})", unknown=_BARE)
    said = "The model, each place in the colour of the point nearest to it: its distance from the surface; dark grey where none is near; "
    return Picture("Deviation from the surface", said + scale_said(reach, unit), png)


def _seen(corners: Array, face: NDArray[np.int32], view: View | None) -> tuple[Raster, View]:
    fitted, width, height = frame(view or choose_view(corners.reshape(-1, 3)))
    return rasterise_triangles(corners, face, fitted, width=width, height=height), fitted
