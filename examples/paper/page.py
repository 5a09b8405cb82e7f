"""The page of the gallery, ``docs/paper.md``, with every figure from the run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from . import experiments as ex
from .experiments import Detected
from .gallery import OUTLINE_NOISE, WIDE_DELTA, Results
from .statements import INSERT, LARGE, STEP, given_noise, judge, paper_run, plain_name
from .truth import InsideScore


def write_page(results: Results, pictures: str) -> str:
    """Return the page; `pictures` is the folder of the pictures as seen from it."""
    parts = (_head(results), _summary(results), _marks(results, pictures), _procedure(results, pictures), _outlines(results))
    return "\n".join((*parts, _noise(results, pictures), _large(results, pictures), _decided()))


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _head(results: Results) -> str:
    rows = []
    for part, figure in ((STEP, "6, 7, 8, 9"), (INSERT, "1, 9, 10"), (LARGE, "11")):
        cloud = results.clouds[part]
        what = cloud.title.split(": ", 1)[1].rstrip(".")
        rows.append([plain_name(part), f"{len(cloud):,}", f"{cloud.sigma / cloud.h:.2g} h", figure, what])
    return f"""# The paper's experiments, redone

The method is that of "Functional Surface Reconstruction from Unorganized Noisy Point Clouds". Its scans are not public, so
the [scan simulator](commands.md#simulate) makes stand-ins of the same kind, and of the same size where the paper gives one, from
CAD parts; therefore the truth about every point is known. Parameters are the paper's. `make gallery` runs everything below and
writes this page; all its figures come from that run.

{_table(["scan", "points", "noise σ", "stands for Fig.", "what it is"], rows)}
A marked point is *right* within 2 h of a true edge (an edge where normals differ by 15° or more; on the step, the step itself), h
being the mean spacing. *Precision* is the share of marked points that are right, *recall* the share of the true edges' length with a
marked point within 2 h, F1 their harmonic mean. Inside and outside are judged farther than 2 h from the border. *Default* is what this
project does when nothing is said: one-sided normals, their radius and threshold chosen from the scan.
"""


def _summary(results: Results) -> str:
    rows = [[item.quote, f"**{item.verdict}**", item.evidence] for item in judge(results)]
    return f"""## What holds and what does not

On these stand-ins; the paper's own scans may have been finer or less noisy than they are. Statements about the step and the insert are
checked at five noises (0 to 1 h), the large scan at one.

{_table(["the paper", "here", "figures"], rows)}"""


def _row(run: Detected, *, detail: bool = False) -> list[str]:
    score = run.score
    cells = [run.name, f"{score.marked:.1%}", f"{score.precision:.2f}", f"{score.recall:.2f}", f"{score.f1:.2f}"]
    return [*cells, f"{score.detail:.2f}", f"{run.seconds:.1f}", f"{run.cpu:.1f}"] if detail else cells


_HEAD = ["operator", "marked", "precision", "recall", "F1"]


def _marks(results: Results, pictures: str) -> str:
    step, insert = results.marks[STEP], results.marks[INSERT]
    seventh = [ex.run_name(operator, k) for operator in ("dn", "vdn") for k in (1, 2, 3)]
    ninth = [ex.edn_name(alpha) for alpha in ex.FIG9_ALPHAS]
    both = [[*_row(insert[name]), *_row(step[name])[1:]] for name in (*ninth, ex.ROBUST)]
    return f"""## Figures 7 and 8: DN and VDN, repeated and one after the other

r_s = 1.5 d̄, r_l = 10 d̄, δ = 20°, on the shallow surface with a smooth step.

![DN and VDN once, twice and three times, VDN then DN, and one-sided normals, on the step]({pictures}/fig7.png)

{_table(_HEAD, [_row(step[name]) for name in (*seventh, ex.SEQUENCE, ex.ROBUST)])}
VDN marks two bands, one on either side of the step, and misses its middle, where all four quadrants see alike. Its wrong points are
mostly the outer fringe of the bands; those of DN are scattered everywhere, since the normal of the few points in a ball of 1.5 d̄
follows the noise.

## Figure 9: EDN with four pairs of coefficients

r_s = 1.5 d̄, r_l = 20 d̄, δ = 20°; α = 1 is DN alone, β = 1 VDN alone.

![EDN with four pairs of coefficients on the insert]({pictures}/fig9-insert.png)

![EDN with four pairs of coefficients on the step]({pictures}/fig9-step.png)

{_table(["", "insert: marked", *_HEAD[2:], "step: marked", *_HEAD[2:]], both)}"""


def _procedure(results: Results, pictures: str) -> str:
    rows = []
    for part in (INSERT, STEP):
        run = paper_run(results, part)
        for k, line in enumerate(run.lines):
            rows.append(
                [plain_name(part), f"{k + 1}", f"{line.n_points:,}", f"{line.stray:.0%}", f"{line.distance:.1f} h", f"{line.covered:.0%}"]
            )
        line = run.chosen_line
        rows.append(
            [plain_name(part), "3, by hand", f"{line.n_points:,}", f"{line.stray:.0%}", f"{line.distance:.1f} h", f"{line.covered:.0%}"]
        )
    return f"""## Figure 10: the whole procedure

EDN with α = 0.4 and r_l = 20 d̄, a density filter, Algorithm 2 (r_u = 3 h) once, twice, three times, removal of undesired points by
hand, Algorithm 3, and a B-spline surface through the points inside. The hand is played by the truth: it takes away what lies farther
than 4 h from the true border, which is more than a user could do. Surfaces are drawn where they have points that were found inside.

![The paper's procedure on the insert, and the default procedure]({pictures}/fig10-insert.png)

![The paper's procedure on the step, and the default procedure]({pictures}/fig10-step.png)

{_table(["scan", "Algorithm 2", "points", "farther than 10 h", "mean distance of the others", "border covered"], rows)}
{_ridge(results)}
"""


def _ridge(results: Results) -> str:
    """Say how the default procedure does on the insert, with its own δ and with a wider one."""
    noise = given_noise(results, INSERT)
    own, wide = results.default["insert, default δ"][noise], results.default[INSERT][noise]
    said = [f"{'no result' if run is None else f'IoU {run.inside.iou:.2f}'}" for run in (own, wide)]
    start = f"The insert's ridge bends with a radius of about 5 h. The default procedure gives {said[0]} of the inside there"
    if own is not None and own.inside.iou > 0.9:
        return f"{start}, and {said[1]} with δ = {WIDE_DELTA:.0f}°."
    return f"{start}, since it takes the ridge for an edge and stops at it; with δ = {WIDE_DELTA:.0f}° (`--threshold`) {said[1]}."


def _inside(score: InsideScore | None) -> list[str]:
    return ["no result", "–"] if score is None else [f"{score.accuracy:.3f}", f"{score.iou:.2f}"]


def _outlines(results: Results) -> str:
    rows = [[plain_name(name), *_inside(outline.algorithm3), *_inside(outline.default)] for name, outline in results.outlines.items()]
    return f"""## Algorithm 3: inside and outside

Algorithm 3 gets the exact border here, as far as it was scanned; the default procedure gets the scan alone (noise {OUTLINE_NOISE:g} h).

{_table(["outline", "Algorithm 3: accuracy", "IoU", "default: accuracy", "IoU"], rows)}
Algorithm 3 asks of a point whether its nearest border point and the border's centroid lie on opposite sides of it. That is right where the
outline is star-shaped about that centroid, and the surface about flat; on a ring, an L or a U it is not.
"""


def _noise(results: Results, pictures: str) -> str:
    rows = []
    for part in (STEP, INSERT):
        for noise in ex.NOISES:
            run, default = results.paper[part][noise], results.default[part][noise]
            cells = [plain_name(part), f"{noise:g} h", f"{run.lines[-1].stray:.0%}", f"{run.lines[-1].covered:.0%}"]
            cells += [f"{run.found_uncorrected.iou:.2f}", f"{run.inside.iou:.2f}", _rms(run.score, noise)]
            cells += ["no result", "–"] if default is None else [f"{default.inside.iou:.2f}", _rms(default.score, noise)]
            rows.append(cells)
    shares = {noise: [results.noise[part][noise][ex.edn_name(0.4)] for part in (STEP, INSERT)] for noise in ex.NOISES}
    undefined = [
        [f"{noise:g} h", *(f"{value:.0%}" for run in runs for value in (run.no_plane, run.no_sector))] for noise, runs in shares.items()
    ]
    best = [f"{results.noise[part][noise][ex.BEST].delta:.0f}°" for part in (STEP, INSERT) for noise in ex.NOISES]
    head = ["scan", "noise σ", "stray", "border covered", "IoU", "IoU, by hand", "rms, by hand", "default: IoU", "rms"]
    return f"""## At which noise each stops

![F1 of the operators over the noise]({pictures}/noise.png)

"Best δ" is EDN with the δ that the truth says is best: {_listed(best[: len(ex.NOISES)])} on the step,
{_listed(best[len(ex.NOISES) :])} on the insert. The step is only some 3 h high. Noise hides it from one-sided normals, whose
radius is at most 8 h: {_step_f1(results, ex.ROBUST)}. Where they find nothing, the default procedure takes
the whole scan for one surface. VDN, whose sectors reach 10 d̄, still shows the step dimly: {_step_f1(results, ex.run_name("vdn", 3))}.

The procedure of Fig. 10 at every noise. The rms is that of the surface against the true one, where it was fitted; on the insert the
default has δ = {WIDE_DELTA:.0f}°.

{_table(head, rows)}
Share of points whose ball of r_s = 1.5 d̄ carries no plane, and of those without two sectors that do:

{_table(["noise σ", "step: no plane", "no sectors", "insert: no plane", "no sectors"], undefined)}"""


def _step_f1(results: Results, name: str) -> str:
    scores = [f"{results.noise[STEP][noise][name].score.f1:.2f} at {noise:g} h" for noise in ex.NOISES if noise >= 0.25]
    return "F1 " + _listed(scores)


def _listed(words: Sequence[str]) -> str:
    return ", ".join(words[:-1]) + " and " + words[-1]


def _rms(score: object, noise: float) -> str:
    rms, in_sigma = getattr(score, "rms", np.nan), getattr(score, "in_sigma", np.nan)
    if not np.isfinite(rms):
        return "–"
    return f"{in_sigma:.2f} σ" if noise > 0 else f"{rms:.4f} h"


def _large(results: Results, pictures: str) -> str:
    rows = [_row(run, detail=True) for run in results.large.values()]
    return f"""## Figure 11: the large scan

r_s = 1.5 d̄, r_l = 30 d̄, δ = 20°, on {len(results.clouds[LARGE]):,} points. Details are the edges of faces smaller than a disc of
30 d̄: letters, bores, the ends of ribs.

![EDN on the large scan]({pictures}/fig11.png)

{_table([*_HEAD, "details", "seconds", "processor seconds"], rows)}
The times are those of the whole call on {results.threads} threads, with spacing, noise and normals. On an idle machine the seconds are
about the processor seconds divided by the threads; other programs make them more. The paper names "almost 5 minutes" on an i7-3770.
"""


def _decided() -> str:
    return """## What the paper leaves open, and how it is decided here

- A neighbourhood of r_s that carries no plane takes the next wider one (by √2, up to four times); a sector without a plane takes no part.
- VDN by itself uses r_l: at r_s it would be undefined for most points.
- A further run sees only the points that the previous run kept, with radii unchanged.
- The density filter is the statistical one in its original form: the mean distance to the nearest 30 marked points is at most
  one standard deviation above the average.
- r_u is not given; it is 3 h here. Algorithm 2 takes points in a sweep along the longest axis.
- The paper says of Fig. 11 (b) that α = 0 "is indeed the result got by DN operator"; by its eq. 2.4 it is VDN. The gallery shows both.
- Noise is Gaussian across the surface and equal everywhere.
"""
