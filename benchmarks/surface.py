"""Rebuild surfaces of known shape from simulated scans, and measure how far the results lie from the truth.

    python -m benchmarks.surface [--parts NAME ...] [--noise S ...] [--seed N] [--output FILE]
                                [--outliers SHARE] [--holes N] [--mode MODE] [--unguided]

from the root of the checkout. Every part of ``examples.parts`` with one functional surface (all but complex_body) is scanned from above
with Gaussian noise of S times the mean spacing h (default 0.1, 0.25, 0.5), goes through the whole of ``scan2nurbs surface`` with its
default parameters and the part's declared seed point, and is compared with the CAD model. The table is printed and, for a full run,
written to docs/surface-truth.md. The options of the second line make it harder: outliers, missing patches, another sampling, no seed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from examples.parts import PARTS, Part
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart, tessellate
from scan2nurbs.errors import Scan2NurbsError
from scan2nurbs.faces.region import RegionParams
from scan2nurbs.pipeline import SurfaceModel, SurfaceParams, reconstruct_surface
from scan2nurbs.simulate import simulate_scan
from scan2nurbs.surfaces.project import foot_points

MEASURED = [part for part in PARTS.values() if part.name != "complex_body"]
"""The parts with one functional surface that is to be told from its surroundings."""

ACCURACY, RMS = 0.99, 0.3
"""What is wanted of every row: accuracy away from the border, and rms in sigma."""


@dataclass(frozen=True)
class Row:
    """What came out for one part and noise.

    Attributes
    ----------
    part : str
    noise : float
        sigma / h.
    accuracy : float
        Share of the points farther than 2 h from the true border whose inside or outside is right.
    iou : float
        Intersection over union of the points inside and the points truly on the functional face, the border's included.
    rms, rms_inner : float
        Root mean square distance of the true surface (at the places that were measured) to the fitted one, over the whole
        functional face and over what lies farther than 2 h from its border, in sigma.
    worst : float
        Largest such distance over the whole face, in sigma.
    control_points : int
    seconds : float
        Of the pipeline.
    error : str
        Why there is no result; empty where there is one.
    """

    part: str
    noise: float
    accuracy: float = np.nan
    iou: float = np.nan
    rms: float = np.nan
    rms_inner: float = np.nan
    worst: float = np.nan
    control_points: int = 0
    seconds: float = np.nan
    error: str = ""

    @property
    def good(self) -> bool:
        """Whether the row reaches what is wanted."""
        return not self.error and self.accuracy >= ACCURACY and self.rms <= RMS


def measure(part: Part, model: CadPart, noise: float, *, guided: bool = True, **changes: Any) -> Row:
    """Scan a part (with changed `SimulateParams`), rebuild its functional surface, and compare."""
    scan = simulate_scan(model, part.params(noise=noise, **changes))
    params = SurfaceParams(region=RegionParams(seed=part.seed if guided else None))
    start = time.perf_counter()
    try:
        result = reconstruct_surface(scan.points, params, unit=scan.unit)
    except Scan2NurbsError as error:
        return Row(part.name, noise, error=str(error), seconds=time.perf_counter() - start)
    seconds = time.perf_counter() - start
    functional = np.isin(scan.face, part.functional_faces(model))
    inside = result.cloud.to_rows(result.inside, False)
    border, real = KDTree(_border(model, part.functional_faces(model), scan.spacing / 4)), scan.face >= 0
    inner = np.zeros(len(real), bool)
    inner[real] = border.query(scan.clean[real])[0] > 2 * scan.spacing
    distance = _distance_to_fit(scan.clean[functional], result) / scan.noise
    return Row(
        part=part.name,
        noise=noise,
        accuracy=float((inside == functional)[inner].mean()),
        iou=float((inside & functional).sum() / (inside | functional).sum()),
        rms=float(np.sqrt(np.mean(distance**2))),
        rms_inner=float(np.sqrt(np.mean(distance[inner[functional]] ** 2))),
        worst=float(distance.max()),
        control_points=result.fit.n_control_points,
        seconds=seconds,
    )


def _border(model: CadPart, faces: Iterable[int], step: float) -> np.ndarray:
    """Sample the outline of a set of faces: the triangles' sides that only one of their triangles has."""
    corners = model.corners[np.isin(model.face, list(faces))]
    unit = 1e-6 * np.sqrt(model.area)
    _, node = np.unique(np.round(corners.reshape(-1, 3) / unit).astype(np.int64), axis=0, return_inverse=True)
    node = node.reshape(-1, 3)
    sides = np.sort(np.stack([node, np.roll(node, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    _, first, count = np.unique(sides, axis=0, return_index=True, return_counts=True)
    samples = []
    for a, b in ends[first[count == 1]]:
        n = max(2, int(np.ceil(np.linalg.norm(b - a) / step)) + 1)
        samples.append(a + np.linspace(0, 1, n)[:, None] * (b - a))
    return np.concatenate(samples)


def _distance_to_fit(places: np.ndarray, result: SurfaceModel) -> np.ndarray:
    """Return the distances of true places to their foot points on the surface of the face, started from a grid of its points."""
    surface = result.face.surface
    u, v = (np.linspace(low, high, 200) for low, high in surface.domain)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    local = places - result.cloud.origin
    _, nearest = KDTree(surface.evaluate(grid)).query(local)
    return foot_points(surface, local, grid[nearest], steps=40).distance


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = [
        "| part | noise (h) | accuracy | IoU | rms (σ) | rms inside (σ) | worst (σ) | control points | s | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        if r.error:
            lines.append(f"| {r.part} | {r.noise:g} | – | – | – | – | – | – | {r.seconds:.1f} | no result: {r.error} |")
            continue
        mark = "" if r.good else "missed"
        lines.append(
            f"| {r.part} | {r.noise:g} | {100 * r.accuracy:.2f} % | {r.iou:.3f} | {r.rms:.2f} | {r.rms_inner:.2f} | {r.worst:.1f} "
            f"| {r.control_points} | {r.seconds:.1f} | {mark} |"
        )
    return "\n".join(lines)


def page(rows: list[Row]) -> str:
    """Return the page for the documentation."""
    good = sum(row.good for row in rows)
    return f"""# Single surfaces against the truth

Made by `python -m benchmarks.surface`: every part is a CAD model of the project (`examples/parts`), scanned by the simulator from five
or nine directions above it, 27,000 to 60,000 points on the whole part, with Gaussian noise σ along the ray whose component across the
surface is the same everywhere. The scan goes through the whole of `scan2nurbs surface` with default parameters and a seed point on the
wanted surface.

Wanted: accuracy of inside and outside at least {100 * ACCURACY:g} % farther than 2 h from the true border; rms distance between the true
surface and the fitted one at most {RMS:g} σ over the functional area. **{good} of {len(rows)} rows reach both.**
h is the mean spacing, σ the noise; accuracy counts points farther than 2 h from the true border, and so does rms inside; rms and worst
are distances of the true surface, at the places that were measured, to the fitted surface.

{table(rows)}

What the parts are:

{chr(10).join(f"- **{part.name}**: {part.description}" for part in MEASURED)}
"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=[part.name for part in MEASURED])
    parser.add_argument("--noise", nargs="+", type=float, default=[0.1, 0.25, 0.5])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--holes", type=int, default=0)
    parser.add_argument("--mode", default="scanner")
    parser.add_argument("--unguided", action="store_true", help="no seed point: take the surface that is found by itself")
    parser.add_argument("--output", type=Path, help="where to write the page (default docs/surface-truth.md for a full run)")
    given = parser.parse_args(arguments)
    harder = {"seed": given.seed, "outliers": given.outliers, "holes": given.holes, "mode": given.mode}
    rows = []
    for name in given.parts:
        model = tessellate(PARTS[name].build())
        for noise in given.noise:
            rows.append(measure(PARTS[name], model, noise, guided=not given.unguided, **harder))
            print(table(rows).splitlines()[-1], flush=True)
    print(table(rows))
    plain = parser.parse_args([])
    output = given.output or (Path(__file__).parents[1] / "docs" / "surface-truth.md" if given == plain else None)
    if output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(page(rows), encoding="utf-8")
    return 0 if all(row.good for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
