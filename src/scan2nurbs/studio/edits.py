"""Edits: what a person did to a project, as plain data that can be done again.

An edit is an object with one key::

    {"set": {"stage": "edges", "name": "threshold", "value": 15}}       null: automatic
    {"boundary": {"add": {"lassos": […]}}}, {"boundary": {"drop": {"indices": […]}}}
    {"face": {"merge": [3, 7]}}                                           any step of a file of corrections of faces
    {"face": [{"delete": 3}, {"delete": 7}]}                              several, done and undone as one

Selections are those of `scan2nurbs.edges.corrections`, steps those of `scan2nurbs.faces.corrections`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_origin, get_type_hints

from scan2nurbs.brep.part import ModelParams
from scan2nurbs.cloud import UNITS
from scan2nurbs.described import bare_type
from scan2nurbs.edges.corrections import selection_from
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import InputError, ParameterError
from scan2nurbs.faces.corrections import FaceCorrections, read_face_corrections
from scan2nurbs.faces.segmentation import SegmentParams
from scan2nurbs.faces.topology import TopologyParams
from scan2nurbs.part import PartParams
from scan2nurbs.part_faces import BoundaryStep
from scan2nurbs.report.record import plain
from scan2nurbs.studio.live import normals_of
from scan2nurbs.studio.messages import STEPS, Step
from scan2nurbs.surfaces.relations import RelationParams

Json = dict[str, Any]

STAGES: dict[str, tuple[type | None, Step]] = {
    "scan": (None, "scan"),
    "edges": (EdgeParams, "edges"),
    "segment": (SegmentParams, "faces"),
    "relations": (RelationParams, "surfaces"),
    "topology": (TopologyParams, "surfaces"),
    "model": (ModelParams, "model"),
}
"""For each group of parameters its dataclass and the step that it belongs to; the unit and whether there are relations stand alone."""

AFTER_EDGES: tuple[Step, ...] = ("faces", "surfaces", "model")

_CORRECTIONS = Path("corrections.json")


@dataclass(frozen=True)
class Plan:
    """What the edits amount to: the parameters of `reconstruct` and the unit, None where the file says it."""

    params: PartParams
    unit: str | None

    def of(self, stage: str) -> Any:
        """Return the parameters of a stage that has a dataclass in `STAGES`."""
        return self.params.relation_params if stage == "relations" else getattr(self.params, stage)

    def values(self) -> dict[str, Any]:
        """Return the value of every parameter by stage and name; None where it is automatic."""
        values: dict[str, Any] = {"scan.unit": self.unit, "relations.relations": self.params.relations}
        for stage, (params, _) in STAGES.items():
            if params is not None:
                values |= {f"{stage}.{name}": value for name, value in vars(self.of(stage)).items()}
        return values

    def idle(self) -> set[str]:
        """Return the parameters, by stage and name, that make no difference as the others are."""
        relations = () if self.params.relations else (f"relations.{field.name}" for field in dataclasses.fields(RelationParams))
        return {f"edges.{name}" for name in self.params.edges.idle()} | set(relations)

    def keys(self, step: Step) -> tuple[str, ...]:
        """Return the keys one of which a step's result has where it is up to date."""
        return (self.key(step), self.key(step, by_edges=False)) if step in AFTER_EDGES else (self.key(step),)

    def key(self, step: Step, *, by_edges: bool = True) -> str:
        """Return what the result of a step follows from, as a short text: equal keys, equal results.

        Parameters
        ----------
        step : str
        by_edges : bool
            Whether it matters for the step which points are marked as edges, see `scan2nurbs.faces.segmentation.Faces`.
        """
        params = self.params
        parts: list[Any] = [self.unit]
        if STEPS.index(step) >= 1:
            parts += [params.edges, params.boundary] if by_edges else ["by normals", normals_of(params.edges)]
        if STEPS.index(step) >= 2:
            parts += [params.segment, params.corrections]
        if STEPS.index(step) >= 3:
            parts += [params.relations, params.relation_params, params.topology]
        if STEPS.index(step) >= 4:
            parts += [params.model]
        text = json.dumps(plain([_without_infinity(part) for part in parts]), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _without_infinity(part: Any) -> Any:
    return repr(part) if isinstance(part, tuple | FaceCorrections) else part


def replay(edits: Sequence[Json]) -> Plan:
    """Do edits in their order.

    Raises
    ------
    ParameterError, InputError
        If one of them is no edit, or says something that no stage can use.
    """
    values: dict[str, Json] = {stage: {} for stage in STAGES}
    boundary: list[BoundaryStep] = []
    steps: list[Any] = []
    for edit in edits:
        kind, said = _single(edit, ("set", "boundary", "face"))
        if kind == "set":
            stage, name, value = _setting(said)
            values[stage][name] = value
        elif kind == "boundary":
            action, points = _single(said, ("add", "drop"))
            boundary.append(BoundaryStep("add" if action == "add" else "drop", replace(selection_from(points, _CORRECTIONS), source=None)))
        else:
            steps += _steps(said)
    relations = values["relations"].pop("relations", True)
    try:
        made = {stage: params(**values[stage]) for stage, (params, _) in STAGES.items() if params is not None}
    except TypeError as error:
        raise ParameterError(f"A parameter has a value of the wrong type: {error}.") from error
    made["relation_params"] = made.pop("relations")
    params = PartParams(**made, relations=relations, boundary=tuple(boundary), corrections=_face_corrections(steps))
    return Plan(params, values["scan"].get("unit"))


def step_of(edit: Json) -> Step:
    """Return the step that an edit belongs to: it and those after it follow from the edit."""
    kind, said = _single(edit, ("set", "boundary", "face"))
    return STAGES[said["stage"]][1] if kind == "set" else "edges" if kind == "boundary" else "faces"


def describe_edit(edit: Json) -> str:
    """Say what an edit does, in a few words."""
    kind, said = _single(edit, ("set", "boundary", "face"))
    if kind == "set":
        value = "automatic" if said["value"] is None else said["value"]
        shown = ", ".join(map(str, value)) if isinstance(value, list) else f"{value:.4g}" if isinstance(value, float) else value
        return f"{said['name'].replace('_', ' ').capitalize()}: {shown}"
    if kind == "boundary":
        action, content = _single(said, ("add", "drop"))
        return f"{'Add to' if action == 'add' else 'Take from'} the boundary: {_extent(content)}"
    steps = [_single(step, tuple(step)) for step in _steps(said)]
    if len(steps) > 1 and all(action == "delete" for action, _ in steps):
        return f"Delete faces {', '.join(str(face) for _, face in steps)}"
    return "; ".join(_describe_step(action, content) for action, content in steps)


def _describe_step(action: str, content: Any) -> str:
    if action == "merge":
        return f"Merge faces {', '.join(map(str, content))}"
    if action == "delete":
        return f"Delete face {content}"
    face = content["face"]
    if action == "type":
        return f"Face {face} is a {content['kind']}"
    if action == "tolerance":
        return f"Tolerance of face {face}: {content['value']:.4g}"
    verb = "Split face" if action == "split" else "Give points to face"
    return f"{'Give points to no face' if face == -1 else f'{verb} {face}'}: {_extent({**content, 'face': None})}"


def _extent(selection: Any) -> str:
    if isinstance(selection, list):
        return f"{len(selection):,} points"
    parts = [f"{len(selection['indices']):,} points"] if selection.get("indices") else []
    parts += ["a lasso"] if selection.get("lassos") else []
    return " and ".join([*parts, *(["a box"] if selection.get("boxes") else [])])


def _steps(said: Any) -> list[Any]:
    """Return the steps of one edit of faces: one, or a list of them."""
    if said == []:
        raise ParameterError("An edit of faces must hold at least one step.")
    return said if isinstance(said, list) else [said]


def _single(content: Any, known: Sequence[str]) -> tuple[str, Any]:
    if not isinstance(content, dict) or len(content) != 1 or next(iter(content)) not in known:
        raise ParameterError(f"An edit must be an object with one key of {', '.join(known)}.")
    return next(iter(content.items()))


def _setting(said: Any) -> tuple[str, str, Any]:
    if not isinstance(said, dict) or set(said) != {"stage", "name", "value"}:
        raise ParameterError("A setting must have a stage, a name and a value.")
    stage, name, value = said["stage"], said["name"], said["value"]
    if not isinstance(stage, str) or stage not in STAGES:
        raise ParameterError(f"The stages with parameters are {', '.join(STAGES)}. Got {str(stage)[:40]!r} instead.")
    if stage == "scan":
        if name != "unit" or not (value is None or (isinstance(value, str) and value in UNITS)):
            raise ParameterError(f"The unit must be one of {', '.join(UNITS)}.")
        return stage, name, value
    if (stage, name) == ("relations", "relations"):
        if not isinstance(value, bool | None):
            raise ParameterError("The relations must be on or off.")
        return stage, name, value is not False
    return stage, name, _value(stage, name, value)


def _value(stage: str, name: str, value: Any) -> Any:
    params = STAGES[stage][0]
    assert params is not None
    field = next((field for field in dataclasses.fields(params) if field.name == name), None)
    if field is None:
        raise ParameterError(f"The stage '{stage}' has no parameter {str(name)[:40]!r}.")
    if value is None:
        return field.default
    kind = bare_type(get_type_hints(params)[name])
    if kind is float and type(value) in (int, float):
        return float(value)
    if get_origin(kind) is tuple and isinstance(value, list):
        return tuple(value)
    if kind in (int, str, bool) and type(value) is kind:
        return value
    if kind is int and type(value) is float:
        raise ParameterError(f"The parameter '{name}' must be a whole number.")
    raise ParameterError(f"The parameter '{name}' cannot be {str(value)[:40]!r}.")


def _face_corrections(steps: list[Any]) -> FaceCorrections | None:
    """Read steps by the one reader that they have, which reads files."""
    if not steps:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / _CORRECTIONS
        path.write_text(json.dumps(steps), encoding="utf-8")
        try:
            read = read_face_corrections(path)
        except InputError as error:
            raise InputError(error.message) from error
    plain_steps = tuple(step if step.points is None else replace(step, points=replace(step.points, source=None)) for step in read.steps)
    return FaceCorrections(plain_steps)
