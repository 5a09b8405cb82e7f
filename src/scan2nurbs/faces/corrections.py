"""Corrections of faces by hand, as a file that can be replayed.

The file is JSON: a list of steps, each an object with one key, done in their order::

    [
      {"merge": [3, 7]},
      {"type": {"face": 5, "kind": "cylinder"}},
      {"tolerance": {"face": 5, "value": 0.1}},
      {"split": {"face": 2, "lassos": [{"view": "xy", "polygon": [[0, 0], [8, 0], [4, 6]]}]}},
      {"assign": {"face": 4, "boxes": [{"min": [0, 0, 0], "max": [1, 1, 1]}]}},
      {"delete": 9}
    ]

Faces go by the numbers of the report. A number never passes to another face: faces that are merged keep the number that is named first,
what is split off gets the next free number, numbers of faces that are gone stay unused. ``assign`` gives points to a face, and to none
where the face is −1. A tolerance, in the points' unit, is how far the surface of a face may lie from its points besides their noise: the
surface is as simple as that allows, or of the type that was asked for, which need not be among those that faces may have elsewhere. Points
are named as in a selection: by ``indices`` (row numbers of the input), ``boxes`` and ``lassos``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.corrections import Selection, parse_json, read_text, selection_from
from scan2nurbs.errors import InputError
from scan2nurbs.surfaces.shape import KINDS, Kind

Selector = Callable[[Selection], NDArray[np.bool_]]
WHAT = "file of corrections"
Action = Literal["merge", "type", "tolerance", "split", "assign", "delete"]


@dataclass(frozen=True)
class Step:
    """One correction.

    Attributes
    ----------
    action : str
        "merge", "type", "tolerance", "split", "assign" or "delete".
    faces : tuple of int
        The numbers of the faces it is about.
    kind : str, optional
        For "type".
    tolerance : float, optional
        For "tolerance"; in the points' unit, > 0.
    points : Selection, optional
        For "split" and "assign".
    """

    action: Action
    faces: tuple[int, ...]
    kind: Kind | None = None
    tolerance: float | None = None
    points: Selection | None = None


@dataclass(frozen=True)
class FaceCorrections:
    """Steps in their order, and the file that they come from."""

    steps: tuple[Step, ...]
    source: Path | None = None


@dataclass(frozen=True)
class Numbered:
    """Points by face number, after corrections.

    Attributes
    ----------
    label : (N,) int32
        The number of each point's face; −1 for none. Numbers may be missing.
    changed : frozenset of int
        Faces whose points are no longer those that their surface was fitted to.
    forced : dict of int to str
        Kinds that were asked for.
    tolerances : dict of int to float
        Tolerances that were asked for.
    free : int
        The first number that no face ever had.
    """

    label: NDArray[np.int32]
    changed: frozenset[int]
    forced: dict[int, Kind]
    tolerances: dict[int, float]
    free: int


def apply_face_corrections(label: NDArray[np.int32], corrections: FaceCorrections, selected: Selector) -> Numbered:
    """Do the steps.

    Parameters
    ----------
    label : (N,) int32
        Face numbers as they were found; −1 for none.
    corrections : FaceCorrections
        What to do.
    selected : callable
        Takes a `Selection`, returns which of the N points it names, as (N,) bool.

    Raises
    ------
    InputError
        If a step names a face that does not exist at that point, a split that leaves nothing on one of its sides, or a selection
        without a point.
    """
    work = _Work(label.copy(), corrections.source, selected)
    for number, step in enumerate(corrections.steps, start=1):
        work.do(step, f"Step {number} ({step.action})")
    present = {int(face) for face in np.unique(work.label)} - {-1}
    forced: dict[int, Kind] = {face: kind for face, kind in work.forced.items() if face in present}
    tolerances = {face: value for face, value in work.tolerances.items() if face in present}
    return Numbered(work.label, frozenset(work.changed & present), forced, tolerances, work.free)


class _Work:
    """The labels while the steps are done."""

    def __init__(self, label: NDArray[np.int32], source: Path | None, selected: Selector) -> None:
        self.label, self.source, self.selected = label, source, selected
        self.changed: set[int] = set()
        self.forced: dict[int, Kind] = {}
        self.tolerances: dict[int, float] = {}
        self.free = int(label.max(initial=-1)) + 1

    def do(self, step: Step, where: str) -> None:
        for face in step.faces:
            if face >= 0 and not (self.label == face).any():
                raise InputError(f"{where}: there is no face {face}.", path=self.source)
        first = step.faces[0]
        if step.action == "merge":
            self.label[np.isin(self.label, step.faces)] = first
            self.changed.add(first)
        elif step.action == "delete":
            self.label[self.label == first] = -1
        elif step.kind is not None:
            self.forced[first] = step.kind
        elif step.tolerance is not None:
            self.tolerances[first] = step.tolerance
        elif step.points is not None:
            chosen = self.selected(step.points)
            if step.action == "split":
                self._split(first, chosen, where)
            elif not chosen.any():
                raise InputError(f"{where}: the selection holds no point.", path=self.source)
            else:
                self.changed |= {int(face) for face in np.unique(self.label[chosen])} | {first}
                self.label[chosen] = first

    def _split(self, face: int, chosen: NDArray[np.bool_], where: str) -> None:
        whole = self.label == face
        if not (chosen & whole).any() or (chosen | ~whole).all():
            raise InputError(f"{where}: the selection does not divide face {face}.", path=self.source)
        self.label[chosen & whole] = self.free
        self.changed |= {face, self.free}
        self.free += 1


def read_face_corrections(path: Path | str) -> FaceCorrections:
    """Read corrections from a JSON file, whose form the module's text describes.

    Raises
    ------
    InputError
        If the file cannot be read or a step is none of these; the message names the file and the step.
    """
    path = Path(path)
    content = parse_json(read_text(path, WHAT), path, WHAT)
    if not isinstance(content, list):
        raise InputError("The corrections must be a list of steps.", path=path)
    return FaceCorrections(tuple(_step(step, f"Step {k}", path) for k, step in enumerate(content, start=1)), path)


def _step(content: Any, where: str, path: Path) -> Step:
    if not isinstance(content, dict) or len(content) != 1 or next(iter(content)) not in get_args(Action):
        raise InputError(f"{where} of the corrections must be an object with one key of {', '.join(get_args(Action))}.", path=path)
    ((action, said),) = content.items()
    if action == "merge":
        if not isinstance(said, list) or len(said) < 2:
            raise InputError(f"{where}: a merge needs a list of at least two faces.", path=path)
        faces = tuple(_face(face, where, path) for face in said)
        if len(set(faces)) < 2:
            raise InputError(f"{where}: a merge needs two faces that are not the same.", path=path)
        return Step("merge", faces)
    if action == "delete":
        return Step("delete", (_face(said, where, path),))
    if not isinstance(said, dict):
        raise InputError(f'{where}: "{action}" must be an object that names a "face".', path=path)
    rest = {key: value for key, value in said.items() if key != "face"}
    face = _face(said.get("face"), where, path, least=-1 if action == "assign" else 0)
    if action == "type":
        if set(rest) != {"kind"} or rest["kind"] not in KINDS:
            raise InputError(f'{where}: "type" needs a "face" and a "kind" of {", ".join(KINDS)}.', path=path)
        return Step("type", (face,), kind=rest["kind"])
    if action == "tolerance":
        value: Any = rest.get("value")
        if set(rest) != {"value"} or type(value) not in (int, float) or not 0 < value <= sys.float_info.max:
            raise InputError(f'{where}: "tolerance" needs a "face" and a "value" > 0 in the points\' unit.', path=path)
        return Step("tolerance", (face,), tolerance=float(value))
    return Step(action, (face,), points=selection_from(rest, path))


def _face(value: Any, where: str, path: Path, least: int = 0) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 2**31:
        raise InputError(f"{where}: a face must be a number as the report has it. Got {str(value)[:40]!r} instead.", path=path)
    return value
