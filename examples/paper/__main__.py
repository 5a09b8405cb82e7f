"""Redo the paper's experiments: ``python -m examples.paper [DOCS]`` from the root of the checkout writes ``paper.md`` and its pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from .gallery import run
from .page import write_page


def main(docs: Path) -> None:
    results = run(docs / "images" / "paper", say=lambda line: print(line, flush=True))
    (docs / "paper.md").write_text(write_page(results, "images/paper"), encoding="utf-8")
    print(docs / "paper.md")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
