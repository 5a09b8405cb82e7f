"""Measure parts that nobody designed, drawn by seeds.

    python -m benchmarks.chance [--seeds N ...] [--noise S] [--points N] [--output FILE]

from the root of the checkout. Every part of ``examples.parts.chance`` is sampled as those of ``benchmarks.parts`` are, reconstructed with
nothing set, and scored in the same way. No threshold was ever chosen by them: they tell what to expect of a part that was not at hand.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from examples.parts.chance import by_chance

from benchmarks.parts import Row, measure, summary, table
from benchmarks.truth import sample, true_part

SEEDS = range(1, 25)
DOCS = Path(__file__).parent.parent / "docs"


def page(rows: list[Row], names: dict[str, list[str]], points: int) -> str:
    return f"""# Parts that nobody designed

Made by `python -m benchmarks.chance`: parts drawn by chance (`examples/parts/chance.py`), a blank with two to four features and up to four
rounded or bevelled edges, sampled by {points:,} points on a jittered grid with Gaussian noise, then `convert` with nothing set. The columns
are those of [the designed parts](parts-truth.md). No threshold was chosen by these parts.

{summary(rows)}

{table(rows)}

What they have:

{chr(10).join(f"- **{part}**: {', '.join(some)}" for part, some in names.items())}
"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS))
    parser.add_argument("--noise", type=float, default=0.25)
    parser.add_argument("--points", type=int, default=60_000)
    parser.add_argument("--output", type=Path, help="where to write the page (default docs/chance-truth.md for a full run)")
    given = parser.parse_args(arguments)
    output = given.output or (DOCS / "chance-truth.md" if given.seeds == list(SEEDS) and given.points >= 60_000 else None)
    rows: list[Row] = []
    names: dict[str, list[str]] = {}
    for seed in given.seeds:
        shape, has = by_chance(seed)
        part = f"seed {seed}"
        truth = sample(true_part(shape), {"noise": given.noise, "outliers": 0.0}, points=given.points)
        row, _ = measure(part, truth, given.noise)
        rows.append(row)
        names[part] = has
        print(table([row]).splitlines()[-1], flush=True)
    if output is not None:
        output.write_text(page(rows, names, given.points), encoding="utf-8")
    print(summary(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
