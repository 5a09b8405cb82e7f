"""Measure every edge operator against the truth of the project's own CAD parts.

    python -m benchmarks.edges [--parts NAME ...] [--conditions NAME ...] [--quick] [--pcednet FOLDER] [--output FILE]

from the root of the checkout. Every whole part of ``examples.parts`` is sampled by 60,000 points in seven conditions, and goes through
the default (nothing set) and through every other operator, those of the paper and peers, each with one threshold for all clouds: the
paper's, or the best there is. The tables are printed and, for a full run, written with pictures to docs/edges-truth.md. --quick takes
six parts and three conditions. --pcednet FOLDER adds the clouds of the PCEDNet supplement (Himeur et al. 2022): ``pcednet_abc_*.npz``
with points, labels and the published methods' predictions, which are scored from the same files.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from examples.parts import WHOLE
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks import pcednet
from benchmarks.edge_operators import OPERATORS, Operator
from benchmarks.edge_pictures import draw_edges
from benchmarks.scores import distance_to, f1
from benchmarks.truth import CONDITIONS, Truth, sample, true_part

DOCS = Path(__file__).parents[1] / "docs"
QUICK_PARTS = ("bracket", "roof", "flange", "freeform_top", "ball_stud", "rod")
QUICK_CONDITIONS = ("noise 0", "noise .25", "noise .5")
WIDE = 12.0
"""Median face, in h, from which on a part counts in the means."""


@dataclass
class Measured:
    """F1 of an operator on one cloud, at 1 and 2 h, for every threshold tried.

    Attributes
    ----------
    f1 : (T, 2) float64
    seconds : float
    """

    f1: NDArray[np.float64]
    seconds: float


@dataclass
class Results:
    """All that was measured: by operator, condition and part."""

    thresholds: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    measured: dict[tuple[str, str, str], Measured] = field(default_factory=dict)
    median_face: dict[str, float] = field(default_factory=dict)

    def best(self, operator: Operator) -> int:
        """Return the threshold with the highest mean F1 at 2 h over all clouds."""
        every = [m.f1[:, 1] for (name, _, part), m in self.measured.items() if name == operator.name and self.counts(part)]
        return int(np.mean(every, axis=0).argmax())

    def counts(self, part: str) -> bool:
        """Tell whether a part counts in the means."""
        return self.median_face[part] > WIDE

    def score(self, operator: Operator, condition: str, part: str) -> NDArray[np.float64]:
        """Return F1 at 1 and 2 h with the operator's threshold."""
        return self.measured[operator.name, condition, part].f1[self.best(operator)]

    def mean(self, operator: Operator, condition: str) -> NDArray[np.float64]:
        """Return the mean over the parts that count."""
        parts = [part for name, c, part in self.measured if name == operator.name and c == condition and self.counts(part)]
        return np.mean([self.score(operator, condition, part) for part in parts], axis=0) if parts else np.full(2, np.nan)


def thresholds_of(operator: Operator) -> NDArray[np.float64]:
    """Return the thresholds to try: the operator's own, or a range."""
    if operator.threshold is not None:
        return np.array([operator.threshold])
    if "variation" in operator.name:
        return np.geomspace(1e-3, 0.2, 40)
    return np.geomspace(0.02, 2.0, 40) if "shrink" in operator.name else np.arange(2.0, 89.0, 2.0)


class Reference:
    """What the scores at many thresholds have in common for one cloud."""

    def __init__(self, truth: Truth) -> None:
        h = truth.h
        self.near_sharp = distance_to(truth.edges.sharp, truth.points) / h
        self.near_faint = distance_to(truth.edges.faint, truth.points) / h
        k = min(64, len(truth.points))
        self.distance, self.index = (
            KDTree(truth.points).query(truth.edges.sharp, k, distance_upper_bound=2 * h)
            if len(truth.edges.sharp)
            else (np.empty((0, k)), np.empty((0, k), int))
        )
        self.distance = self.distance / h

    def f1(self, strength: NDArray[np.float64], thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return F1 at 1 and 2 h for every threshold."""
        strength = np.nan_to_num(strength, nan=-np.inf)
        padded = np.append(strength, -np.inf)[self.index]
        scores = np.empty((len(thresholds), 2))
        for column, t in enumerate((1.0, 2.0)):
            hit = self.near_sharp <= t
            counted = hit | (self.near_faint > t)
            strongest = np.where(self.distance <= t, padded, -np.inf).max(axis=1, initial=-np.inf)
            for row, threshold in enumerate(thresholds):
                marked = strength > threshold
                n = np.count_nonzero(marked & counted)
                precision = np.count_nonzero(marked & hit) / n if n else float(len(strongest) == 0)
                recall = float((strongest > threshold).mean()) if len(strongest) else 1.0
                scores[row, column] = f1(precision, recall)
        return scores


def measure(parts: list[str], conditions: list[str], operators: tuple[Operator, ...] = OPERATORS) -> Results:
    """Run every operator on every part in every condition."""
    results = Results(thresholds={operator.name: thresholds_of(operator) for operator in operators})
    for name in parts:
        part = true_part(WHOLE[name].build())
        for condition in conditions:
            truth = sample(part, CONDITIONS[condition])
            results.median_face[name] = truth.median_face
            reference = Reference(truth)
            done: dict[Any, tuple[NDArray[np.float64], float]] = {}
            for operator in operators:
                start = time.perf_counter()
                if operator.measure not in done:
                    strength = operator.measure(truth.points)
                    done[operator.measure] = strength, time.perf_counter() - start
                strength, seconds = done[operator.measure]
                scores = reference.f1(strength, results.thresholds[operator.name])
                results.measured[operator.name, condition, name] = Measured(scores, seconds)
        print(name, *(f"{results.score(operators[0], c, name)[1]:.3f}" for c in conditions), flush=True)
    return results


def operators_table(results: Results, conditions: list[str], within: int) -> str:
    """Return the mean F1 of every operator in every condition as a Markdown table."""
    lines = [f"| F1 within {within} h | {' | '.join(conditions)} | threshold | s |", "|---|" + "---|" * (len(conditions) + 2)]
    for operator in OPERATORS:
        values = [results.mean(operator, condition)[within - 1] for condition in conditions]
        threshold = results.thresholds[operator.name][results.best(operator)]
        said = "none to set" if operator is OPERATORS[0] else f"{threshold:.3g}"
        seconds = np.median([m.seconds for (name, _, _), m in results.measured.items() if name == operator.name])
        lines.append(f"| {operator.name} | {' | '.join(f'{value:.2f}' for value in values)} | {said} | {seconds:.1f} |")
    return "\n".join(lines)


def parts_table(results: Results, parts: list[str], conditions: list[str]) -> str:
    """Return F1 at 1 and 2 h of the default for every part."""
    lines = [f"| part | median face (h) | {' | '.join(conditions)} |", "|---|---|" + "---|" * len(conditions)]
    for part in parts:
        scores = [results.score(OPERATORS[0], condition, part) for condition in conditions]
        mark = "" if results.counts(part) else " *"
        lines.append(f"| {part}{mark} | {results.median_face[part]:.0f} | {' | '.join(f'{s[0]:.2f} / {s[1]:.2f}' for s in scores)} |")
    return "\n".join(lines)


def page(results: Results, parts: list[str], conditions: list[str], compared: str) -> str:
    """Return the page for the documentation."""
    learned = f"\n## The PCEDNet clouds\n\n{compared}\n" if compared else ""
    return f"""# Edges against the truth

Made by `python -m benchmarks.edges`: {len(parts)} CAD parts of the project (`examples/parts`), each sampled by 60,000 points on a
jittered grid, uniformly at random, or unevenly (density 1:6, six round holes), with Gaussian noise on every coordinate, in units of h,
the mean spacing.
A sharp edge is where the normals of two faces differ by more than 15 degrees, or where one face ends; precision counts marked points
within the tolerance of one, recall samples of sharp edges with a marked point within it; edges of 5 to 15 degrees count neither way.
Means are over the parts whose median face is wider than {WIDE:g} h. The default has nothing to set; every other operator has the one
threshold that is best for it over all clouds, but for the paper's own. Seconds are the median for one cloud, on a machine with other work.

{operators_table(results, conditions, 2)}

{operators_table(results, conditions, 1)}

![edge points of four parts, true and found](images/edges-truth.png)

## The default, part by part

F1 within 1 h / within 2 h.

{parts_table(results, parts, conditions)}
{learned}
What the parts are:

{chr(10).join(f"- **{part}**: {WHOLE[part].description}" for part in parts)}
"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(WHOLE), default=list(WHOLE))
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=list(CONDITIONS))
    parser.add_argument("--quick", action="store_true", help="six parts, three conditions")
    parser.add_argument("--pcednet", type=Path, help="folder with pcednet_abc_*.npz")
    parser.add_argument("--output", type=Path, help="where to write the page (default docs/edges-truth.md for a full run)")
    given = parser.parse_args(arguments)
    parts, conditions = (list(QUICK_PARTS), list(QUICK_CONDITIONS)) if given.quick else (given.parts, given.conditions)
    results = measure(parts, conditions)
    compared = pcednet.report(given.pcednet) if given.pcednet else ""
    text = page(results, parts, conditions, compared)
    print(text)
    full = parts == list(WHOLE) and conditions == list(CONDITIONS)
    output = given.output or (DOCS / "edges-truth.md" if full else None)
    if output is not None:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(text, encoding="utf-8")
        draw_edges(output.parent / "images" / "edges-truth.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
