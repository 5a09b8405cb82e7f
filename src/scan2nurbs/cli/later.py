"""Commands for whole parts, which this version does not have."""

from __future__ import annotations

from typing import Annotated, NoReturn

import typer

from scan2nurbs.errors import ParameterError

# Whatever is asked of them, the answer is the same.
CONTEXT = {"ignore_unknown_options": True, "allow_extra_args": True}
Anything = Annotated[list[str] | None, typer.Argument(metavar="SCAN")]


def segment(scan: Anything = None) -> NoReturn:
    """Split a scan into faces (not in this version)."""
    raise ParameterError("'segment' is not in this version; 'scan2nurbs surface' rebuilds one functional surface.")


def convert(scan: Anything = None) -> NoReturn:
    """Rebuild a whole part (not in this version)."""
    raise ParameterError("'convert' is not in this version; 'scan2nurbs surface' rebuilds one functional surface.")
