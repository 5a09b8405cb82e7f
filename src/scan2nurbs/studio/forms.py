"""Forms made from the stages' parameter dataclasses: a field each, with what docstring and types say of it."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence
from typing import Any, Literal, get_args, get_origin, get_type_hints

from scan2nurbs.cloud import UNITS
from scan2nurbs.described import bare_type, describe
from scan2nurbs.studio.edits import STAGES, Json
from scan2nurbs.studio.messages import FieldKind, FormField
from scan2nurbs.surfaces.relations import RELATIONS
from scan2nurbs.surfaces.shape import KINDS

_CHOICES = {("edges", "operator"): ["auto", "crease", "one-sided", "dn", "vdn", "edn"], ("segment", "keep_types"): list(KINDS)}
_CHOICES |= {("relations", "kinds"): list(RELATIONS)}
_WHOSE = {"relations": " of relations"}  # what the names of parameters leave open where two stages share a form
_COMMON = {("edges", "operator"), ("edges", "threshold"), ("segment", "tolerance"), ("segment", "max_faces"), ("segment", "keep_types")}
_COMMON |= {("topology", "fill_holes")}
_UNITS = (("in h²", "h²"), ("in h", "h"), ("in local spacings", "spacings"), ("in degrees", "°"), ("in the cloud's unit", "unit"))
_INTERVAL = re.compile(r"must be (?:a float|a number|(an int)) in ([\[(])(-?[\d.]+), (inf|-?[\d.]+)[\])]\.(?: Got .* instead\.)?$")
_RANGE = re.compile(r"([\[(])\s*(-?[\d.]+)\s*,\s*(inf|-?[\d.]+)\s*([\])])")


def form_fields() -> list[FormField]:
    """Return the fields of all forms, in the order of the steps."""
    unit = FormField(
        stage="scan",
        name="unit",
        step="scan",
        label="Unit",
        kind="choice",
        help="Unit of the scan's coordinates. Automatic: what the file says, else millimetres.",
        unit="",
        low=None,
        high=None,
        choices=list(UNITS),
        default=None,
        automatic=True,
        common=True,
    )
    relations = dataclasses.replace(
        unit,
        stage="relations",
        name="relations",
        step="surfaces",
        label="Exact relations",
        kind="flag",
        help="Faces that are parallel, coaxial, tangent, … within their uncertainty are made so exactly.",
        choices=[],
        default=True,
        automatic=False,
    )
    made = {stage: _stage_fields(stage) for stage, (params, _) in STAGES.items() if params is not None}
    return [unit, *made["edges"], *made["segment"], relations, *made["relations"], *made["topology"], *made["model"]]


def _stage_fields(stage: str) -> list[FormField]:
    params, step = STAGES[stage]
    assert params is not None
    hints, texts = get_type_hints(params), describe(params)
    fields = []
    for field in dataclasses.fields(params):
        kind = _kind(stage, field.name, bare_type(hints[field.name]))
        text = texts.get(field.name, "")
        low, high = _range(field, text)
        fields.append(
            FormField(
                stage=stage,
                name=field.name,
                step=step,
                label=field.name.replace("_", " ").capitalize() + _WHOSE.get(stage, ""),
                kind=kind,
                help=_sentence(field.metadata.get("help") or text),
                unit=_unit(field, text),
                low=low,
                high=high,
                choices=_CHOICES.get((stage, field.name), []),
                default=field.default,
                automatic=field.default is None,
                common=(stage, field.name) in _COMMON,
            )
        )
    return fields


def _kind(stage: str, name: str, hint: Any) -> FieldKind:
    if get_origin(hint) is tuple:
        return "choices"
    if (stage, name) in _CHOICES or get_origin(hint) is Literal or get_args(hint):
        return "choice"
    kinds: dict[Any, FieldKind] = {float: "number", int: "integer", bool: "flag"}
    return kinds.get(hint, "text")


def _range(field: dataclasses.Field[Any], text: str) -> tuple[float | None, float | None]:
    """Read the range from the field's metadata, or from what the docstring says of it, such as "[6, inf)"."""
    if field.metadata.get("low") is not None:
        low, high = field.metadata["low"], field.metadata["high"]
    elif found := _RANGE.search(text):
        low, high = float(found[2]), float(found[3])
    elif found := re.search(r"(?:> |at least )([\d.]+)", text):
        low, high = float(found[1]), math.inf
    else:
        return None, None
    return low, (high if math.isfinite(high) else None)


def _unit(field: dataclasses.Field[Any], text: str) -> str:
    known = field.metadata.get("unit")
    if known is not None:
        return "°" if known == "degrees" else known
    return next((unit for words, unit in _UNITS if words in text), "")


def in_words(text: str, fields: Sequence[FormField], edit: Json) -> str:
    """Return what stages say of a parameter out of its range with labels and words in place of names and intervals.

    Parameters
    ----------
    text : str
        Such as "The 'tolerance' of segment_points must be a float in (0, inf). Got -1 instead."
    fields : sequence of FormField
        The parameters by whose labels they are called.
    edit : dict
        The edit that was refused: of parameters with one name that of its stage is meant.
    """
    said = edit.get("set")
    stage = said.get("stage") if isinstance(said, dict) else None
    labels = {field.name: field.label for field in sorted(fields, key=lambda field: field.stage == stage)}
    text = re.sub(r"The (?:parameter )?'(\w+)'(?: parameter)?(?: of \w+)?", lambda found: labels.get(found[1], found[1]), text)
    text = re.sub(r"(?<=the )'(\w+)'", lambda found: labels.get(found[1], found[1]).lower(), text)
    text = text.replace(" Got () instead.", " Choose at least one.")
    return _INTERVAL.sub(_interval_in_words, text)


def _interval_in_words(found: re.Match[str]) -> str:
    whole, opened, low, high = found.groups()
    kind = "a whole number" if whole else "a number"
    if high != "inf":
        return f"must be {kind} from {low} to {high}."
    least = f"more than {low}" if opened == "(" else f"{low} or more"
    return f"must be {kind}, {least}." if whole else f"must be {least}."


def _sentence(text: str) -> str:
    text = text.strip()
    return text if not text else text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")
