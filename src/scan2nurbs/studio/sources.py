"""Whether the built page belongs to its source: a hash of the sources is written beside the page when it is built.

``python -m scan2nurbs.studio.sources`` writes it; the build does so at its end.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

STATIC = Path(__file__).parent / "static"
SOURCES = Path(__file__).parents[3] / "studio-web"
RECORD = STATIC / "built-from.txt"
_FILES = ("package.json", "package-lock.json", "vite.config.js", "tsconfig.json", "index.html")


def source_hash(folder: Path = SOURCES) -> str:
    """Return a hash of everything that the page is built from."""
    digest = hashlib.sha256()
    files = [folder / name for name in _FILES] + sorted([*(folder / "src").rglob("*"), *(folder / "public").rglob("*")])
    for path in files:
        if path.is_file():
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0")
            digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()


def built_hash() -> str:
    """Return a hash of the built page without the record."""
    digest = hashlib.sha256()
    for path in sorted(STATIC.rglob("*")):
        if path.is_file() and path != RECORD:
            digest.update(path.relative_to(STATIC).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def record() -> str:
    """Return what stands in the record when source and page belong together."""
    return f"source {source_hash()}\npage {built_hash()}\n"


if __name__ == "__main__":
    RECORD.write_text(record(), encoding="utf-8")
