"""What one takes away of a whole part besides the model: its record, the figures that answer the question, labelled points."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scan2nurbs.io import write_points
from scan2nurbs.scan_record import input_record, scale_record, scale_warnings

if TYPE_CHECKING:
    from scan2nurbs.part import Model
    from scan2nurbs.part_faces import Parted


def part_record(model: Model, parameters: dict[str, Any]) -> dict[str, Any]:
    """Make the JSON of a run; `parameters` is everything that was in effect, by stage."""
    warnings = [*model.cloud.notes, *scale_warnings(model.scale), *model.report["warnings"]]
    head = {"input": input_record(model.cloud), "scale": scale_record(model.scale)}
    return head | model.report | {"parameters": parameters, "warnings": warnings}


def part_facts(model: Model) -> list[tuple[str, str]]:
    """Return the figures that answer the question."""
    part, unit, found = model.part, model.cloud.unit, model.report["model"]
    closed = f"{part.n_solids} closed solid{'s' if part.n_solids != 1 else ''}" if part.closed else f"open, {part.n_free_edges} free edges"
    volume = [("volume", f"{part.volume:.5g} {unit}³")] if part.closed else []
    return [
        *face_facts(model)[:3],
        ("model", f"{'valid' if part.valid else 'NOT valid'}, {closed}"),
        ("edges", f"{len(part.edges)}, largest tolerance {part.max_tolerance:.2g} {unit}"),
        *volume,
        ("rms", f"{found['rms']:.3g} {unit}"),
        ("noise", f"{model.scale.noise:.3g} {unit}"),
        ("coverage", f"{part.coverage:.1%} of the scan lie on the model; {part.precision:.1%} of the model lie on the scan"),
    ]


def face_facts(parted: Parted) -> list[tuple[str, str]]:
    """Return how many faces there are, and of which types."""
    kinds = Counter(fit.shape.kind for fit in parted.faces.fits)
    n_none = int((parted.faces.label < 0).sum())
    return [
        ("faces", f"{len(parted.faces.fits)}"),
        ("types", ", ".join(f"{n} {kind}" for kind, n in kinds.most_common())),
        ("points without a face", f"{n_none:,} ({n_none / len(parted.faces.label):.1%})"),
        ("noise", f"{parted.scale.noise:.3g} {parted.cloud.unit}"),
    ]


def write_deviations(path: Path, model: Model) -> None:
    """Write every row of the scan with what was found about it."""
    cloud = model.cloud
    write_faces(
        path,
        model,
        strength=cloud.to_rows(model.edges.strength.astype(np.float32), np.nan),
        edge=cloud.to_rows(model.edges.mask, False),
        deviation=cloud.to_rows(model.deviation, np.nan),
    )


def write_faces(path: Path, parted: Parted, **columns: Any) -> None:
    """Write every row of the scan with its face."""
    cloud = parted.cloud
    write_points(path, cloud.to_rows(cloud.points + cloud.origin, np.nan), {"face": parted.label} | columns, unit=cloud.unit)
