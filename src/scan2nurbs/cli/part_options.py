"""The stages of `segment` and `convert`: which parameters have an option, and how one `PartParams` is made of what was given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scan2nurbs.brep.part import ModelParams
from scan2nurbs.cli.config import Config, parameters
from scan2nurbs.cli.options import Given, Stage
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import ParameterError
from scan2nurbs.faces.corrections import FaceCorrections, read_face_corrections
from scan2nurbs.faces.segmentation import SegmentParams
from scan2nurbs.faces.topology import TopologyParams
from scan2nurbs.part import PartParams
from scan2nurbs.surfaces.relations import RelationParams
from scan2nurbs.surfaces.shape import KINDS, Kind


def parse_kinds(text: str) -> tuple[Kind, ...]:
    """Read types of surfaces separated by commas."""
    kinds = []
    for word in text.split(","):
        kind = next((kind for kind in KINDS if kind == word.strip()), None)
        if kind is None:
            raise ParameterError(f"The types of surfaces are {', '.join(KINDS)}. Got {word.strip()!r} instead.")
        kinds.append(kind)
    return tuple(kinds)


EDGES = Stage(section="edges", params=EdgeParams, panel="Finding edges", shown=frozenset())
SEGMENT = Stage(
    section="segment",
    params=SegmentParams,
    panel="Finding faces",
    shown=frozenset({"tolerance", "max_faces", "keep_types"}),
    parse={"keep_types": parse_kinds},
    metavars={"keep_types": "TYPE,TYPE,…"},
)
PART = Stage(
    section="part",
    params=PartParams,
    panel="Finding faces",
    shown=frozenset({"corrections"}),
    nested=frozenset({"edges", "boundary", "segment", "relation_params", "topology", "model"}),
    parse={"corrections": read_face_corrections},
    metavars={"corrections": "FILE"},
)
RELATIONS = Stage(section="relations", params=RelationParams, panel="Building the model", shown=frozenset())
TOPOLOGY = Stage(section="topology", params=TopologyParams, panel="Building the model", shown=frozenset({"fill_holes"}))
MODEL = Stage(section="model", params=ModelParams, panel="Building the model", shown=frozenset())
RELATED = Stage(
    section="part",
    params=PartParams,
    panel="Building the model",
    shown=frozenset({"relations"}),
    nested=PART.nested,
)
FACE_STAGES = (EDGES, SEGMENT, PART)
STAGES = (*FACE_STAGES, RELATED, RELATIONS, TOPOLOGY, MODEL)


def part_params(given: Given, config: Config, stages: tuple[Stage, ...]) -> PartParams:
    """Make the parameters of a run; stages that the command does not have keep their defaults."""

    def made(stage: Stage) -> Any:
        return parameters(stage, given, config, given.common.config) if stage in stages else stage.params()

    own = given.of(RELATED) if RELATED in stages else {}
    nested = {"edges": made(EDGES), "segment": made(SEGMENT), "relation_params": made(RELATIONS)}
    nested |= {"topology": made(TOPOLOGY), "model": made(MODEL)}
    return parameters(PART, given, config, given.common.config, **own, **nested)


def effective(params: PartParams, stages: tuple[Stage, ...]) -> dict[str, dict[str, Any]]:
    """Return the parameters of a command's stages by section, as a config file would hold them."""
    used = ((EDGES, params.edges), (SEGMENT, params.segment), (PART, params), (RELATIONS, params.relation_params))
    used += ((TOPOLOGY, params.topology), (MODEL, params.model))
    record = {stage.section: {key: getattr(value, key) for key in stage.names()} for stage, value in used if stage in stages}
    record["part"]["corrections"] = None if params.corrections is None else params.corrections.source
    return record


def inputs(scan: Path, given: Given, corrections: FaceCorrections | None) -> list[Path | None]:
    """Return the files that a command reads."""
    return [scan, given.common.config, None if corrections is None else corrections.source]
