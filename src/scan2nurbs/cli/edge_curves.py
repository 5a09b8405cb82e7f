"""The curves of ``scan2nurbs edges --curves``: traced, written, and told of in the record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scan2nurbs.cloud import PointCloud
    from scan2nurbs.edges.network import EdgeNetwork


def write_network(path: Path, cloud: PointCloud, network: EdgeNetwork, h: float) -> None:
    """Write the curves in the input's coordinates.

    Raises
    ------
    NoResultError
        If there are none.
    """
    import numpy as np  # noqa: PLC0415
    from scipy.interpolate import BSpline  # noqa: PLC0415

    from scan2nurbs.brep.curve_files import NamedCurve, write_curves  # noqa: PLC0415
    from scan2nurbs.errors import NoResultError  # noqa: PLC0415

    if not network.curves:
        raise NoResultError("No edge of the scan is long enough to be a curve, so no file of curves is written.")
    named = []
    for number, edge in enumerate(network.curves, start=1):
        spline = edge.curve.spline
        line = edge.curve.sample(0.5 * h) + cloud.origin
        line = np.concatenate([line, line[:1]]) if edge.curve.closed else line
        named.append(NamedCurve(f"edge_{number}", BSpline(spline.t, spline.c + cloud.origin, spline.k), line))
    write_curves(path, named, unit=cloud.unit)


def network_record(network: EdgeNetwork) -> dict[str, Any]:
    """Make the JSON of the curves."""
    return {
        "points": network.counts,
        "corners": len(network.corners),
        "curves": [
            {
                "closed": edge.curve.closed,
                "corners": [end for end in edge.ends if end >= 0],
                "n_points": len(edge.curve.points),
                "length": edge.curve.length,
                "rms": edge.curve.rms,
                "max": edge.curve.max_deviation,
                "n_control_points": len(edge.curve.spline.c),
            }
            for edge in network.curves
        ],
    }
