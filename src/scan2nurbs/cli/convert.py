"""scan2nurbs convert: a whole part as one CAD model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scan2nurbs.cli import records
from scan2nurbs.cli.config import read_config
from scan2nurbs.cli.options import Given, takes
from scan2nurbs.cli.outputs import CAD, MESHES, POINTS, REPORTS, check_outputs, check_rhino
from scan2nurbs.cli.part_options import STAGES, effective, inputs, part_params
from scan2nurbs.cli.session import running

if TYPE_CHECKING:
    from scan2nurbs.part import Model
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
        from scan2nurbs.part_files import part_facts, part_record, write_deviations  # noqa: PLC0415

        model = reconstruct(scan, params, unit=common.unit, progress=session.progress)
        record = part_record(model, effective(params))
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


def verdict(model: Model) -> str:
    """Say in one line what came out and how far it lies from the points."""
    import numpy as np  # noqa: PLC0415

    off, unit = np.abs(model.deviation[np.isfinite(model.deviation)]), model.cloud.unit
    rms, p95 = np.sqrt(np.mean(off**2)), np.quantile(off, 0.95)
    return (
        f"deviation: rms {rms:.3g} {unit}, 95 % within {p95:.3g} {unit}, largest {off.max():.3g} {unit}"
        f" ({len(off):,} points, {len(model.faces.fits)} faces, noise {model.scale.noise:.3g} {unit})"
    )


def _pictures(model: Model) -> list[Picture]:
    from scan2nurbs.part_pictures import part_pictures  # noqa: PLC0415 - brings matplotlib

    return part_pictures(model)
