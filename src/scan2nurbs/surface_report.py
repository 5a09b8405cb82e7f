"""The figures of a reconstructed surface, as plain data: what stands in the JSON and in the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from scan2nurbs.brep.check import check

if TYPE_CHECKING:
    from scan2nurbs.pipeline import SurfaceModel, SurfaceParams


def surface_report(model: SurfaceModel, params: SurfaceParams, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Collect the figures of every stage.

    Returns
    -------
    dict
        Lengths in the input's unit, places in its coordinates, angles in degrees.
    """
    return {
        "parameters": params,
        "edges": _edges(model),
        "boundary": _boundary(model),
        "inside": _inside(model, params),
        "faces": [_face(model)],
        "model": _model(model),
        "warnings": _warnings(model, params),
        "seconds": dict(seconds),
    }


def _edges(model: SurfaceModel) -> dict[str, Any]:
    edges = model.edges
    return {
        "n_points": int(np.count_nonzero(edges.mask)),
        "threshold": edges.threshold,
        "radii": edges.radii,
        "runs": [{"operator": name, "kept": kept} for name, kept in edges.runs],
        "degenerate": edges.counts,
    }


def _boundary(model: SurfaceModel) -> dict[str, Any]:
    boundary = model.boundary
    return {
        "points": model.band.counts | boundary.counts,
        "curves": [
            {
                "closed": curve.closed,
                "n_points": len(curve.points),
                "length": curve.length,
                "rms": curve.rms,
                "max": curve.max_deviation,
                "n_control_points": len(curve.spline.c),
            }
            for curve in boundary.curves
        ],
    }


def _inside(model: SurfaceModel, params: SurfaceParams) -> dict[str, Any]:
    region = model.region
    candidates = [] if region is None else region.candidates
    return {
        "grouping": params.grouping,
        "n_points": int(np.count_nonzero(model.inside)),
        "chosen": None if region is None else region.chosen,
        "candidates": [
            {
                "label": found.label,
                "n_points": found.n_points,
                "area": found.area,
                "enclosed": found.enclosed,
                "planar": found.planar,
                "seed": found.place + model.cloud.origin,
            }
            for found in candidates
        ],
    }


def _face(model: SurfaceModel) -> dict[str, Any]:
    fit, trim = model.fit, model.trim
    return {
        "name": "bspline_1",
        "type": "bspline",
        "n_points": int(np.count_nonzero(fit.weights > 0)),
        "n_outliers": fit.n_outliers,
        "n_uncovered": trim.n_uncovered,
        "rms": fit.rms,
        "p95": fit.p95,
        "max": fit.max,
        "n_control_points": fit.n_control_points,
        "net": list(fit.control_points.shape[:2]),
        "degrees": list(fit.degrees),
        "closed": list(fit.surface.closed),
        "parametrization": fit.parametrization,
        "tolerance": fit.tolerance,
        "noise": fit.noise,
        "iterations": fit.iterations,
        "area": model.face.area,
        "loops": [
            {
                "n_points": len(loop.points),
                "n_corners": len(loop.corners),
                "on_crease": float(np.mean(loop.on_crease)),
                "around": bool(np.any(loop.shift)),
            }
            for loop in trim.outline.loops
        ],
    }


def _model(model: SurfaceModel) -> dict[str, Any]:
    face, found = model.face, check(model.face.shape)
    return {
        "n_faces": 1,
        "n_edges": face.n_edges,
        "closed": found.closed,
        "valid": face.valid,
        "free_edges": found.free_edges,
        "area": face.area,
        "max_tolerance": face.max_tolerance,
        "outline_deviation": face.deviation,
    }


def _warnings(model: SurfaceModel, params: SurfaceParams) -> list[str]:
    warnings = [*model.fit.notes, *model.face.notes]
    region, outline = model.region, model.trim.outline
    if region is not None and region.chosen != 0 and params.region.seed is None:
        warnings.append("A larger surface was found, but is a plane or less enclosed by edges; a seed point on it chooses it.")
    if params.region.seed is not None:
        away = float(np.linalg.norm(model.cloud.points - (np.asarray(params.region.seed) - model.cloud.origin), axis=1).min())
        if away > 10.0 * model.scale.h:
            warnings.append(f"The seed lies {away:.3g} {model.cloud.unit} from the nearest point of the scan.")
    if outline.n_left_out:
        parts = ", ".join(str(n) for n in outline.n_left_out[:5])
        warnings.append(
            f"The surface's points lie in {len(outline.n_left_out) + 1} pieces; those of {parts} points are not in the outline."
        )
    if model.trim.n_uncovered > 0.002 * len(model.fitted):
        warnings.append(f"The outline of the face leaves out {model.trim.n_uncovered:,} of the surface's points: look at its picture.")
    share = np.count_nonzero(model.fit.weights == 0) / len(model.fit.weights)
    if share > 0.05:
        warnings.append(f"{share:.0%} of the surface's points were taken for outliers.")
    # A scan without noise is not fitted better than the tolerance asks for.
    floor = max(model.scale.noise, model.fit.tolerance)
    if model.fit.rms > 2.0 * floor:
        ratio = model.fit.rms / floor
        warnings.append(f"The surface misses its points by {ratio:.1f} times the scan's noise or tolerance, whichever is larger.")
    return warnings
