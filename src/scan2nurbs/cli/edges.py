"""scan2nurbs edges: which points lie on an edge."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scan2nurbs.cli.config import parameters, read_config
from scan2nurbs.cli.options import Given, Stage, takes
from scan2nurbs.cli.outputs import CURVES, POINTS, REPORTS, check_outputs
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
    curves: Annotated[
        Path | None,
        typer.Option("--curves", metavar="FILE", help="Curves along the edges: .step, .iges, .brep (B-splines), .ply or .obj (lines)."),
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
    check_outputs([(output, POINTS), (curves, CURVES), (common.report, REPORTS)], [scan, common.config])
    with running("edges", common, scan) as session:
        from scan2nurbs.api import edges_by_row  # noqa: PLC0415
        from scan2nurbs.cloud import as_cloud  # noqa: PLC0415
        from scan2nurbs.edges.detect import detect  # noqa: PLC0415
        from scan2nurbs.edges.kinds import BORDER, with_kinds  # noqa: PLC0415
        from scan2nurbs.scale import measure_scale  # noqa: PLC0415

        with session.watch("read"):
            cloud = as_cloud(scan, common.unit)
        with session.watch("edges"):
            bar = session.bar("finding edges")
            scale = measure_scale(cloud.points, progress=bar)
            found = with_kinds(scale, detect(cloud.points, scale, params, bar), bar)
        network = None
        if curves is not None:
            from scan2nurbs.edges.network import edge_network  # noqa: PLC0415

            with session.watch("curves"):
                border = None if found.kind is None else found.kind == BORDER
                network = edge_network(cloud.points, scale, found.mask, border=border)
        found = edges_by_row(found, cloud)
        if output is not None or network is not None:
            with session.watch("write"):
                # First what there may be nothing to write of: a run that fails leaves nothing.
                if curves is not None and network is not None:
                    from scan2nurbs.cli.edge_curves import write_network  # noqa: PLC0415

                    write_network(curves, cloud, network, scale.h)
                if output is not None:
                    write_edges(output, cloud, found)
        record = edges_record(cloud, found, params)
        if network is not None:
            from scan2nurbs.cli.edge_curves import network_record  # noqa: PLC0415

            record["edges"]["curves"] = network_record(network)
        facts = edges_facts(record)
        outputs = [output, curves]
        session.finish(record, edges_lines(cloud, facts), outputs=outputs, headline=facts, pictures=lambda: edges_pictures(cloud, found))


def write_edges(path: Path, cloud: PointCloud, found: Edges) -> None:
    """Write every row of the input with its strength, whether it is on an edge, and of what kind that is."""
    import numpy as np  # noqa: PLC0415

    from scan2nurbs.io import write_points  # noqa: PLC0415

    points = cloud.to_rows(cloud.points + cloud.origin, np.nan)
    columns = {"strength": found.strength.astype(np.float32), "edge": found.mask}
    if found.kind is not None:
        columns["kind"] = found.kind
    for name in ("angle", "angle_error", "confidence"):
        if getattr(found, name) is not None:
            columns[name] = getattr(found, name).astype(np.float32)
    write_points(path, points, columns, unit=cloud.unit)


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
            "kinds": kind_counts(found),
        },
        "parameters": {"edges": params},
        "warnings": warnings,
    }


def kind_counts(found: Edges) -> dict[str, int]:
    """Count the points of each kind; empty where kinds were not asked for."""
    from scan2nurbs.edges.kinds import KIND_NAMES  # noqa: PLC0415

    return {} if found.kind is None else {name: int((found.kind == k).sum()) for k, name in enumerate(KIND_NAMES) if k}


def edges_facts(record: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the figures that answer the question."""
    found, unit = record["edges"], record["input"]["unit"]
    share = found["n_points"] / max(record["input"]["n_rows"], 1)
    kinds = ", ".join(f"{count:,} {name}" for name, count in found["kinds"].items() if count)
    curves = found.get("curves")
    return [
        ("edge points", f"{found['n_points']:,} ({share:.1%})"),
        *([("kinds", kinds)] if kinds else []),
        *([("curves", f"{len(curves['curves'])}, meeting in {curves['corners']} corners")] if curves else []),
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
