"""The whole way in a minute: a CAD part, a simulated scan of it, a face rebuilt from the scan: ``python examples/demo.py FOLDER``."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PART = "demo"


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
    (step,) = write_parts(folder, [PART])
    scan, seed = folder / "scan.ply", ",".join(f"{value:.4g}" for value in PARTS[PART].seed)
    scan2nurbs("simulate", step, "-o", scan, "--n-points", 40_000, "--views", 9, "--spread", 50, "--noise", 0.25, "--quiet")
    scan2nurbs("info", scan)
    scan2nurbs("surface", scan, "-o", folder / "surface.step", "--report", folder / "report.html", "--seed", seed)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))
