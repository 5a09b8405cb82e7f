"""Commands for whole parts, which this version does not have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NoReturn

import typer

from scan2nurbs.errors import ParameterError

Anything = Annotated[list[str] | None, typer.Argument(hidden=True)]


def segment(scan: Annotated[Path | None, typer.Argument(metavar="SCAN")] = None) -> NoReturn:
    """Split a scan into faces (not in this version)."""
    raise ParameterError("'segment' is not in this version; 'scan2nurbs surface' rebuilds one functional surface.")


def convert(scan: Annotated[Path | None, typer.Argument(metavar="SCAN")] = None) -> NoReturn:
    """Rebuild a whole part (not in this version)."""
    raise ParameterError("'convert' is not in this version; 'scan2nurbs surface' rebuilds one functional surface.")
