"""scan2nurbs convert: a whole part as one CAD model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from scan2nurbs.cli import records
from scan2nurbs.cli.config import read_config
from scan2nurbs.cli.options import Given, takes
from scan2nurbs.cli.outputs import CAD, MESHES, POINTS, REPORTS, check_outputs, check_rhino
from scan2nurbs.cli.part_options import STAGES, effective, inputs, part_params
from scan2nurbs.cli.segment import face_facts, write_faces
from scan2nurbs.cli.session import running

if TYPE_CHECKING:
    from scan2nurbs.part import Model, PartParams
    from scan2nurbs.report.pictures import Picture

Schema = Literal["ap242", "ap214"]


@takes(*STAGES)
def convert(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The CAD model: .step, .iges, .brep or .3dm (or a mesh).")
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Every row of the scan with strength, edge, face and deviation: .ply, .npz or .csv."),
    ] = None,
    mesh: Annotated[Path | None, typer.Option(metavar="FILE", help="The model as triangles: .stl, .ply or .obj.")] = None,
    schema: Annotated[Schema, typer.Option(help="Schema of a STEP file.")] = "ap242",
    *,
    given: Given,
) -> None:
    """Rebuild a whole part as one CAD model.

    The scan is split into faces, each face gets the simplest surface that explains its points (plane, cylinder, cone, sphere, torus,
    extrusion, revolution, or a B-spline surface), neighbouring faces are trimmed along shared edges, and the whole is sewn: into a solid
    where the scan closes, into a shell with free borders where it does not. Without options everything is chosen from the scan.
    """
    common = given.common
    params = part_params(given, read_config(common.config, STAGES), STAGES)
    outputs = [(output, CAD + MESHES), (points, POINTS), (mesh, MESHES), (common.report, REPORTS)]
    check_outputs(outputs, inputs(scan, given, params.corrections))
    check_rhino(output)
    with running("convert", common, scan) as session:
        from scan2nurbs.part import reconstruct  # noqa: PLC0415

        model = reconstruct(scan, params, unit=common.unit, progress=session.progress)
        record = part_record(model, params)
        with session.watch("write"):
            for path in (output, mesh):
                if path is not None:
                    record["warnings"] += model.write(path, schema=schema.upper()).notes
            if points is not None:
                write_deviations(points, model)
        facts = part_facts(model)
        session.finish(
            record,
            [records.input_line(model.cloud), *records.aligned(facts)],
            verdict=verdict(model),
            outputs=[output, points, mesh],
            headline=facts,
            pictures=lambda: _pictures(model),
        )


def part_record(model: Model, params: PartParams) -> dict[str, Any]:
    """Make the JSON of a run."""
    warnings = [*model.cloud.notes, *records.scale_warnings(model.scale), *model.report["warnings"]]
    head = {"input": records.input_record(model.cloud), "scale": records.scale_record(model.scale)}
    return head | model.report | {"parameters": effective(params), "warnings": warnings}


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


def verdict(model: Model) -> str:
    """Say in one line what came out and how far it lies from the points."""
    import numpy as np  # noqa: PLC0415

    off, unit = np.abs(model.deviation[np.isfinite(model.deviation)]), model.cloud.unit
    rms, p95 = np.sqrt(np.mean(off**2)), np.quantile(off, 0.95)
    return (
        f"deviation: rms {rms:.3g} {unit}, 95 % within {p95:.3g} {unit}, largest {off.max():.3g} {unit}"
        f" ({len(off):,} points, {len(model.faces.fits)} faces, noise {model.scale.noise:.3g} {unit})"
    )


def write_deviations(path: Path, model: Model) -> None:
    """Write every row of the scan with what was found about it."""
    import numpy as np  # noqa: PLC0415

    cloud = model.cloud
    write_faces(
        path,
        model,
        strength=cloud.to_rows(model.edges.strength.astype(np.float32), np.nan),
        edge=cloud.to_rows(model.edges.mask, False),
        deviation=cloud.to_rows(model.deviation, np.nan),
    )


def _pictures(model: Model) -> list[Picture]:
    from scan2nurbs.cli.part_pictures import part_pictures  # noqa: PLC0415 - brings matplotlib

    return part_pictures(model)
