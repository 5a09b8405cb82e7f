"""Reading and writing of points, one file a format.

`read_scan` finds the format by the content; where the suffix says otherwise, the content wins and a note says so.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scan2nurbs.io.atomic import atomic_path
from scan2nurbs.io.e57 import read_e57
from scan2nurbs.io.foreign import is_npz, name_foreign
from scan2nurbs.io.las import read_las
from scan2nurbs.io.npy import read_npy, read_npz
from scan2nurbs.io.obj import is_obj, read_obj
from scan2nurbs.io.off import is_bare_off, is_off, read_off
from scan2nurbs.io.pcd import is_pcd, read_pcd
from scan2nurbs.io.ply import is_ply, read_ply
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source, open_source
from scan2nurbs.io.stl import is_stl, read_stl
from scan2nurbs.io.table import with_newlines
from scan2nurbs.io.text import is_text, read_text
from scan2nurbs.io.write import write_points

__all__ = ["FORMATS", "Format", "Scan", "atomic_path", "read_scan", "write_points"]

_HEAD = 1 << 16


@dataclass(frozen=True)
class Format:
    """A format that can be read.

    Attributes
    ----------
    name : str
        As a user would say it.
    suffixes : tuple of str
        In lower case, with their dots.
    matches : callable
        Tells from the file and its first bytes whether it is of this format.
    read : callable
        Makes a `Scan` of it or raises an `InputError`.
    """

    name: str
    suffixes: tuple[str, ...]
    matches: Callable[[Source, bytes], bool]
    read: Callable[[Source], Scan]


FORMATS = (
    Format("PLY", (".ply",), lambda _, head: is_ply(head), read_ply),
    Format("PCD", (".pcd",), lambda _, head: is_pcd(head), read_pcd),
    Format("LAS", (".las", ".laz"), lambda _, head: head[:4] == b"LASF", read_las),
    Format("E57", (".e57",), lambda _, head: head[:8] == b"ASTM-E57", read_e57),
    Format("NPY", (".npy",), lambda _, head: head[:6] == b"\x93NUMPY", read_npy),
    Format("NPZ", (".npz",), lambda source, _: is_npz(source), read_npz),
    Format("OFF", (".off", ".coff", ".noff"), lambda _, head: is_off(head), read_off),
    Format("STL", (".stl",), lambda source, head: is_stl(head, len(source.data)), read_stl),
    Format("OBJ", (".obj",), lambda _, head: is_obj(head), read_obj),
)
"""The formats that announce themselves, in the order in which they are tried."""

_TEXT_SUFFIXES = (".xyz", ".txt", ".csv", ".asc", ".pts", ".pwn", ".xyzn", ".dat", ".tsv")
TEXT = Format("text", _TEXT_SUFFIXES, lambda _, head: is_text(head), read_text)
"""What remains when nothing announces itself."""


def read_scan(path: str | os.PathLike[str]) -> Scan:
    """Read the points of a file.

    Parameters
    ----------
    path : path
        A PLY, PCD, LAS, LAZ, E57, STL, OBJ, OFF, NPY, NPZ or text file, or any but E57 packed by gzip.

    Returns
    -------
    Scan
        Its rows in their order; rows that hold no finite point are NaN.

    Raises
    ------
    InputError
        If the file is missing, empty, truncated, damaged, contradicts itself or is of a foreign format. Nothing else is raised for
        any content of the file.
    MissingExtraError
        If the format needs an optional dependency that is not installed.
    """
    # Damaged numbers may be signalling NaNs or beyond float64; they become rows that are no point, not warnings.
    with open_source(Path(path)) as source, np.errstate(all="ignore"):
        chosen = _choose(source)
        scan = chosen.read(source)
        if not len(scan.points):
            raise source.fault("The file holds no points.")
        return _finish(source, chosen, scan)


def _choose(source: Source) -> Format:
    head = bytes(source.data[:_HEAD])
    if source.data.find(b"\n", 0, _HEAD) < 0:
        head = bytes(with_newlines(head))
    for candidate in FORMATS:
        if candidate.matches(source, head):
            return candidate
    foreign = name_foreign(source)
    if foreign is not None:
        raise source.fault(f"This is {foreign}.")
    expected = next((candidate for candidate in FORMATS if source.suffix in candidate.suffixes), None)
    if expected is not None and expected.name == "STL" and not is_text(head):
        return expected  # a binary STL file that is truncated or has a tail: its reader says which
    if expected is not None and expected.name == "OFF" and is_bare_off(head):
        return expected
    if is_text(head):
        if expected is not None and not any(byte in head for byte in b"0123456789"):
            raise source.fault(f"The suffix says {expected.name}, but the content is no {expected.name} and no table of points.")
        return TEXT
    raise source.fault(f"The content is of no known format (it begins with the bytes {head[:8].hex(' ')}).")


def _finish(source: Source, chosen: Format, scan: Scan) -> Scan:
    """Mark the rows that are no point, and note what the user should know of the file as a whole."""
    notes = list(scan.notes)
    suffixes = {suffix: known.name for known in (*FORMATS, TEXT) for suffix in known.suffixes}
    said = suffixes.get(source.suffix, chosen.name)
    if said != chosen.name:
        notes.insert(0, f"The suffix {source.suffix} says {said}, but the content is {scan.format}; the content was believed.")
    if source.packed:
        notes.append("The file was unpacked by gzip.")
    points = scan.points
    finite = np.isfinite(points)
    if not finite.all():  # rare, and row by row it takes five times as long
        finite = np.asarray(finite.all(axis=1))
        points = np.where(finite[:, None], points, np.nan)
        notes.append(f"{np.count_nonzero(~finite):,} of {len(points):,} rows hold no finite point.")
    return replace(scan, points=points, notes=tuple(notes))
