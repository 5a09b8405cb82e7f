"""The gallery of whole parts: scan, faces, model and deviation side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.edge_pictures import SIZE, lay, save, show, with_aspect
from benchmarks.truth import Truth
from scan2nurbs.brep.part_mesh import mesh_part
from scan2nurbs.part import Model
from scan2nurbs.report.colours import face_colours
from scan2nurbs.report.triangles import rasterise_triangles
from scan2nurbs.report.view import choose_view

MOST = 6


def draw_gallery(shown: dict[str, tuple[Truth, Model]], path: Path) -> None:
    """Draw up to `MOST` parts, a row each."""
    chosen = list(shown.items())[:MOST]
    figure = Figure(figsize=(9.6, 2.3 * len(chosen)), dpi=110, layout="constrained")
    for row, (name, (truth, model)) in zip(figure.subplots(len(chosen), 4, squeeze=False), chosen, strict=True):
        view = with_aspect(choose_view(truth.points), SIZE[0] / SIZE[1])
        points, label = model.cloud.points + model.cloud.origin, model.faces.label
        colour = np.vstack([face_colours(len(model.faces.fits)), [0.72, 0.75, 0.78]])
        show(row[0], f"{name}: scan", truth.points, None, view)
        show(row[1], f"{len(model.faces.fits)} faces ({len(truth.part.faces)} true)", points, None, view, colour[label])
        mesh = mesh_part(model.part)
        triangles = rasterise_triangles(mesh.corners + model.cloud.origin, mesh.face, view, width=SIZE[0], height=SIZE[1])
        title = f"model: {'valid' if model.part.valid else 'invalid'}, {'closed' if model.part.closed else 'open'}"
        lay(row[2], title, triangles, colour[mesh.face], view)
        reach = 2.0 * model.scale.h
        shade = np.clip(np.nan_to_num(model.deviation) / reach, -1.0, 1.0)
        red_blue = np.column_stack([1.0 - np.maximum(-shade, 0), 1.0 - np.abs(shade), 1.0 - np.maximum(shade, 0)])
        show(row[3], "deviation, ±2 h", points, None, view, red_blue * 0.9)
    save(figure, path)
