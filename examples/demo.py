"""The whole way in a minute: a CAD part, a scan of it, a CAD model rebuilt from the scan: ``python examples/demo.py FOLDER``."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PART, SURFACE = "bracket", "demo"


def scan2nurbs(*arguments: object) -> None:
    """Run a command as a user would, and show it."""
    words = [str(argument) for argument in arguments]
    print(f"\n$ scan2nurbs {shlex.join(words)}", flush=True)
    subprocess.run([sys.executable, "-c", "from scan2nurbs.cli.main import main; main()", *words], check=True)


def main(folder: Path) -> None:
    sys.path.insert(0, str(ROOT))
    from examples.parts import PARTS
    from examples.parts.make_parts import write_parts

    folder.mkdir(parents=True, exist_ok=True)
    step, block = write_parts(folder, [PART, SURFACE])
    # The whole part: a bracket from 60,000 noisy points all around it.
    scan = folder / "part-scan.ply"
    scan2nurbs("simulate", step, "-o", scan, "--n-points", 60_000, "--mode", "grid", "--noise", 0.25, "--noise-across", 0.25, "--quiet")
    scan2nurbs("info", scan)
    scan2nurbs("convert", scan, "-o", folder / "part.step", "--report", folder / "report.html")
    # The paper's case: one functional surface of a part that was scanned from above.
    scan, seed = folder / "scan.ply", ",".join(f"{value:.4g}" for value in PARTS[SURFACE].seed)
    scan2nurbs("simulate", block, "-o", scan, "--n-points", 40_000, "--views", 9, "--spread", 50, "--noise", 0.25, "--quiet")
    scan2nurbs("surface", scan, "-o", folder / "surface.step", "--report", folder / "surface-report.html", "--seed", seed)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))
