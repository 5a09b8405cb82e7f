"""Measure the kinds of edge points, and the curves along edges, against the truth of the project's own CAD parts.

    python -m benchmarks.edge_curves [--parts NAME ...] [--conditions NAME ...] [--output FILE]

from the root of the checkout. The table is printed and, for a full run, written with a picture to docs/edges-curves.md.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from examples.parts import WHOLE
from scipy.spatial import KDTree

from benchmarks.edge_pictures import draw_kinds
from benchmarks.scores import score_curves
from benchmarks.truth import CONDITIONS, SHARP, Truth, sample, true_part
from scan2nurbs.api import measure
from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.kinds import BORDER, CONCAVE, CONVEX, with_kinds
from scan2nurbs.edges.network import edge_network
from scan2nurbs.edges.params import EdgeParams

DOCS = Path(__file__).parents[1] / "docs"
DEFAULT = ("noise .25", "noise .5")


@dataclass(frozen=True)
class Row:
    """What came out for one part in one condition; NaN where there is nothing to score.

    Attributes
    ----------
    part, condition : str
    precision, recall : float
        Of the curves' length, and of the true edges' length.
    curves, closed, corners : int
    kind : float
        Share of the points near sharp creases whose side, convex or concave, is right.
    angle : float
        Median error of the angle, degrees.
    border : float
        Share of the true borders' samples with a border point within 2 h.
    seconds : float
        For kinds and curves together.
    """

    part: str
    condition: str
    precision: float
    recall: float
    curves: int
    closed: int
    corners: int
    kind: float
    angle: float
    border: float
    seconds: float


def measure_part(name: str, condition: str) -> Row:
    """Sample a part, find its edges, kinds and curves, and score them."""
    truth = sample(true_part(WHOLE[name].build()), CONDITIONS[condition])
    measured = measure(truth.points)
    points, scale = measured.cloud.points, measured.scale
    found = detect(points, scale, EdgeParams())
    start = time.perf_counter()
    edges = with_kinds(scale, found)
    kinds = np.zeros(len(points), np.uint8) if edges.kind is None else edges.kind
    network = edge_network(points, scale, edges.mask, border=kinds == BORDER)
    seconds = time.perf_counter() - start
    scores = score_curves(truth, [edge.curve.sample(0.5 * truth.h) + measured.cloud.origin for edge in network.curves])
    kind, angle, border = _kinds(truth, points + measured.cloud.origin, edges)
    closed = sum(edge.curve.closed for edge in network.curves)
    has_edges = len(truth.edges.sharp) > 0
    return Row(
        name,
        condition,
        scores["precision"] if has_edges else np.nan,
        scores["recall"] if has_edges else np.nan,
        len(network.curves),
        closed,
        len(network.corners),
        kind,
        angle,
        border,
        seconds,
    )


def _kinds(truth: Truth, points: np.ndarray, edges: Edges) -> tuple[float, float, float]:
    true = truth.edges.take(truth.edges.angle > SHARP)
    if edges.kind is None or edges.angle is None or len(true.points) == 0:
        return np.nan, np.nan, np.nan
    distance, nearest = KDTree(true.points).query(points)
    crease = np.isin(edges.kind, (CONVEX, CONCAVE)) & (distance <= 2 * truth.h) & ~true.border[nearest]
    right = (edges.kind == CONVEX) == true.convex[nearest]
    error = np.abs(edges.angle - true.angle[nearest])
    border = np.nan
    if true.border.any():
        ends = points[edges.kind == BORDER]
        border = float((KDTree(ends).query(true.points[true.border])[0] <= 2 * truth.h).mean()) if len(ends) else 0.0
    if not crease.any():
        return np.nan, np.nan, border
    return float(right[crease].mean()), float(np.nanmedian(error[crease])), border


def table(rows: list[Row]) -> str:
    """Return the rows and their means as a Markdown table."""
    lines = [
        "| part | condition | curves within 1 h | edges within 2 h | curves (closed) | corners | side right | angle | borders | s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        lines.append(
            f"| {r.part} | {r.condition} | {_percent(r.precision)} | {_percent(r.recall)} | {r.curves} ({r.closed}) | {r.corners} "
            f"| {_percent(r.kind)} | {_degrees(r.angle)} | {_percent(r.border)} | {r.seconds:.1f} |"
        )
    for condition in dict.fromkeys(r.condition for r in rows):
        chosen = [r for r in rows if r.condition == condition]
        a, b, c, d = (_mean([getattr(r, name) for r in chosen]) for name in ("precision", "recall", "kind", "angle"))
        lines.append(f"| **mean** | {condition} | {_percent(a)} | {_percent(b)} | | | {_percent(c)} | {_degrees(d)} | | |")
    return "\n".join(lines)


def _mean(values: list[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else np.nan


def _percent(value: float) -> str:
    return "–" if np.isnan(value) else f"{100 * value:.1f} %"


def _degrees(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.1f}°"


def page(rows: list[Row]) -> str:
    """Return the page for the documentation."""
    return f"""# Kinds and curves of edges against the truth

Made by `python -m benchmarks.edge_curves`: the project's whole parts (`examples/parts`), 60,000 points each, nothing set. Counted are the
share of the curves' length that lies within 1 h of a sharp edge, the share of the sharp edges' length with a curve within 2 h, the share
of edge points near creases whose side (convex or concave) is right, the median error of the angle, and the share of true borders that
are found. h is the mean spacing. Seconds are for kinds and curves together, on a machine with other work.

![kinds of edges and the curves along them](images/edges-kinds.png)

{table(rows)}
"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(WHOLE), default=list(WHOLE))
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=list(DEFAULT))
    parser.add_argument("--output", type=Path, help="where to write the page (default docs/edges-curves.md for a full run)")
    given = parser.parse_args(arguments)
    rows = []
    for condition in given.conditions:
        for name in given.parts:
            rows.append(measure_part(name, condition))
            print(table(rows[-1:]).splitlines()[2], flush=True)
    print(table(rows))
    full = given.parts == list(WHOLE) and given.conditions == list(DEFAULT)
    output = given.output or (DOCS / "edges-curves.md" if full else None)
    if output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(page(rows), encoding="utf-8")
        draw_kinds(output.parent / "images" / "edges-kinds.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
