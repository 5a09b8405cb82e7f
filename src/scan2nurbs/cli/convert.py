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
from scan2nurbs.errors import ParameterError

if TYPE_CHECKING:
    from scan2nurbs.part import Model, PartParams
    from scan2nurbs.report.pictures import Picture

Schema = Literal["ap242", "ap214"]


@takes(*STAGES)
def convert(
    scan: Annotated[Path | None, typer.Argument(metavar="SCAN", help="The scan.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The CAD model: .step, .iges, .brep or .3dm (or a mesh).")
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Every row of the scan with strength, edge, face and deviation: .ply, .npz or .csv."),
    ] = None,
    mesh: Annotated[Path | None, typer.Option(metavar="FILE", help="The model as triangles: .stl, .ply or .obj.")] = None,
    project: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Instead of SCAN: do again what was done in the studio in this project.")
    ] = None,
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
    if project is not None:
        scan, params, unit = _replayed(project, scan, given)
    elif scan is None:
        raise ParameterError("Name the SCAN to convert, or a --project of the studio.")
    else:
        params, unit = part_params(given, read_config(common.config, STAGES), STAGES), common.unit
    outputs = [(output, CAD + MESHES), (points, POINTS), (mesh, MESHES), (common.report, REPORTS)]
    check_outputs(outputs, inputs(scan, given, params.corrections))
    check_rhino(output)
    with running("convert", common, scan) as session:
        from scan2nurbs.part import reconstruct  # noqa: PLC0415
        from scan2nurbs.part_files import part_facts, part_record, write_deviations  # noqa: PLC0415

        model = reconstruct(scan, params, unit=unit, progress=session.progress)
        record = part_record(model, effective(params, STAGES))
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


def _replayed(project: Path, scan: Path | None, given: Given) -> tuple[Path, PartParams, str | None]:
    """Return the scan of a project, the parameters that its edits amount to, and the unit."""
    from scan2nurbs.studio.project import open_project  # noqa: PLC0415

    if scan is not None or given.common.config is not None or given.common.unit is not None or any(map(given.of, STAGES)):
        raise ParameterError("A --project says by itself which scan it is about, and all parameters; give no others with it.")
    opened = open_project(project, check=True)
    return opened.scan, opened.plan.params, opened.plan.unit


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
