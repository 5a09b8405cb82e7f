"""Measure speed and memory beside other libraries, on clouds of one blocky part.

    python -m benchmarks.speed [--parts PART ...] [--sizes N ...] [--peers PYTHON] [--crop N] [--repeats N] [--rounds N] [--freecad PYTHON]

from the root of the checkout. The parts are the ratio of EDN to SciPy's spacing, both in turns in one process (`benchmarks.ratios`), the
errors of clusters, normals beside other libraries, whole clouds, reading (`benchmarks.reading`), and B-spline fits (`benchmarks.fits`).
PYTHON is one that has the extra ``bench`` installed (this one by default). Normals and whole clouds are measured in a process each, after
a warm-up on 3,000 points; the least of the repeats counts. Other libraries, which would take minutes, get a crop of the cloud of about
``--crop`` points, and so does scan2nurbs beside them. Prints the tables, and writes them to docs/speed.md, in place of those that stand
there, and a picture to docs/images/speed/.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.clouds import AREA, grid_cloud, random_cloud
from benchmarks.fits import table
from benchmarks.peers import PEERS, our_cells
from benchmarks.ratios import SIZE, THREADS, cluster_errors, ratios
from benchmarks.reading import reading
from scan2nurbs.kernels.runner import set_threads

SIZES = (100_000, 1_000_000, 1_678_267, 10_000_000)
RADII = (1.5, 3.0, 6.0, 30.0)
CLOUDS = {"random": random_cloud, "grid": grid_cloud}
SCRATCH = Path(tempfile.gettempdir()) / "scan2nurbs-speed"
ROOT = Path(__file__).parent.parent
HEAD = """# Speed

Made by `python -m benchmarks.speed` on two threads. Ratios within one table hold; seconds are those of one machine.
"""


@dataclass(frozen=True)
class Run:
    """What one job took: seconds, peak memory beyond the input in bytes a point, and its result a point."""

    seconds: float
    bytes_a_point: float
    result: NDArray[np.float64]


def run(job: str, points: NDArray[np.float64], radius: float, neighbours: float, repeats: int, python: str = sys.executable) -> Run | None:
    """Run a job in a process; None where its library is not installed or it fails."""
    SCRATCH.mkdir(exist_ok=True)
    source, out = SCRATCH / "points.npy", SCRATCH / "out.npz"
    np.save(source, points)
    command = [python, "-m", "benchmarks.peers", job, source, radius, neighbours, repeats, out]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode != 0:
        print(f"{job}: {done.stderr.strip().splitlines()[-1:]}")
        return None
    with np.load(out) as saved:
        return Run(float(saved["seconds"]), float(saved["bytes_a_point"]), saved["result"])


def exact_error(points: NDArray[np.float64], normals: NDArray[np.float64], radius: float, sample: int = 2000) -> str:
    """Compare normals with singular vectors where a plane is defined (ratio of variances below 1/2): 99 % quantile and maximum."""
    tree = KDTree(points)
    angles = []
    for i in np.linspace(0, len(points) - 1, sample).astype(int):
        members = points[tree.query_ball_point(points[i], radius)]
        if len(members) < 4:
            continue
        _, values, axes = np.linalg.svd(members - members.mean(axis=0), full_matrices=False)
        if values[2] ** 2 < 0.5 * values[1] ** 2 and np.linalg.norm(normals[i]) > 0.5:
            sine = np.linalg.norm(np.cross(axes[2], normals[i])) / np.linalg.norm(normals[i])
            angles.append(np.degrees(np.arcsin(min(sine, 1.0))))
    return f"{np.quantile(angles, 0.99):.1e} / {np.max(angles):.1e}" if angles else "no normals"


def whole_clouds(sizes: list[int], repeats: int) -> list[str]:
    """Time EDN from the unsorted array to the strengths, beside what SciPy takes for the spacing alone."""
    lines = [
        "| cloud | points | SciPy spacing, s | sort, s | EDN r_l = 30, s | of SciPy | bytes a point | EDN r_l = 120, s | bytes a point |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind, make in CLOUDS.items():
        for n in sizes:
            points = make(n)
            jobs = ("scipy spacing", "scan2nurbs cells", "scan2nurbs EDN", "scan2nurbs EDN, r_l = 120")
            spacing, cells, edn, wide = (run(job, points, 1.0, 0.0, repeats if n < 5_000_000 else 1) for job in jobs)
            if not (spacing and cells and edn and wide):
                continue
            lines.append(
                f"| {kind} | {len(points):,} | {spacing.seconds:.2f} | {cells.seconds:.2f} | {edn.seconds:.2f} "
                f"| {edn.seconds / spacing.seconds:.2f} | {edn.bytes_a_point:.0f} | {wide.seconds:.2f} | {wide.bytes_a_point:.0f} |"
            )
            print(lines[-1], flush=True)
    return lines


def radius_normals(crop: int, python: str) -> tuple[list[str], dict[str, list[float]]]:
    """Time normals at several radii on a crop, beside the peers; return the table and the seconds a million points by library."""
    lines = [
        "| radius | neighbours | library | s a million points | times ours | bytes a point | error, 99 % / max, degrees |",
        "|---|---|---|---|---|---|---|",
    ]
    points = random_cloud(1_678_267)
    h = np.sqrt(AREA / len(points))
    # A cube about an edge keeps the density of the whole cloud and both flat and sharp places.
    points = points[np.argsort(np.abs(points - [80.0, 40.0, 35.0]).max(axis=1), kind="stable")[:crop]]
    points = points[np.random.default_rng(1).permutation(crop)]
    tree = KDTree(points)
    spacing = float(tree.query(points, 2)[0][:, 1].mean())
    seconds: dict[str, list[float]] = {}
    for factor in RADII:
        radius = factor * spacing
        neighbours = float(np.mean(tree.query_ball_point(points[:2000], radius, return_length=True)))
        ours = run("scan2nurbs normals", points, radius, neighbours, 3)
        for name in ("scan2nurbs", *PEERS):
            found = ours if name == "scan2nurbs" else run(name, points, radius, neighbours, 1, python)
            if found is None or ours is None:
                continue
            seconds.setdefault(name, []).append(found.seconds * 1e6 / crop)
            lines.append(
                f"| {factor:g} d̄ = {radius / h:.1f} h | {neighbours:.0f} | {name} | {seconds[name][-1]:.2f} "
                f"| {found.seconds / ours.seconds:.1f} | {found.bytes_a_point:.0f} | {exact_error(points, found.result, radius)} |"
            )
            print(lines[-1], flush=True)
    return [*lines, *sorted_for_peers(points, RADII[-1] * spacing, neighbours, python)], seconds


def sorted_for_peers(points: NDArray[np.float64], radius: float, neighbours: float, python: str) -> list[str]:
    """Time normals at the largest radius once more, the peers on points that lie side by side as they do in space."""
    ours = run("scan2nurbs normals", points, radius, neighbours, 3)
    side_by_side = points[our_cells(points, radius, neighbours).order]
    lines = []
    for name in PEERS:
        found = run(name, side_by_side, radius, neighbours, 1, python)
        if found is not None and ours is not None:
            label, taken = f"{RADII[-1]:g} d̄, sorted points", found.seconds * 1e6 / len(points)
            lines.append(f"| {label} | {neighbours:.0f} | {name} | {taken:.2f} | {found.seconds / ours.seconds:.1f} | | |")
            print(lines[-1], flush=True)
    return lines


def draw(seconds: dict[str, list[float]], path: Path) -> None:
    """Draw the seconds a million points over the radius, one line a library."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name, values in seconds.items():
        if len(values) == len(RADII):
            axes.loglog(RADII, values, "o-", label=name, linewidth=2.5 if name == "scan2nurbs" else 1.2)
    axes.set(xlabel="radius in mean nearest-neighbour distances", ylabel="seconds a million points", title="Normals at a radius, two cores")
    axes.set_xticks(RADII, [f"{r:g}" for r in RADII])
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.speed")
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--peers", default=sys.executable)
    parser.add_argument("--crop", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--freecad", metavar="PYTHON")
    options = parser.parse_args(arguments)
    set_threads(THREADS)
    document = ROOT / "docs/speed.md"
    written = sections(document.read_text(encoding="utf-8") if document.exists() else "")
    for part in options.parts:
        lines = PARTS[part](options)
        print(*lines, sep="\n", flush=True)
        written |= sections("\n".join(lines))
    document.write_text("\n".join([HEAD, *written.values()]), encoding="utf-8")


def sections(text: str) -> dict[str, str]:
    """Divide a document at its second headings, by these."""
    parts = text.split("## ")[1:]
    return {part.splitlines()[0]: "## " + part.rstrip() + "\n" for part in parts}


def _ratios(options: argparse.Namespace) -> list[str]:
    return [f"## The whole EDN beside SciPy's spacing, {SIZE:,} points at random", "", *ratios(SIZE, options.rounds), ""]


def _errors(options: argparse.Namespace) -> list[str]:
    return ["## What clusters change, against every point summed", "", *cluster_errors(300_000), ""]


def _normals(options: argparse.Namespace) -> list[str]:
    lines, seconds = radius_normals(options.crop, options.peers)
    draw(seconds, ROOT / "docs/images/speed/normals.png")
    about = (
        f"On a crop of {options.crop:,} points of a random cloud. small_gicp knows no radius and takes as many neighbours; "
        "point-cloud-utils centres on the query point."
    )
    return ["## Normals at a radius", "", about, "", *lines, "", "![Seconds over the radius](images/speed/normals.png)", ""]


def _clouds(options: argparse.Namespace) -> list[str]:
    return ["## EDN, from an unsorted array to the strengths", "", *whole_clouds(options.sizes, options.repeats), ""]


def _reading(options: argparse.Namespace) -> list[str]:
    return ["## Reading and sorting", "", *reading(rounds=options.rounds), ""]


def _fits(options: argparse.Namespace) -> list[str]:
    return ["## B-spline surfaces through scattered points", "", *table(1_000_000, 57, 100_000, options.freecad), ""]


PARTS = {"ratios": _ratios, "errors": _errors, "normals": _normals, "clouds": _clouds, "reading": _reading, "fits": _fits}


if __name__ == "__main__":
    main()
