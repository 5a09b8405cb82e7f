"""scan2nurbs edges: which points lie on an edge."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scan2nurbs.cli.config import parameters, read_config
from scan2nurbs.cli.options import Given, Stage, takes
from scan2nurbs.cli.outputs import POINTS, REPORTS, check_outputs
from scan2nurbs.cli.session import running
from scan2nurbs.edges.params import EdgeParams

if TYPE_CHECKING:
    from scan2nurbs.cloud import PointCloud
    from scan2nurbs.edges.detect import Edges
    from scan2nurbs.report.pictures import Picture

EDGES = Stage(section="edges", params=EdgeParams, panel="Finding edges")


@takes(EDGES)
def edges(
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Every row of the scan with strength and edge: .ply, .npz or .csv."),
    ] = None,
    *,
    given: Given,
) -> None:
    """Mark the points of a scan that lie on an edge.

    Without options the operator, its radius and its threshold are chosen from the scan. The operators dn, vdn and edn are those of the
    paper, with radii in units of the mean distance to the nearest other point.
    """
    common = given.common
    config = read_config(common.config, (EDGES,))
    params = parameters(EDGES, given, config, common.config)
    check_outputs([(output, POINTS), (common.report, REPORTS)], [scan, common.config])
    with running("edges", common, scan) as session:
        from scan2nurbs.api import detect_edges  # noqa: PLC0415
        from scan2nurbs.cloud import as_cloud  # noqa: PLC0415

        with session.watch("read"):
            cloud = as_cloud(scan, common.unit)
        with session.watch("edges"):
            found = detect_edges(cloud, params, progress=session.bar("finding edges"))
        if output is not None:
            with session.watch("write"):
                write_edges(output, cloud, found)
        record = edges_record(cloud, found, params)
        facts = edges_facts(record)
        session.finish(record, edges_lines(cloud, facts), outputs=[output], headline=facts, pictures=lambda: edges_pictures(cloud, found))


def write_edges(path: Path, cloud: PointCloud, found: Edges) -> None:
    """Write every row of the input with its strength and whether it is on an edge."""
    import numpy as np  # noqa: PLC0415

    from scan2nurbs.io import write_points  # noqa: PLC0415

    points = cloud.to_rows(cloud.points + cloud.origin, np.nan)
    write_points(path, points, {"strength": found.strength.astype(np.float32), "edge": found.mask}, unit=cloud.unit)


def edges_record(cloud: PointCloud, found: Edges, params: EdgeParams) -> dict[str, Any]:
    """Make the JSON of a run."""
    import numpy as np  # noqa: PLC0415

    from scan2nurbs.cli import records  # noqa: PLC0415

    n_edge, n_undefined = int(np.count_nonzero(found.mask)), int(np.count_nonzero(np.isnan(found.strength))) - cloud.n_invalid
    warnings = [*cloud.notes, *records.scale_warnings(found)]
    share = n_undefined / len(cloud.rows)
    if share > 0.05:
        warnings.append(
            f"{share:.0%} of the points have no strength, because their neighbourhoods hold too few points; a larger radius helps."
        )
    return {
        "input": records.input_record(cloud),
        "scale": records.scale_record(found),
        "edges": {
            "n_points": n_edge,
            "n_undefined": n_undefined,
            "threshold": found.threshold,
            "radii": found.radii,
            "runs": [{"operator": operator, "kept": kept} for operator, kept in found.runs],
            "degenerate": found.counts,
        },
        "parameters": {"edges": params},
        "warnings": warnings,
    }


def edges_facts(record: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the figures that answer the question."""
    found, unit = record["edges"], record["input"]["unit"]
    share = found["n_points"] / max(record["input"]["n_rows"], 1)
    return [
        ("edge points", f"{found['n_points']:,} ({share:.1%})"),
        ("operators", " → ".join(run["operator"] for run in found["runs"])),
        ("threshold", f"{found['threshold']:.3g}°"),
        ("radii", ", ".join(f"{radius:.3g} {unit}" for radius in found["radii"].values())),
        ("noise", f"{record['scale']['noise']:.3g} {unit}"),
    ]


def edges_lines(cloud: PointCloud, facts: list[tuple[str, str]]) -> list[str]:
    """Return the answer for a reader."""
    from scan2nurbs.cli import records  # noqa: PLC0415

    return [records.input_line(cloud), *records.aligned(facts)]


def edges_pictures(cloud: PointCloud, found: Edges) -> list[Picture]:
    """Draw the report's pictures."""
    import numpy as np  # noqa: PLC0415

    from scan2nurbs.report.pictures import groups_picture, strength_picture  # noqa: PLC0415

    kept = np.flatnonzero(cloud.rows >= 0)
    points = cloud.points[cloud.rows[kept]]
    said = "Points whose strength exceeds the threshold, in every run."
    return [
        strength_picture(points, found.strength[kept], unit=cloud.unit, threshold=found.threshold),
        groups_picture(points, {"on an edge": found.mask[kept]}, title="Edge points", caption=said, unit=cloud.unit),
    ]
