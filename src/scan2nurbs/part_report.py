"""The figures of a whole part, as plain data: what stands in the JSON and in the report."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.surfaces.shape_fit import ShapeFit

if TYPE_CHECKING:
    from scan2nurbs.part import Model, PartParams
    from scan2nurbs.part_faces import Parted

# Places, which move with the cloud's origin; all other vectors are directions.
_PLACES = ("point", "center")
_ANGLES = ("half_angle",)


def part_report(model: Model, params: PartParams, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Collect the figures of every stage.

    Returns
    -------
    dict
        Lengths in the input's unit, places in its coordinates, angles in degrees.
    """
    return {
        "parameters": params,
        "faces": face_records(model, model.faces.fits, model.deviation, model.part),
        "edges": _edges(model),
        "relations": _relations(model),
        "model": _model(model),
        "warnings": _warnings(model),
        "seconds": dict(seconds),
    }


def segment_report(parted: Parted, params: PartParams, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Collect the figures of a scan that is parted into faces, without a model."""
    deviation = np.full(len(parted.cloud.points), np.nan)
    for k, fit in enumerate(parted.faces.fits):
        own = parted.faces.label == k
        deviation[own] = fit.shape.distance(parted.cloud.points[own])
    return {
        "parameters": params,
        "faces": face_records(parted, parted.faces.fits, deviation, None),
        "n_without_face": int(np.count_nonzero(parted.faces.label < 0)),
        "warnings": list(parted.faces.notes),
        "seconds": dict(seconds),
    }


def face_records(parted: Parted, fits: tuple[ShapeFit, ...], deviation: NDArray[np.float64], part: Any) -> list[dict[str, Any]]:
    """Describe every face: number, name, type, parameters with their standard deviations, and how far its points lie from it."""
    records = []
    for k, (fit, name) in enumerate(zip(fits, parted.names, strict=True)):
        off = deviation[parted.faces.label == k]
        off = np.abs(off[np.isfinite(off)])
        shape = shape_record(fit, parted.cloud.origin)
        records.append(
            {
                "number": int(parted.numbers[k]),
                "name": name,
                "type": fit.shape.kind,
                "parameters": _sentence(shape, fit.uncertainty, parted.cloud.unit),
                "n_points": int(np.count_nonzero(parted.faces.label == k)),
                "rms": float(np.sqrt(np.mean(off**2))) if len(off) else None,
                "p95": float(np.quantile(off, 0.95)) if len(off) else None,
                "max": float(off.max()) if len(off) else None,
                "n_control_points": _n_control_points(fit),
                "tolerance": fit.tolerance,
                "area": None if part is None or k >= len(part.faces) else part.areas[k],
                "trimmed": None if part is None else part.faces[k].trimmed if k < len(part.faces) else "lost",
                "shape": shape,
                "uncertainty": fit.uncertainty,
                "notes": [*fit.notes],
            }
        )
    return records


def shape_record(fit: ShapeFit, origin: NDArray[np.float64]) -> dict[str, Any]:
    """Return the parameters of a shape in the input's coordinates, angles in degrees; empty for splines."""
    record: dict[str, Any] = {}
    for entry in dataclasses.fields(fit.shape) if dataclasses.is_dataclass(fit.shape) else ():
        value = getattr(fit.shape, entry.name)
        if isinstance(value, float | int):
            record[entry.name] = float(np.degrees(value)) if entry.name in _ANGLES else float(value)
        elif isinstance(value, np.ndarray) and value.shape == (3,):
            record[entry.name] = value + origin if entry.name in _PLACES else value
    return record


def _sentence(shape: Mapping[str, Any], uncertainty: Mapping[str, float], unit: str) -> str:
    """Write numbers with their standard deviations, such as "radius 3 ± 0.002 mm"."""
    parts = []
    for name, value in shape.items():
        if isinstance(value, float):
            measure = "°" if name in _ANGLES else f" {unit}"
            known = f" ± {uncertainty[name]:.2g}" if name in uncertainty else ""
            parts.append(f"{name.replace('_', ' ')} {value:.5g}{known}{measure}")
    for name in ("axis", "direction"):
        if name in shape:
            known = f" ± {uncertainty[name]:.2g}°" if name in uncertainty else ""
            parts.append(f"{name} ({', '.join(f'{round(part, 4) + 0.0:.4f}' for part in shape[name])}){known}")
    return "; ".join(parts)


def _n_control_points(fit: ShapeFit) -> int | None:
    surface = getattr(fit.shape, "surface", None)
    return None if surface is None else int(surface.weights.size)


def _edges(model: Model) -> list[dict[str, Any]]:
    numbers = model.numbers.tolist()
    return [
        {
            "faces": [numbers[face] if face >= 0 else None for face in edge.faces],
            "between": " – ".join(model.names[face] if face >= 0 else "end of the scan" for face in edge.faces),
            "length": edge.length,
            "angle": edge.angle,
            "gap": edge.gap,
            "curve": edge.kind,
            "how": edge.mode,
        }
        for edge in model.part.edges
    ]


def _relations(model: Model) -> list[dict[str, Any]]:
    if model.related is None:
        return []
    names = _names_before(model)
    return [
        {
            "kind": found.kind,
            "between": " – ".join(names.get(face, "a face that was lost") for face in found.faces),
            "moved_angle": found.angle,
            "moved_length": found.length,
            "cost": found.cost,
        }
        for found in model.related.relations
    ]


def _names_before(model: Model) -> dict[int, str]:
    """Return the faces' names by the order in which relations were found, before the topology gave the faces theirs."""
    source = model.topology.source
    # Of a face that fell apart the largest piece, the first of equals, has kept its number.
    return {int(source[k]): model.names[k] for k in np.argsort(-model.topology.areas, kind="stable")[::-1].tolist()}


def _named(notes: Sequence[str], names: Mapping[int, str], first: int) -> list[str]:
    """Call faces by their names in notes that count them from `first`, as everything else in a report does."""

    def name(found: re.Match[str]) -> str:
        numbers = [int(number) - first for number in (found[1], found[2]) if number]
        return " and ".join(names.get(number, "a face that was lost") for number in numbers)

    return [re.sub(r"[Ff]aces? (\d+)(?: \(\w+\))?(?: and (\d+))?", name, note) for note in notes]


def _model(model: Model) -> dict[str, Any]:
    part = model.part
    off = model.deviation[np.isfinite(model.deviation)]
    return {
        "n_faces": sum(bool(face.shapes) for face in part.faces),
        "n_edges": len(part.edges),
        "n_solids": part.n_solids,
        "closed": part.closed,
        "valid": part.valid,
        "free_edges": part.n_free_edges,
        "volume": part.volume if part.closed else None,
        "area": part.area,
        "max_tolerance": part.max_tolerance,
        "coverage": part.coverage,
        "precision": part.precision,
        "rms": float(np.sqrt(np.mean(off**2))) if len(off) else None,
        "n_without_face": int(np.count_nonzero(model.faces.label < 0)),
    }


def _warnings(model: Model) -> list[str]:
    related = [] if model.related is None else _named(model.related.notes, _names_before(model), 0)
    warnings = [*model.faces.notes, *related, *model.topology.notes, *_named(model.part.notes, dict(enumerate(model.names)), 1)]
    if not model.part.valid:
        warnings.append("The CAD kernel's own check finds the model invalid.")
    if model.part.coverage < 0.95:
        warnings.append(f"The model covers only {model.part.coverage:.0%} of the scan.")
    share = np.count_nonzero(model.faces.label < 0) / len(model.faces.label)
    if share > 0.05:
        warnings.append(f"{share:.0%} of the points belong to no face.")
    return warnings
