"""Write a simulated scan, and its truth beside it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from scan2nurbs.io import atomic_path, write_points
from scan2nurbs.simulate.scan import SimulatedScan


def write_scan(scan: SimulatedScan, path: str | os.PathLike[str], truth: str | os.PathLike[str] | None = None) -> None:
    """Write what a scanner would give, and optionally what is true of it.

    Parameters
    ----------
    path : path
        .ply, .npz or .csv: the coordinates and nothing else.
    truth : path, optional
        .npz: ``label`` (N,) int32, the true face of every row of the scan, −1 for outliers; ``clean`` and ``normal`` (M, 3), the true
        places and outward normals of the rows that are no outliers, in their order; ``view`` (N,); ``h``, the mean spacing; ``noise``,
        its share that is the standard deviation along the ray; ``types`` of the faces; ``diagonal`` of the scanned box; ``unit``.

    Raises
    ------
    OutputError
        If a file cannot be written; it then does not appear.
    """
    write_points(path, scan.points, {}, unit=scan.unit)
    if truth is None:
        return
    real = scan.face >= 0
    clean = scan.clean[real]
    with atomic_path(Path(truth)) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream,
            label=scan.face,
            clean=clean,
            normal=scan.normal[real],
            view=scan.view,
            h=scan.spacing,
            noise=scan.noise / scan.spacing,
            types=np.array(scan.types),
            diagonal=np.linalg.norm(np.ptp(clean, axis=0)),
            unit=scan.unit,
        )
