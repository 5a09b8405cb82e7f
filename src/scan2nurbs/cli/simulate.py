"""scan2nurbs simulate: a scan of a CAD part, as a scanner would give it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scan2nurbs.cli.config import parameters, read_config
from scan2nurbs.cli.options import Given, Stage, place, takes
from scan2nurbs.cli.outputs import POINTS, REPORTS, check_outputs
from scan2nurbs.cli.session import running
from scan2nurbs.errors import ParameterError
from scan2nurbs.simulate.params import SimulateParams

if TYPE_CHECKING:
    from scan2nurbs.report.pictures import Picture
    from scan2nurbs.simulate.scan import SimulatedScan


def parse_views(text: str) -> int | tuple[tuple[float, ...], ...]:
    """Read a number of views, or directions such as "0,0,1; 1,0,0"."""
    if text.strip().isdecimal():
        return int(text)
    return tuple(place(part) for part in text.split(";"))


SIMULATE = Stage(
    section="simulate",
    params=SimulateParams,
    panel="The scanner",
    parse={"views": parse_views, "up": place},
    metavars={"views": "N or X,Y,Z;…", "up": "X,Y,Z"},
)


@takes(SIMULATE)
def simulate(
    part: Annotated[Path, typer.Argument(metavar="PART", help="The CAD part: .step, .iges or .brep.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The scan, with the true face of every point: .ply, .npz or .csv.")
    ],
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The same rows without noise, with the true normals: .ply, .npz or .csv.")
    ] = None,
    *,
    given: Given,
) -> None:
    """Scan a CAD part with a simulated scanner.

    Noise, missing data and outliers are those of a scanner; the same part, parameters and seed give the same scan.
    """
    common = given.common
    config = read_config(common.config, (SIMULATE,))
    params = parameters(SIMULATE, given, config, common.config)
    if common.unit is not None:
        raise ParameterError("'simulate' takes no --unit: a scan has the unit of its part.")
    check_outputs([(output, POINTS), (truth, POINTS), (common.report, REPORTS)], [part, common.config])
    with running("simulate", common, part) as session:
        from scan2nurbs.simulate.scan import simulate_scan  # noqa: PLC0415

        with session.watch("scan"):
            scan = simulate_scan(part, params)
        with session.watch("write"):
            write_scan(scan, output, truth)
        record = simulate_record(scan, part)
        facts = simulate_facts(scan)
        lines = [f"{part}: {len(scan.types)} faces", *(f"  {name}: {value}" for name, value in facts)]
        session.finish(record, lines, outputs=[output, truth], headline=facts, pictures=lambda: simulate_pictures(scan))


def write_scan(scan: SimulatedScan, output: Path, truth: Path | None) -> None:
    """Write the scan, and beside it the truth where it is wanted."""
    from scan2nurbs.io import write_points  # noqa: PLC0415

    write_points(output, scan.points, {"face": scan.face, "view": scan.view}, unit=scan.unit)
    if truth is not None:
        normal = dict(zip(("nx", "ny", "nz"), scan.normal.T, strict=True))
        write_points(truth, scan.clean, {"face": scan.face, **normal}, unit=scan.unit)


def simulate_record(scan: SimulatedScan, part: Path) -> dict[str, Any]:
    """Make the JSON of a run."""
    import numpy as np  # noqa: PLC0415

    count = np.bincount(scan.face[scan.face >= 0], minlength=len(scan.types))
    return {
        "input": {"path": part, "sha256": hashlib.sha256(part.read_bytes()).hexdigest(), "n_faces": len(scan.types), "unit": scan.unit},
        "scan": {
            "n_points": len(scan.points),
            "n_outliers": int(np.count_nonzero(scan.face < 0)),
            "spacing": scan.spacing,
            "noise": scan.noise,
        },
        "faces": [{"face": i, "type": kind, "n_points": n} for i, (kind, n) in enumerate(zip(scan.types, count, strict=True))],
        "parameters": {"simulate": scan.params},
        "warnings": list(scan.notes),
    }


def simulate_facts(scan: SimulatedScan) -> list[tuple[str, str]]:
    """Return the figures that answer the question."""
    return [
        ("points", f"{len(scan.points):,}"),
        ("spacing", f"{scan.spacing:.3g} {scan.unit}"),
        ("noise", f"{scan.noise:.3g} {scan.unit}"),
    ]


def simulate_pictures(scan: SimulatedScan) -> list[Picture]:
    """Draw the scan."""
    from scan2nurbs.report.pictures import groups_picture  # noqa: PLC0415

    said = "Every point of the simulated scan; outliers belong to no face of the part."
    return [groups_picture(scan.points, {"outliers": scan.face < 0}, title="The scan", caption=said, unit=scan.unit)]
