"""The whole EDN beside SciPy's spacing, taken in turns in one process: ``python -m benchmarks.ratios [--size N] [--rounds N]``.

Whatever else the machine does meets both alike, and the least of several rounds counts; the processor time says what a wall clock on a
shared machine cannot. Returns lines of a table; `benchmarks.speed` writes them into docs/speed.md.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.clouds import grid_cloud, random_cloud
from scan2nurbs import EdgeParams, detect_edges
from scan2nurbs.edges.normals import normals_at
from scan2nurbs.kernels.runner import set_threads
from scan2nurbs.kernels.symmetric3 import line_angles
from scan2nurbs.scale import measure_scale

SIZE = 1_678_267
SAMPLE = 2000
THREADS = 2


def spacing(points: NDArray[np.float64]) -> object:
    """Do what SciPy needs for eq. 2.1 alone."""
    return cKDTree(points).query(points, 2, workers=THREADS)


def edn(points: NDArray[np.float64], large_radius: float = 30.0, exact: bool = False) -> object:
    """Run EDN from the unsorted array to the strengths in its order."""
    return detect_edges(points, EdgeParams(operator="edn", large_radius=large_radius, exact=exact))


def in_turns(works: dict[str, Callable[[], object]], rounds: int) -> dict[str, tuple[float, float]]:
    """Return of each work the least wall and processor time, in seconds, of several rounds in which all take turns."""
    least = dict.fromkeys(works, (np.inf, np.inf))
    for _ in range(rounds):
        for name, work in works.items():
            wall, processor = time.perf_counter(), time.process_time()
            work()
            now = (time.perf_counter() - wall, time.process_time() - processor)
            least[name] = (min(least[name][0], now[0]), min(least[name][1], now[1]))
    return least


def ratios(size: int, rounds: int) -> list[str]:
    """Time EDN and SciPy's spacing in turns; return the table."""
    points = random_cloud(size)
    small = points[:3000].copy()
    million = random_cloud(1_000_000)
    for exact in (False, True):
        edn(small, exact=exact)  # loads and compiles
    edn(small, 120.0)
    works = {
        "SciPy, spacing alone": lambda: spacing(points),
        "EDN, r_l = 30 d̄": lambda: edn(points),
        "EDN, r_l = 30 d̄, every point summed": lambda: edn(points, exact=True),
        "EDN, r_l = 120 d̄": lambda: edn(points, 120.0),
        "EDN of 1,000,000 points": lambda: edn(million),
    }
    least = in_turns(works, rounds)
    base = least["SciPy, spacing alone"]
    lines = ["| in turns, the least of each | wall, s | of SciPy's | processor time, s | of SciPy's |", "|---|---|---|---|---|"]
    for name, (wall, processor) in least.items():
        lines.append(f"| {name} | {wall:.2f} | **{wall / base[0]:.2f}** | {processor:.2f} | **{processor / base[1]:.2f}** |")
    return lines


def cluster_errors(size: int) -> list[str]:
    """Compare normals and VDN with those of every point summed; return the table."""
    lines = [
        "| cloud | r_l | points a ball | normals where a plane is defined, 50 / 99 % / max | VDN, 50 / 90 / 99 % | over 20° differently |",
        "|---|---|---|---|---|---|",
    ]
    for kind, make in (("random", random_cloud), ("grid", grid_cloud)):
        scale = measure_scale(make(size))
        for factor in (30.0, 60.0, 120.0):
            radius = factor * scale.spacing
            exact = normals_at(scale.cells, radius, sectors=4, exact=True)
            ours = normals_at(scale.cells, radius, sectors=4)
            sample = _with_plane(scale.cells.points, radius)
            tilt = np.nan_to_num(line_angles(exact.normal[sample], ours.normal[sample]))
            vdn = np.abs(exact.sector_angle - ours.sector_angle)
            flips = np.mean((exact.sector_angle > 20.0) != (ours.sector_angle > 20.0))
            q = np.quantile(tilt, [0.5, 0.99, 1.0])
            v = np.nanquantile(vdn, [0.5, 0.9, 0.99])
            lines.append(
                f"| {kind} | {factor:g} d̄ | {exact.balls.n_points.mean():,.0f} | {q[0]:.2f}° / {q[1]:.2f}° / {q[2]:.2f}° "
                f"| {v[0]:.2f}° / {v[1]:.2f}° / {v[2]:.2f}° | {100 * flips:.2f} % |"
            )
    return lines


def _with_plane(points: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
    """Return some 2,000 points in whose balls a plane is defined: the least variance is below half of the middle one."""
    tree = cKDTree(points)
    kept = []
    for i in np.linspace(0, len(points) - 1, SAMPLE).astype(int):
        members = points[tree.query_ball_point(points[i], radius)]
        if len(members) >= 5:
            variance = np.linalg.eigvalsh(np.cov(members.T))
            if variance[0] < 0.5 * variance[1]:
                kept.append(i)
    return np.array(kept, np.int64)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.ratios")
    parser.add_argument("--size", type=int, default=SIZE)
    parser.add_argument("--rounds", type=int, default=4)
    options = parser.parse_args(arguments)
    set_threads(THREADS)
    print(*ratios(options.size, options.rounds), sep="\n", flush=True)
    print(*cluster_errors(min(options.size, 150_000)), sep="\n", flush=True)


if __name__ == "__main__":
    main()
