"""Run the command line on every scan of a folder, and tabulate what came out.

    python -m benchmarks.scans FOLDER [-o FILE.md] [--keep FOLDER] [--only NAME ...] [--time-limit SECONDS]

from the root of the checkout. Each file of the folder goes through ``scan2nurbs info``, ``edges`` and ``surface`` with default
parameters, each in a process of its own, as a user would type them. The tables are printed; with -o they replace what stands between
the two marks of a Markdown page, and what else is written there stays. With --keep the faces, reports and labelled points are kept.
Seconds are those of the whole process, with kernels that are compiled already.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

BEGIN, END = "<!-- begin: python -m benchmarks.scans -->", "<!-- end -->"
PROGRAM = (sys.executable, "-c", "from scan2nurbs.cli.main import main; main()")
DASH = "–"


@dataclass(frozen=True)
class Run:
    """What one command made of one scan.

    Attributes
    ----------
    code : int or None
        The exit code; None where the command did not end within the time limit.
    record : dict
        The JSON; empty where there is none.
    error : str
        The sentence on stderr; empty where the command succeeded.
    seconds : float
        From the start of the process to its end.
    cpu : float
        Seconds of computation on all cores together, which other work on the machine hardly changes.
    """

    code: int | None
    record: dict[str, Any]
    error: str
    seconds: float
    cpu: float


@dataclass(frozen=True)
class Result:
    """What came out for one scan."""

    name: str
    info: Run
    edges: Run
    surface: Run


def run(command: str, scan: Path, options: Sequence[str | Path] = (), *, limit: float = 600.0) -> Run:
    """Run one command on a scan in a process of its own."""
    start, before = time.perf_counter(), _children_cpu()
    try:
        done = subprocess.run(
            [*PROGRAM, command, str(scan), *map(str, options), "--json"], capture_output=True, text=True, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired:
        return Run(None, {}, f"No end within {limit:g} s.", time.perf_counter() - start, _children_cpu() - before)
    seconds, cpu = time.perf_counter() - start, _children_cpu() - before
    if done.returncode == 0:
        return Run(0, json.loads(done.stdout), "", seconds, cpu)
    said = done.stderr.strip().splitlines() or ["Nothing was said."]
    sentence = said[-1].removeprefix("scan2nurbs: ").removeprefix(f"{scan}: ")
    return Run(done.returncode, {}, sentence, seconds, cpu)


def _children_cpu() -> float:
    times = os.times()
    return times.children_user + times.children_system


def measure(scan: Path, keep: Path, *, limit: float = 600.0) -> Result:
    """Run the three commands on a scan; what they write goes to a folder."""
    stem = keep / scan.name
    written = ["-o", f"{stem}.step", "--points", f"{stem}.points.npz", "--report", f"{stem}.html"]
    return Result(
        name=scan.name,
        info=run("info", scan, limit=limit),
        edges=run("edges", scan, ["-o", f"{stem}.edges.ply"], limit=limit),
        surface=run("surface", scan, written, limit=limit),
    )


def warm_up(folder: Path) -> None:
    """Compile the kernels on a little scan of our own, so that no row pays for it."""
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    z = np.clip(24.0 - np.hypot(x - 30, y - 30), 0.0, 6.0) + np.random.default_rng(0).normal(0.0, 0.1, x.shape)
    path = folder / "warm-up.xyz"
    np.savetxt(path, np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))
    run("surface", path)


def scans_in(folder: Path, only: Sequence[str] = ()) -> list[Path]:
    """Return the files of a folder that are no hidden ones, or those of the given names."""
    found = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    return [path for path in found if not only or path.name in only]


class Notes:
    """Sentences that several rows share, numbered as they come."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def mark(self, sentences: Sequence[str]) -> str:
        """Return the numbers of sentences, as they stand in a cell."""
        for sentence in sentences:
            if sentence not in self.sentences:
                self.sentences.append(sentence)
        return ", ".join(str(number) for number in sorted({self.sentences.index(sentence) + 1 for sentence in sentences}))


def tables(results: Sequence[Result]) -> str:
    """Return the results as Markdown: what was read, what became of it, and what was said."""
    notes = Notes()
    parts = [
        "### What was read, and its edge points",
        _table("file, format, points, unit, h, noise / h, on an edge, s, notes", [_read_row(one, notes) for one in results]),
        "### What `surface` made of it",
        _table(
            "file, exit code, points of the face, found, map, control points, rms / h, rms / noise, loops, valid, s, CPU s, MB, notes",
            [_surface_row(one, notes) for one in results],
        ),
        "Notes:",
        "\n".join(f"{number}. {sentence}" for number, sentence in enumerate(notes.sentences, 1)) or "none",
    ]
    return "\n\n".join(parts)


def _table(head: str, rows: list[list[str]]) -> str:
    names = head.split(", ")
    lines = [names, ["---"] * len(names), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _read_row(result: Result, notes: Notes) -> list[str]:
    info, edges = result.info, result.edges
    if info.code != 0:
        return [result.name, *[DASH] * 6, f"{info.seconds:.1f}", f"exit {_code(info)}: {info.error}"]
    found, scale = info.record["input"], info.record["scale"]
    row = [result.name, found["format"], f"{found['n_points']:,}", found["unit"], f"{scale['h']:.3g}", f"{scale['noise'] / scale['h']:.2f}"]
    said = list(info.record["warnings"])
    if edges.code != 0:
        return [*row, DASH, f"{info.seconds + edges.seconds:.1f}", f"edges: exit {_code(edges)}: {edges.error}"]
    said += [warning for warning in edges.record["warnings"] if warning not in said]
    share = edges.record["edges"]["n_points"] / max(found["n_rows"] - found["n_invalid"], 1)
    return [*row, f"{100 * share:.0f} %", f"{info.seconds + edges.seconds:.1f}", notes.mark(said)]


def _surface_row(result: Result, notes: Notes) -> list[str]:
    surface = result.surface
    if surface.code != 0:
        return [result.name, _code(surface), *[DASH] * 8, f"{surface.seconds:.1f}", f"{surface.cpu:.1f}", DASH, notes.mark([surface.error])]
    record = surface.record
    face, scale, model = record["faces"][0], record["scale"], record["model"]
    said = [warning for warning in record["warnings"] if warning not in result.info.record.get("warnings", [])]
    return [
        result.name,
        "0",
        f"{record['inside']['n_points']:,}",
        str(max(len(record["inside"]["candidates"]), 1)),
        face["parametrization"],
        f"{face['n_control_points']:,}",
        f"{face['rms'] / scale['h']:.2f}",
        f"{face['rms'] / scale['noise']:.2f}" if scale["noise"] > 0 else DASH,
        str(len(face["loops"])),
        "yes" if model["valid"] else "no",
        f"{surface.seconds:.1f}",
        f"{surface.cpu:.1f}",
        f"{record['peak_memory_mb']:.0f}" if record["peak_memory_mb"] else DASH,
        notes.mark(said),
    ]


def _code(one: Run) -> str:
    return DASH if one.code is None else str(one.code)


def put(page: str, tables: str) -> str:
    """Replace what stands between the marks of a page; a page without marks gets them at its end."""
    body = f"{BEGIN}\n\n{tables}\n\n{END}"
    if BEGIN not in page or END not in page.split(BEGIN, 1)[1]:
        return f"{page.rstrip()}\n\n{body}\n".lstrip()
    before, rest = page.split(BEGIN, 1)
    return before + body + rest.split(END, 1)[1]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the scans are")
    parser.add_argument("-o", "--output", type=Path, help="a Markdown page to put the tables into")
    parser.add_argument("--keep", type=Path, help="a folder for the faces, reports and labelled points")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="run these files of the folder alone")
    parser.add_argument("--time-limit", type=float, default=600.0, help="seconds a command may take")
    given = parser.parse_args(arguments)
    if not given.folder.is_dir():
        parser.error(f"{given.folder} is no folder.")
    scans = scans_in(given.folder, given.only)
    if not scans:
        parser.error(f"{given.folder} holds no such files.")
    results = []
    with tempfile.TemporaryDirectory() as scratch:
        keep = given.keep or Path(scratch)
        keep.mkdir(parents=True, exist_ok=True)
        warm_up(Path(scratch))
        for number, scan in enumerate(scans, 1):
            result = measure(scan, keep, limit=given.time_limit)
            results.append(result)
            codes = " ".join(_code(one) for one in (result.info, result.edges, result.surface))
            print(
                f"[{number}/{len(scans)}] {scan.name}: exit codes {codes}, surface {result.surface.seconds:.1f} s",
                file=sys.stderr,
                flush=True,
            )
    print(tables(results))
    if given.output is not None:
        page = given.output.read_text(encoding="utf-8") if given.output.exists() else "# Real scans\n"
        given.output.parent.mkdir(parents=True, exist_ok=True)
        given.output.write_text(put(page, tables(results)), encoding="utf-8")
    # A result, unusable input and no result are answers; wrong usage, a bug and no end are failures of the program.
    return 0 if all(one.code in (0, 3, 4) for result in results for one in (result.info, result.edges, result.surface)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
