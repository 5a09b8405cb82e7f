"""scan2nurbs surface: one functional surface as a trimmed NURBS face."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from scan2nurbs.cli import records
from scan2nurbs.cli.config import read_config
from scan2nurbs.cli.options import Given, takes
from scan2nurbs.cli.outputs import CAD, MESHES, POINTS, REPORTS, check_outputs, check_rhino
from scan2nurbs.cli.session import running
from scan2nurbs.cli.surface_options import STAGES, effective, surface_params

if TYPE_CHECKING:
    from scan2nurbs.pipeline import SurfaceModel, SurfaceParams

Schema = Literal["ap242", "ap214"]


@takes(*STAGES)
def surface(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The trimmed face: .step, .iges, .brep or .3dm (or a mesh).")
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Every row of the scan with strength, edge, face (0 or −1) and deviation: .ply, .npz or .csv."),
    ] = None,
    mesh: Annotated[Path | None, typer.Option(metavar="FILE", help="The face as triangles: .stl, .ply or .obj.")] = None,
    schema: Annotated[Schema, typer.Option(help="Schema of a STEP file.")] = "ap242",
    *,
    given: Given,
) -> None:
    """Rebuild one functional surface as a trimmed NURBS face.

    The boundary of the surface is found, the points inside it are fitted by a B-spline surface, and the surface is trimmed by the boundary.
    Without options everything is chosen from the scan; --seed chooses the surface where there are several. Radii and other lengths in
    "spacings" are in units of the distance between points, which 'scan2nurbs info' tells.
    """
    common = given.common
    params = surface_params(given, read_config(common.config, STAGES))
    selections = [selection.source for selection in (params.boundary.keep_only, params.boundary.drop) if selection is not None]
    outputs = [(output, CAD + MESHES), (points, POINTS), (mesh, MESHES), (common.report, REPORTS)]
    check_outputs(outputs, [scan, common.config, *selections])
    check_rhino(output)
    with running("surface", common, scan) as session:
        from scan2nurbs.pipeline import reconstruct_surface  # noqa: PLC0415

        model = reconstruct_surface(scan, params, unit=common.unit, progress=session.progress)
        record = surface_record(model, params)
        with session.watch("write"):
            for path in (output, mesh):
                if path is not None:
                    record["warnings"] += model.write(path, schema=schema.upper()).notes
            if points is not None:
                write_labelled(points, model)
        facts = surface_facts(model)
        session.finish(
            record,
            [records.input_line(model.cloud), *records.aligned(facts)],
            verdict=deviation_line(model),
            outputs=[output, points, mesh],
            headline=facts,
            pictures=lambda: _pictures(model),
        )


def surface_record(model: SurfaceModel, params: SurfaceParams) -> dict[str, Any]:
    """Make the JSON of a run."""
    cloud, report = model.cloud, model.report
    warnings = [*cloud.notes, *records.scale_warnings(model.scale), *report["warnings"]]
    head = {"input": records.input_record(cloud), "scale": records.scale_record(model.scale)}
    return head | report | {"parameters": effective(params), "warnings": warnings}


def surface_facts(model: SurfaceModel) -> list[tuple[str, str]]:
    """Return the figures that answer the question."""
    fit, unit = model.fit, model.cloud.unit
    rows, columns = fit.control_points.shape[:2]
    return [
        ("rms", f"{fit.rms:.3g} {unit}"),
        ("95 %", f"{fit.p95:.3g} {unit}"),
        ("largest", f"{fit.max:.3g} {unit}"),
        ("noise", f"{model.scale.noise:.3g} {unit}"),
        ("control points", f"{fit.n_control_points} ({rows} × {columns})"),
        ("points inside", f"{model.inside.sum():,}"),
        ("boundary", f"{len(model.trim.loops)} loop{'s' if len(model.trim.loops) != 1 else ''}, {model.face.n_edges} edges"),
        ("face", "valid" if model.face.valid else "not valid by the CAD kernel's check"),
    ]


def deviation_line(model: SurfaceModel) -> str:
    """Say in one line how far the surface lies from the points."""
    fit, unit = model.fit, model.cloud.unit
    return (
        f"deviation: rms {fit.rms:.3g} {unit}, 95 % within {fit.p95:.3g} {unit}, largest {fit.max:.3g} {unit}"
        f" ({int(fit.inliers.sum()):,} points, {fit.n_control_points} control points, noise {model.scale.noise:.3g} {unit})"
    )


def write_labelled(path: Path, model: SurfaceModel) -> None:
    """Write every row of the scan with what was found about it."""
    import numpy as np  # noqa: PLC0415

    from scan2nurbs.io import write_points  # noqa: PLC0415

    cloud = model.cloud
    deviation = np.full(len(cloud.points), np.nan)
    deviation[model.fitted] = model.fit.residuals
    columns = {
        "strength": cloud.to_rows(model.edges.strength.astype(np.float32), np.nan),
        "edge": cloud.to_rows(model.band.on_edge, False),
        "face": cloud.to_rows(np.where(model.inside, 0, -1).astype(np.int32), -1),
        "deviation": cloud.to_rows(deviation, np.nan),
    }
    write_points(path, cloud.to_rows(cloud.points + cloud.origin, np.nan), columns, unit=cloud.unit)


def _pictures(model: SurfaceModel) -> list[Any]:
    from scan2nurbs.cli.surface_pictures import surface_pictures  # noqa: PLC0415 - brings matplotlib

    return surface_pictures(model)
