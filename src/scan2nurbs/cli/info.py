"""scan2nurbs info: what a scan holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scan2nurbs.cli.config import read_config
from scan2nurbs.cli.options import Given, takes
from scan2nurbs.cli.outputs import REPORTS, check_outputs
from scan2nurbs.cli.session import running

if TYPE_CHECKING:
    from scan2nurbs.api import Measured
    from scan2nurbs.report.pictures import Picture


@takes()
def info(scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan.")], *, given: Given) -> None:
    """Say what a scan holds: points, extent, unit, spacing, noise."""
    common = given.common
    read_config(common.config, ())
    check_outputs([(common.report, REPORTS)], [scan, common.config])
    with running("info", common, scan) as session:
        from scan2nurbs.api import measure  # noqa: PLC0415
        from scan2nurbs.cli import records  # noqa: PLC0415

        with session.watch("measure"):
            measured = measure(scan, common.unit, progress=session.bar("measuring"))
        cloud, scale = measured.cloud, measured.scale
        record = {
            "input": records.input_record(cloud),
            "scale": records.scale_record(scale),
            "warnings": [*cloud.notes, *records.scale_warnings(scale)],
        }
        facts = info_facts(measured)
        lines = [records.input_line(cloud), *records.aligned(facts)]
        session.finish(record, lines, headline=facts, pictures=lambda: info_pictures(measured))


def info_facts(measured: Measured) -> list[tuple[str, str]]:
    """Return the answer as names and values."""
    cloud, scale = measured.cloud, measured.scale
    size = cloud.points.max(axis=0) - cloud.points.min(axis=0)
    return [
        ("extent", " × ".join(f"{side:.4g}" for side in size) + f" {cloud.unit}"),
        ("spacing", f"{scale.h:.3g} {cloud.unit}"),
        ("nearest point", f"{scale.spacing:.3g} {cloud.unit} on average"),
        ("noise", f"{scale.noise:.3g} {cloud.unit} ({scale.noise / scale.h:.2g} of the spacing)"),
        ("left out", f"{cloud.n_invalid:,} rows that are no point, {cloud.n_duplicates:,} duplicates"),
    ]


def info_pictures(measured: Measured) -> list[Picture]:
    """Draw the cloud."""
    from scan2nurbs.report.pictures import groups_picture  # noqa: PLC0415

    cloud = measured.cloud
    return [groups_picture(cloud.points, {}, title="The scan", caption="Every point of the scan.", unit=cloud.unit)]
