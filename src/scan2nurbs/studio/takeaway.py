"""What can be taken away: the model in several formats, labelled points, the report."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from scan2nurbs.errors import ParameterError
from scan2nurbs.io.atomic import atomic_path
from scan2nurbs.part import Model, PartParams
from scan2nurbs.part_files import part_facts, part_record, write_deviations
from scan2nurbs.report.record import peak_memory_mb, plain, versions
from scan2nurbs.studio.edits import Json, describe_edit, step_of
from scan2nurbs.studio.messages import ExportKind

_KINDS = (
    ("step", ".step", "STEP, the CAD model (AP242)"),
    ("step-ap214", ".ap214.step", "STEP for older systems (AP214)"),
    ("iges", ".iges", "IGES, the CAD model"),
    ("3dm", ".3dm", "3DM, for Rhino"),
    ("brep", ".brep", "BREP, for OpenCASCADE"),
    ("stl", ".stl", "STL, the model as triangles"),
    ("points", ".points.ply", "Labelled points: strength, edge, face, deviation"),
    ("report", ".html", "The report, one page with pictures"),
)


def export_kinds() -> list[ExportKind]:
    """Return the formats; that of Rhino needs an extra."""
    made = []
    for name, suffix, text in _KINDS:
        available = name != "3dm" or find_spec("rhino3dm") is not None
        hint = "" if available else " (needs pip install 'scan2nurbs[rhino]')"
        made.append(ExportKind(name=name, suffix=suffix, text=text + hint, available=available))
    return made


def export_name(kind: str, scan: Path) -> str:
    """Return the name of an exported file.

    Raises
    ------
    ParameterError
        If there is no such kind, or its library is missing.
    """
    known = {entry.name: entry for entry in export_kinds()}
    if kind not in known or not known[kind].available:
        raise ParameterError(f"There is no export {kind!r}; known are {', '.join(name for name in known if known[name].available)}.")
    return scan.stem + known[kind].suffix


def take_away(model: Model, params: PartParams, kind: str, path: Path, edits: Sequence[Json] = ()) -> None:
    """Write a file, whole or not at all.

    Parameters
    ----------
    model : Model
    params : PartParams
    kind : str
        One of `export_kinds`.
    path : Path
    edits : sequence of dict
        What was done, for the report.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    if kind == "points":
        write_deviations(path, model)
    elif kind == "report":
        _write_report(path, model, params, edits)
    else:
        model.write(path, schema="AP214" if kind == "step-ap214" else "AP242")


def _write_report(path: Path, model: Model, params: PartParams, edits: Sequence[Json]) -> None:
    from scan2nurbs.part_pictures import part_pictures  # noqa: PLC0415 - brings matplotlib
    from scan2nurbs.report.html import render_html  # noqa: PLC0415

    sections = {name: getattr(params, name) for name in ("edges", "segment", "topology", "model")}
    sections |= {"part": {"relations": params.relations, "corrections": params.corrections}, "relations": params.relation_params}
    record = part_record(model, plain(sections))
    by_hand = [edit for edit in edits if "set" not in edit]
    if by_hand:
        record["done_by_hand"] = [{"step": step_of(edit).capitalize(), "what": describe_edit(edit)} for edit in by_hand]
    record = {"schema": "scan2nurbs/convert/1", **record, "outputs": [path], "peak_memory_mb": peak_memory_mb(), "versions": versions()}
    with atomic_path(path) as temporary:
        temporary.write_text(render_html(record, part_pictures(model), part_facts(model)), encoding="utf-8")
