"""Look at where results shall go before anything is computed."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from pathlib import Path

from scan2nurbs.errors import ParameterError

REPORTS = (".html", ".htm")
POINTS = (".ply", ".npz", ".csv")
CURVES = (".step", ".stp", ".iges", ".igs", ".brep", ".ply", ".obj")
CAD = (".step", ".stp", ".iges", ".igs", ".brep", ".3dm")
MESHES = (".stl", ".ply", ".obj")
"""Suffixes that have a writer; a test compares them with the writers."""


def check_outputs(outputs: Iterable[tuple[Path | None, Collection[str]]], inputs: Iterable[Path | None]) -> None:
    """Refuse an output that could not be written in the end, or that would overwrite an input or another output.

    Parameters
    ----------
    outputs : iterable of (path or None, suffixes)
        Where to write, and the suffixes (with their dot, lower case) that have a writer.
    inputs : iterable of path or None
        Files that are read.

    Raises
    ------
    ParameterError
        If a folder is missing or not writable, a suffix has no writer, or two files are one.
    """
    taken = [path.resolve() for path in inputs if path is not None]
    for path, suffixes in outputs:
        if path is None:
            continue
        _check_place(path, suffixes)
        where = path.resolve()
        if any(where == other or _same_file(where, other) for other in taken):
            raise ParameterError(f"{path}: The output would overwrite another file of this command; name a different one.")
        taken.append(where)


def check_rhino(output: Path | None) -> None:
    """Find out before anything is computed that the library for 3DM is missing."""
    if output is None or output.suffix.lower() != ".3dm":
        return
    from importlib.util import find_spec  # noqa: PLC0415

    if find_spec("rhino3dm") is None:
        raise ParameterError(f"{output}: 3DM needs an optional dependency: pip install 'scan2nurbs[rhino]'")


def _check_place(path: Path, suffixes: Collection[str]) -> None:
    if path.suffix.lower() not in suffixes:
        raise ParameterError(f"{path}: There is no writer for the suffix '{path.suffix}'. Known are: {', '.join(sorted(suffixes))}.")
    if path.is_dir():
        raise ParameterError(f"{path}: The output is a folder; name a file.")
    if not path.parent.is_dir():
        raise ParameterError(f"{path}: The folder '{path.parent}' does not exist.")
    if not os.access(path.parent, os.W_OK):
        raise ParameterError(f"{path}: The folder '{path.parent}' cannot be written to.")


def _same_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False
