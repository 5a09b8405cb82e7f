"""Rebuild whole parts from simulated scans, and measure faces, surfaces and CAD models against the truth.

    python -m benchmarks.parts [--parts NAME ...] [--noise S ...] [--points N] [--outliers SHARE] [--quick] [--output FILE] [--pictures]

from the root of the checkout. Every whole part of ``examples.parts`` is sampled by 60,000 points on a jittered grid with Gaussian noise of
S times the mean spacing h (default 0.1, 0.25, 0.5), goes through ``scan2nurbs convert`` with nothing set, and is compared with the CAD
model. The tables are printed and, for a full run, written to docs/parts-truth.md; --pictures draws the gallery beside it. --quick takes six
parts at noise .25. `make bench` runs the quick one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from examples.parts import WHOLE

from benchmarks.part_gallery import MOST, draw_gallery
from benchmarks.scores import matched_faces, score_faces, score_model
from benchmarks.truth import Truth, sample, true_part
from scan2nurbs.errors import Scan2NurbsError
from scan2nurbs.part import Model, reconstruct

DOCS = Path(__file__).parents[1] / "docs"
QUICK = ("bracket", "filleted_block", "turned_part", "flange", "freeform_top", "boss")
NOISE = (0.1, 0.25, 0.5)
WIDE = 12.0
"""Median face, in h, from which on a part counts in the means."""
KINDS = {"Plane": "plane", "Cylinder": "cylinder", "Cone": "cone", "Sphere": "sphere", "Torus": "torus"}
"""What the CAD kernel calls the types that a point cloud can tell; all others are freeform, of whichever construction."""


@dataclass(frozen=True)
class Row:
    """What came out for one part and noise; see `benchmarks.scores` for the figures.

    Attributes
    ----------
    part : str
    noise, median_face : float
        In h.
    iou, patch_iou : float
    types : float
        Share of matched faces whose type is right.
    n_true, n_found : int
        Faces.
    model : dict
        Of `score_model`; empty where there is none.
    seconds : float
    error : str
    """

    part: str
    noise: float
    median_face: float
    iou: float = 0.0
    patch_iou: float = 0.0
    types: float = float("nan")
    n_true: int = 0
    n_found: int = 0
    model: dict[str, float] | None = None
    seconds: float = 0.0
    error: str = ""


def measure(name: str, truth: Truth, noise: float) -> tuple[Row, Model | None]:
    """Rebuild one part and score it."""
    start = time.perf_counter()
    try:
        model = reconstruct(truth.points)
    except Scan2NurbsError as error:
        return Row(name, noise, truth.median_face, n_true=len(truth.part.faces), error=str(error)), None
    seconds = time.perf_counter() - start
    faces = score_faces(truth, model.label)
    row = Row(
        part=name,
        noise=noise,
        median_face=truth.median_face,
        iou=faces["faces"]["iou"],
        patch_iou=faces["patches"]["iou"],
        types=type_share(truth, model),
        n_true=len(truth.part.faces),
        n_found=len(model.faces.fits),
        model=score_model(truth, model.part.shape, model.part.kernel_scale),
        seconds=seconds,
    )
    return row, model


def type_share(truth: Truth, model: Model) -> float:
    """Return the share of matched faces (IoU above 0.5) whose type is right; freeform counts as one type."""
    right = []
    kinds = dict(zip(model.numbers.tolist(), (fit.shape.kind for fit in model.faces.fits), strict=True))
    for true, found in matched_faces(truth, model.label):
        wanted = KINDS.get(truth.part.types[true], "freeform")
        kind = kinds[found]
        right.append((kind if kind in KINDS.values() else "freeform") == wanted)
    return float(np.mean(right)) if right else float("nan")


def table(rows: Iterable[Row]) -> str:
    """Return one line a part as a Markdown table."""
    lines = [
        "| part | face (h) | noise | faces, true → found | IoU | patches | types | model | coverage | precision | rms (h) | s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        mark = "" if row.median_face > WIDE else " *"
        cells = [f"{row.part}{mark}", f"{row.median_face:.0f}", f"{row.noise:g}", f"{row.n_true} → {row.n_found}"]
        if (m := row.model) is None:
            cells += ["", "", "", row.error, "", "", "", ""]
        else:
            state = "closed" if m["closed"] else f"{m['free_edges']:.0f} free edges"
            cells += [f"{row.iou:.2f}", f"{row.patch_iou:.2f}", f"{row.types:.0%}", f"{'valid' if m['valid'] else 'invalid'}, {state}"]
            cells += [f"{m['coverage']:.3f}", f"{m['precision']:.3f}", f"{m['rms']:.3f}", f"{row.seconds:.0f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def summary(rows: list[Row]) -> str:
    """Return the means over the parts that count (of rms and seconds the medians), one line a noise."""
    lines = [
        "| noise | parts | face IoU | patch IoU | types | valid | closed, of the solids | coverage | precision | rms (h) | s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for noise in sorted({row.noise for row in rows}):
        some = [row for row in rows if row.noise == noise and row.median_face > WIDE]
        models = [row.model for row in some if row.model is not None]
        if not models:
            continue
        solids = [row for row in some if row.part not in WHOLE or WHOLE[row.part].bodies]  # sheets are none
        closed = np.mean([bool(row.model and row.model["valid"] and row.model["closed"]) for row in solids]) if solids else float("nan")

        def mean(key: str, models: list[dict[str, float]] = models) -> float:
            return float(np.mean([model[key] for model in models]))

        cells = [f"{noise:g}", f"{len(some)}", *(f"{np.mean([getattr(row, key) for row in some]):.3f}" for key in ("iou", "patch_iou"))]
        cells += [
            f"{np.nanmean([row.types for row in some]):.0%}",
            f"{sum(model['valid'] for model in models) / len(some):.0%}",
            f"{closed:.0%}",
        ]
        cells += [f"{mean('coverage'):.3f}", f"{mean('precision'):.3f}", f"{np.median([model['rms'] for model in models]):.3f}"]
        lines.append(f"| {' | '.join(cells)} | {np.median([row.seconds for row in some]):.0f} |")
    return "\n".join(lines)


def page(rows: list[Row], points: int) -> str:
    """Return the page for the documentation."""
    return f"""# Whole parts against the truth

Made by `python -m benchmarks.parts`: {len({row.part for row in rows})} CAD parts of the project (`examples/parts`), each sampled by
{points:,} points on a jittered grid with Gaussian noise on every coordinate, in units of h, the mean spacing; then `convert` with nothing
set. IoU is that of true faces under the best one-to-one matching with what was found, patches are true faces joined where they meet
smoothly. Coverage is the share of the true surface within 1 h of the model, precision that of the model within 1 h of the true surface,
rms the distance of the true surface from the model. Means are over parts whose median face is wider than {WIDE:g} h (the others have a *).

{summary(rows)}

![scan, faces, model and deviation of some parts](images/parts.png)

{table(rows)}

What the parts are:

{chr(10).join(f"- **{part}**: {WHOLE[part].description}" for part in dict.fromkeys(row.part for row in rows))}
"""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(WHOLE), default=list(WHOLE))
    parser.add_argument("--noise", nargs="+", type=float, default=list(NOISE))
    parser.add_argument("--points", type=int, default=60_000)
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--quick", action="store_true", help="six parts at noise .25")
    parser.add_argument("--pictures", action="store_true", help="draw the gallery")
    parser.add_argument("--output", type=Path, help="where to write the page (default docs/parts-truth.md for a full run)")
    given = parser.parse_args(arguments)
    parts, noises = (list(QUICK), [0.25]) if given.quick else (given.parts, given.noise)
    full = parts == list(WHOLE) and noises == list(NOISE) and not given.outliers
    output = given.output or (DOCS / "parts-truth.md" if full else None)
    rows: list[Row] = []
    shown: dict[str, tuple[Truth, Model]] = {}
    for name in parts:
        part = true_part(WHOLE[name].build())
        for noise in noises:
            truth = sample(part, {"noise": noise, "outliers": given.outliers}, points=given.points)
            row, model = measure(name, truth, noise)
            rows.append(row)
            print(table([row]).splitlines()[-1], flush=True)
            if model is not None and noise == noises[len(noises) // 2]:
                shown[name] = truth, model
        if given.pictures and (len(shown) == MOST or name == parts[-1]):
            draw_gallery(shown, (output.parent if output else DOCS) / "images" / "parts.png")
            given.pictures = False
        if not given.pictures:
            shown.clear()
        if output is not None:  # a run of an hour that is stopped leaves what it has
            output.write_text(page(rows, given.points), encoding="utf-8")
    print(summary(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
