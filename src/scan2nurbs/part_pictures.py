"""The pictures of a whole part, in the order of the stages; all from one side."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scan2nurbs.brep.part_mesh import mesh_part
from scan2nurbs.report.part_pictures import faces_picture, model_deviation_picture, model_picture
from scan2nurbs.report.pictures import Picture, deviation_histogram, strength_picture
from scan2nurbs.report.view import choose_view

if TYPE_CHECKING:
    from scan2nurbs.part import Model


def part_pictures(model: Model) -> list[Picture]:
    """Draw the faces, the model, the deviations and their distribution, and the strength of edges."""
    points, unit, noise = model.cloud.points, model.cloud.unit, model.scale.noise
    view = choose_view(points)
    label = model.faces.label
    borders = [border.points for border in model.topology.borders]
    mesh = mesh_part(model.part)
    free = [edge.points for edge in model.part.edges if -1 in edge.faces]
    edges = [edge.points for edge in model.part.edges if -1 not in edge.faces]
    feet = points.copy()
    for k, fit in enumerate(model.faces.fits):
        feet[label == k] = fit.shape.foot(points[label == k])
    return [
        model_picture(mesh.corners, mesh.face, unit=unit, edges=edges, free=free, view=view),
        faces_picture(points, label, unit=unit, curves=borders, view=view),
        model_deviation_picture(mesh.corners, mesh.face, feet, model.deviation, unit=unit, spacing=model.scale.h, view=view),
        deviation_histogram(model.deviation, unit=unit, noise=noise),
        strength_picture(points, model.edges.strength, unit=unit, threshold=model.edges.threshold, view=view),
    ]
