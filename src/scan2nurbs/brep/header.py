"""What the header of every CAD file says: the project, never the user, the machine or the time."""

from __future__ import annotations

import os
import unicodedata
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

AUTHOR = "scan2nurbs"

UNIT_NAMES = {"mm": "MM", "cm": "CM", "m": "M", "um": "UM", "in": "INCH", "ft": "FT"}
"""How the CAD kernel calls the units."""


def system() -> str:
    """Return the originating system: the project's name and version."""
    try:
        return f"scan2nurbs {version('scan2nurbs')}"
    except PackageNotFoundError:
        return "scan2nurbs"


def time_stamp() -> datetime:
    """Return the time that files carry: SOURCE_DATE_EPOCH, in seconds, where it is set; else the beginning of 1970.

    The same input then gives the same bytes, whenever and wherever it is written (https://reproducible-builds.org/specs/source-date-epoch).
    """
    try:
        return datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", "0")), UTC)
    except (ValueError, OverflowError, OSError):
        return datetime.fromtimestamp(0, UTC)


def plain(name: str) -> str:
    """Return a name in the printable ASCII that every reader of exchange files understands."""
    decomposed = unicodedata.normalize("NFKD", name)
    text = "".join(c for c in decomposed if not unicodedata.combining(c))
    return "".join(c if " " <= c <= "~" and c not in "'\\" else "_" for c in text) or "part"
