"""B-spline surfaces through scattered points, beside SciPy and FreeCAD.

    python -m benchmarks.fits [--points N] [--spans N] [--crop N] [--freecad PYTHON]


The points lie at random on a trimmed patch with two holes, with Gaussian noise σ across it. SciPy fits heights over a plane at fixed
parameters; scan2nurbs is timed both so (all points once, on the same knots, then foot points and a second fit) and as
`fit_surface`, which finds the parameters and the knots itself. FreeCAD's `ReverseEngineering.approxSurface` corrects parameters too; PYTHON
is one that finds it, left out by default (see `benchmarks/freecad_fit.py`), and gets few points and control points, since its time
grows with their product and more. The rms is that of the distances to the fit (along the
normal, or upwards for SciPy), and that of the fit's height against the true surface, in σ; 1 and 0 would be perfect.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LSQBivariateSpline, bisplev, bisplrep

from scan2nurbs import fit_surface
from scan2nurbs.surfaces.axis import Axis
from scan2nurbs.surfaces.solve import fit_spline

SIGMA = 0.002
# What FreeCAD gets: points, control points a side.
FEW, POLES = 10_000, 20


def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.1 * np.sin(5.0 * x) * np.cos(4.0 * y) + 0.05 * x * y + 0.02 * np.sin(17.0 * x * y)


def patch(n: int) -> NDArray[np.float64]:
    """Sample n points of the patch: the unit square without a rounded corner and two holes."""
    rng = np.random.default_rng(0)
    xy = rng.random((2 * n, 2))
    kept = np.hypot(*(xy - 0.5).T) < 0.62
    for centre, radius in (((0.3, 0.4), 0.08), ((0.7, 0.65), 0.12)):
        kept &= np.hypot(*(xy - centre).T) > radius
    xy = xy[kept][:n]
    return np.c_[xy, height(*xy.T) + SIGMA * rng.normal(size=len(xy))]


def ours_at_knots(points: NDArray[np.float64], spans: int) -> NDArray[np.float64]:
    """Fit on uniform knots, correct the parameters, fit again; return the foot points."""
    axis = Axis(3, np.linspace(0.0, 1.0, spans + 1))
    weights = np.ones(len(points))
    uv = np.ascontiguousarray(points[:, :2])
    spline = fit_spline(axis, axis, uv, points, weights, 1e-2)
    uv, _, _ = spline.foot_points(points, uv, 4)
    spline = fit_spline(axis, axis, uv, points, weights, 1e-2, decade=spline.decade)
    return spline.derivatives(spline.foot_points(points, uv, 4)[0], 0)[:, 0]


def ours(points: NDArray[np.float64]) -> NDArray[np.float64]:
    fit = fit_surface(points)
    print(f"fit_surface: {fit.control_points.shape[0]} x {fit.control_points.shape[1]} control points, {fit.iterations} rounds")
    return fit.surface.evaluate(fit.uv)


def least_squares(points: NDArray[np.float64], spans: int) -> NDArray[np.float64]:
    inner = np.linspace(0.0, 1.0, spans + 1)[1:-1]
    x, y, z = points.T
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no points in the holes: its equations lack rank there
        spline = LSQBivariateSpline(x, y, z, inner, inner, bbox=[0.0, 1.0, 0.0, 1.0])
    return np.c_[x, y, spline.ev(x, y)]


def smoothing(points: NDArray[np.float64], spans: int) -> NDArray[np.float64]:
    x, y, z = points.T
    n = len(points)
    room = spans + 8
    spline = bisplrep(x, y, z, w=np.full(n, 1.0 / SIGMA), s=n, xb=0, xe=1, yb=0, ye=1, nxest=room, nyest=room)
    grid = np.linspace(0.0, 1.0, 801)
    values = bisplev(grid, grid, spline)
    # Bilinear between the values of a fine grid: bisplev has no scattered points.
    i, j = np.minimum((x * 800).astype(int), 799), np.minimum((y * 800).astype(int), 799)
    s, t = x * 800 - i, y * 800 - j
    heights = (1 - s) * ((1 - t) * values[i, j] + t * values[i, j + 1]) + s * ((1 - t) * values[i + 1, j] + t * values[i + 1, j + 1])
    return np.c_[x, y, heights]


def freecad(points: NDArray[np.float64], poles: int, python: str) -> tuple[NDArray[np.float64], float]:
    """Fit with FreeCAD in a process of its own; return the foot points and the seconds that the fit alone took."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "points.json", Path(folder) / "out.json"
        source.write_text(json.dumps(points.tolist()))
        script = Path(__file__).with_name("freecad_fit.py")
        subprocess.run([python, str(script), str(source), str(out), str(poles)], check=True)
        found = json.loads(out.read_text())
    return np.array(found["feet"]), found["seconds"]


def row(name: str, given: NDArray[np.float64], fitted: NDArray[np.float64], wall: float, processor: float) -> str:
    """Write a row of the table: what a fit took, and how far it lies from the points and from the truth."""
    residual = np.sqrt(np.mean(np.sum((given - fitted) ** 2, axis=1))) / SIGMA
    truth = np.sqrt(np.mean((fitted[:, 2] - height(fitted[:, 0], fitted[:, 1])) ** 2)) / SIGMA
    line = f"| {name} | {len(given):,} | {wall:.3g} | {processor:.3g} | {residual:.3f} | {truth:.3f} |"
    print(line, flush=True)
    return line


def table(n: int, spans: int, crop: int, python: str | None = None) -> list[str]:
    """Fit with everything there is; return the table."""
    points = patch(n)
    few = points[:crop]
    net = spans + 3
    ours_at_knots(points[:5000], 8)  # loads and compiles
    ours(points[:5000])
    runs: list[tuple[str, NDArray[np.float64], Callable[[NDArray[np.float64]], NDArray[np.float64]]]] = [
        (f"scan2nurbs, {net} x {net}, parameters corrected", points, lambda p: ours_at_knots(p, spans)),
        ("scan2nurbs `fit_surface`, its own parameters and knots", points, ours),
        (f"scan2nurbs, {POLES} x {POLES}, parameters corrected", points[:FEW], lambda p: ours_at_knots(p, POLES - 3)),
        (f"SciPy LSQBivariateSpline, {net} x {net}", few, lambda p: least_squares(p, spans)),
        (f"SciPy bisplrep, up to {net} x {net}", few, lambda p: smoothing(p, spans)),
    ]
    lines = ["| fit | points | wall, s | processor time, s | rms of residuals, σ | rms against the truth, σ |", "|---|---|---|---|---|---|"]
    for name, given, work in runs:
        wall, processor = time.perf_counter(), time.process_time()
        fitted = work(given)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        lines.append(row(name, given, fitted, wall, processor))
    if python is not None:
        feet, seconds = freecad(points[:FEW], POLES, python)
        lines.append(row(f"FreeCAD approxSurface, {POLES} x {POLES}, parameters corrected", points[:FEW], feet, seconds, seconds))
    return lines


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.fits")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--spans", type=int, default=57)
    parser.add_argument("--crop", type=int, default=100_000)
    parser.add_argument("--freecad", metavar="PYTHON")
    options = parser.parse_args(arguments)
    print(*table(options.points, options.spans, options.crop, options.freecad), sep="\n")


if __name__ == "__main__":
    main()
