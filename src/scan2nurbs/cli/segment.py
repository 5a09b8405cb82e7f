"""scan2nurbs segment: which points belong to which face."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scan2nurbs.cli import records
from scan2nurbs.cli.config import read_config
from scan2nurbs.cli.options import Given, takes
from scan2nurbs.cli.outputs import POINTS, REPORTS, check_outputs
from scan2nurbs.cli.part_options import FACE_STAGES, effective, inputs, part_params
from scan2nurbs.cli.session import running

if TYPE_CHECKING:
    from scan2nurbs.part_faces import Parted
    from scan2nurbs.report.pictures import Picture


@takes(*FACE_STAGES)
def segment(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Every row of the scan with its face: .ply, .npz or .csv.")
    ] = None,
    *,
    given: Given,
) -> None:
    """Split a scan into faces.

    Every point gets the number of its face, or −1 where it belongs to none. Faces are numbered from 0 by falling size; the report tells
    the type of each. Without options everything is chosen from the scan.
    """
    common = given.common
    params = part_params(given, read_config(common.config, FACE_STAGES), FACE_STAGES)
    check_outputs([(output, POINTS), (common.report, REPORTS)], inputs(scan, given, params.corrections))
    with running("segment", common, scan) as session:
        from scan2nurbs.part import part_scan  # noqa: PLC0415
        from scan2nurbs.part_files import face_facts, write_faces  # noqa: PLC0415
        from scan2nurbs.part_report import segment_report  # noqa: PLC0415

        parted = part_scan(scan, params, unit=common.unit, progress=session.progress, watch=session.watch)
        if output is not None:
            with session.watch("write"):
                write_faces(output, parted)
        report = segment_report(parted, params, {})
        cloud = parted.cloud
        head = {"input": records.input_record(cloud), "scale": records.scale_record(parted.scale)}
        warnings = [*cloud.notes, *records.scale_warnings(parted.scale), *report["warnings"]]
        record = head | report | {"parameters": effective(params, FACE_STAGES), "warnings": warnings}
        facts = face_facts(parted)
        lines = [records.input_line(cloud), *records.aligned(facts)]
        session.finish(record, lines, outputs=[output], headline=facts, pictures=lambda: _pictures(parted))


def _pictures(parted: Parted) -> list[Picture]:
    from scan2nurbs.report.part_pictures import faces_picture  # noqa: PLC0415 - brings matplotlib
    from scan2nurbs.report.pictures import strength_picture  # noqa: PLC0415

    points, unit = parted.cloud.points, parted.cloud.unit
    return [
        faces_picture(points, parted.faces.label, unit=unit),
        strength_picture(points, parted.edges.strength, unit=unit, threshold=parted.edges.threshold),
    ]
