"""Reading a cloud from binary PLY and from text, beside other libraries, and sorting it into cells: ``python -m benchmarks.reading``.

Each reads the same two files, of float64 and of six decimals, from memory of the system; the least of some rounds counts. Returns lines
of a table; `benchmarks.speed` writes them into docs/speed.md.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.clouds import random_cloud
from benchmarks.peers import our_cells
from scan2nurbs.io import read_scan, write_points

SIZE = 1_678_267


def _open3d(path: Path) -> object:
    import open3d

    return open3d.io.read_point_cloud(str(path))


def _numpy(path: Path) -> object:
    return np.loadtxt(path)


def _polars(path: Path) -> object:
    import polars as pl

    columns = dict.fromkeys("xyz", pl.Float64)
    return pl.read_csv(path, has_header=False, separator=" ", schema=columns).to_numpy()


READERS: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "scan2nurbs": (read_scan, ("binary PLY", "text")),
    "Open3D": (_open3d, ("binary PLY", "text")),
    "polars.read_csv": (_polars, ("text",)),
    "numpy.loadtxt": (_numpy, ("text",)),
}


def least(work: Callable[[], object], rounds: int) -> float:
    """Return the least wall time of some rounds."""
    taken = []
    for _ in range(rounds):
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return min(taken)


def reading(size: int = SIZE, rounds: int = 4) -> list[str]:
    """Time all readers; return the table."""
    points = random_cloud(size)
    lines = [f"| {size:,} points | by | s |", "|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        files = {"binary PLY": Path(folder) / "cloud.ply", "text": Path(folder) / "cloud.xyz"}
        write_points(files["binary PLY"], points, {}, unit="mm")
        np.savetxt(files["text"], points, fmt="%.6f")
        for what, path in files.items():
            for name, (reader, can) in READERS.items():
                if what in can:
                    try:
                        taken = least(lambda path=path, reader=reader: reader(path), rounds)
                    except ImportError as missing:
                        print(f"{name}: {missing}")
                        continue
                    lines.append(f"| {what} | {name} | {taken:.2f} |")
    our_cells(points[:3000], 0.0, 0.0)  # loads and compiles
    lines.append(f"| sorting into cells | scan2nurbs | {least(lambda: our_cells(points, 0.0, 0.0), rounds):.2f} |")
    return lines


if __name__ == "__main__":
    print(*reading(), sep="\n")
