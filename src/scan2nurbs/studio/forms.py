"""Forms made from the stages' parameter dataclasses: a field each, with what docstring and types say of it."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any, Literal, get_args, get_origin, get_type_hints

from scan2nurbs.cloud import UNITS
from scan2nurbs.described import bare_type, describe
from scan2nurbs.studio.edits import STAGES
from scan2nurbs.studio.messages import FieldKind, FormField
from scan2nurbs.surfaces.relations import RELATIONS
from scan2nurbs.surfaces.shape import KINDS

_CHOICES = {("edges", "operator"): ["auto", "crease", "one-sided", "dn", "vdn", "edn"], ("segment", "keep_types"): list(KINDS)}
_CHOICES |= {("relations", "kinds"): list(RELATIONS)}
_WHOSE = {"relations": " of relations"}  # what the names of parameters leave open where two stages share a form
_COMMON = {("edges", "operator"), ("edges", "threshold"), ("segment", "tolerance"), ("segment", "max_faces"), ("segment", "keep_types")}
_COMMON |= {("topology", "fill_holes")}
_UNITS = (("in h²", "h²"), ("in h", "h"), ("in local spacings", "spacings"), ("in degrees", "°"), ("in the cloud's unit", "unit"))
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


def _sentence(text: str) -> str:
    text = text.strip()
    return text if not text else text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")
