"""A whole part on one page: from a scan to its faces, their surfaces, and one CAD model of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.part import ModelParams, PartModel
from scan2nurbs.brep.write import WrittenModel
from scan2nurbs.brep.write_part import write_part
from scan2nurbs.cloud import PointCloud, PointSource, as_cloud
from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.corrections import FaceCorrections
from scan2nurbs.faces.segmentation import SegmentParams, segment_points
from scan2nurbs.faces.topology import Topology, TopologyParams, find_topology
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.part_faces import BoundaryStep, Parted, by_topology, corrected, corrected_edges, deviations
from scan2nurbs.part_readings import build_from_readings, without_dissolved, without_relations
from scan2nurbs.part_report import part_report
from scan2nurbs.ranges import require_instance
from scan2nurbs.report.colours import face_colours
from scan2nurbs.report.record import Stopwatch
from scan2nurbs.scale import Scale, measure_scale, require_surface
from scan2nurbs.surfaces.relations import Related, RelationParams, impose_relations
from scan2nurbs.surfaces.shape import Shape

Result = TypeVar("Result")

StageProgress = Callable[[str, int, int], None]
"""Called with the stage's name, how much of it is done, and how much there is."""


class StageRunner(Protocol):
    """What runs the stages of `reconstruct` one after the other, such as to keep their results and to stop between them.

    It is called with the stage's name, what the stage is given besides the results of the stages before it, and the computation. It
    returns the stage's result: that of the computation, or one that an equal computation on equal results gave before.
    """

    def __call__(self, stage: str, given: object, compute: Callable[[], Result]) -> Result:
        """Return the stage's result."""
        ...


@dataclass(frozen=True, kw_only=True)
class PartParams:
    """Parameters of `reconstruct` and `segment`: one dataclass a stage.

    Attributes
    ----------
    edges : EdgeParams
        The operator that finds edge points.
    segment : SegmentParams
        How points are grouped into faces.
    boundary : tuple of BoundaryStep
        Corrections of the edge points by hand.
    corrections : FaceCorrections, optional
        Corrections of the faces by hand; what they fit anew is of the kinds that `segment` may use, but for kinds they ask for.
    relations : bool
        Whether faces that are parallel, coaxial, tangent, … within their uncertainty are made so exactly.
    relation_params : RelationParams
        Which of these relations, and what is close enough.
    topology : TopologyParams
        How the faces' common borders are found.
    model : ModelParams
        How the CAD model is built.
    """

    edges: EdgeParams = field(default_factory=EdgeParams)
    segment: SegmentParams = field(default_factory=SegmentParams)
    boundary: tuple[BoundaryStep, ...] = ()
    corrections: FaceCorrections | None = None
    relations: bool = True
    relation_params: RelationParams = field(default_factory=RelationParams)
    topology: TopologyParams = field(default_factory=TopologyParams)
    model: ModelParams = field(default_factory=ModelParams)

    def __post_init__(self) -> None:
        """Check what the stages' own dataclasses do not."""
        for name, kind in (("edges", EdgeParams), ("segment", SegmentParams), ("topology", TopologyParams), ("model", ModelParams)):
            require_instance(getattr(self, name), name, "reconstruct", kind)
        require_instance(self.relation_params, "relation_params", "reconstruct", RelationParams)


@dataclass(frozen=True)
class Model(Parted):
    """A scan's CAD model and how it was made.

    Points and lengths are in the cloud's local frame and unit; `write` moves the model back to the input's coordinates.

    Attributes
    ----------
    related : Related or None
        The relations that hold between the faces' surfaces; None where none were wanted.
    topology : Topology
        Which faces meet, along which borders; its faces come first in `faces`, those that found no place in it last.
    part : PartModel
        The CAD model.
    deviation : (N,) float64
        Signed distance of each of the cloud's points from its face's surface, positive outside the body; NaN where it has no face.
    report : dict
        All figures, as they stand in the JSON.
    """

    related: Related | None
    topology: Topology
    part: PartModel
    deviation: NDArray[np.float64]
    report: dict[str, Any]

    @property
    def surfaces(self) -> tuple[Shape, ...]:
        """One shape a face, such as a Plane or a Cylinder."""
        return tuple(fit.shape for fit in self.faces.fits)

    def write(self, path: str | os.PathLike[str], *, schema: str = "AP242") -> WrittenModel:
        """Write the model to a STEP, IGES, BREP, 3DM or mesh file, by its suffix, in the input's unit and coordinates.

        Raises
        ------
        OutputError
            If the file cannot be written, or not be read again; nothing is left then. How what is read differs from what was written is in
            the notes.
        """
        return write_part(
            path,
            self.part,
            unit=self.cloud.unit,
            name=Path(self.cloud.source).stem,
            schema=schema,
            origin=self.cloud.origin,
            names=self.names,
            colours=[(r, g, b) for r, g, b in face_colours(len(self.part.faces)).tolist()],
        )


def reconstruct(
    source: PointSource,
    params: PartParams | None = None,
    *,
    unit: str | None = None,
    progress: StageProgress | None = None,
    run: StageRunner | None = None,
) -> Model:
    """Reconstruct a whole part: edges, faces, surfaces, relations, topology, CAD model.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    params : PartParams, optional
        By default everything is chosen from the cloud.
    unit : str, optional
        Overrides what the file says.
    progress : callable, optional
        Called with (stage, done, total) as the stages go on.
    run : StageRunner, optional
        Runs the stages; by default each is computed.

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    NoResultError
        If the points lie on no surface, or no face is found among them.
    """
    params = params or PartParams()
    require_instance(params, "params", "reconstruct", PartParams)
    watch = Stopwatch()
    parted = part_scan(source, params, unit=unit, progress=progress, watch=watch, run=run)
    do = _runner(watch, run)
    points, scale, faces = parted.cloud.points, parted.scale, parted.faces
    related, unrelated = None, faces.fits
    if params.relations:
        given = params.relation_params
        related = do(
            "relations",
            given,
            lambda: impose_relations(points, faces.label, faces.fits, noise=scale.noise, h=scale.h, smooth=faces.smooth, params=given),
        )
        parted = replace(parted, faces=replace(faces, fits=related.fits))
    fits = parted.faces.fits
    topology = do(
        "topology",
        (params.relations, params.topology),
        lambda: find_topology(points, faces.label, fits, scale, params.topology, _stage(progress, "finding borders")),
    )
    tell = _stage(progress, "building the model")
    read = do(
        "model",
        params.model,
        lambda: build_from_readings(points, faces.label, fits, unrelated, topology, scale, params.topology, params.model, tell),
    )
    if related is not None:
        related = without_relations(related, read, parted.names)
    parted = without_dissolved(replace(parted, faces=replace(parted.faces, fits=read.fits)), read)
    parted = by_topology(parted, read.topology)
    deviation = deviations(points, parted.faces.label, parted.faces.fits, read.topology.outward)
    model = Model(**vars(parted), related=related, topology=read.topology, part=read.part, deviation=deviation, report={})
    return replace(model, report=part_report(model, params, watch.seconds))


def part_scan(
    source: PointSource,
    params: PartParams | None = None,
    *,
    unit: str | None = None,
    progress: StageProgress | None = None,
    watch: Stopwatch | None = None,
    run: StageRunner | None = None,
) -> Parted:
    """Part a scan into faces: edges, faces, corrections by hand.

    Parameters
    ----------
    source : path, (N, 3) array-like, PointCloud or object with ``.points``
        The scan.
    params : PartParams, optional
        By default everything is chosen from the cloud.
    unit : str, optional
        Overrides what the file says.
    progress : callable, optional
        Called with (stage, done, total) as the stages go on.
    watch : Stopwatch, optional
        Times the stages.
    run : StageRunner, optional
        Runs the stages; by default each is computed.

    Raises
    ------
    InputError
        If the source cannot be read or has fewer than three distinct points.
    NoResultError
        If the points lie on no surface, or no face is found among them.
    """
    params, watch = params or PartParams(), watch or Stopwatch()
    require_instance(params, "params", "segment", PartParams)
    do = _runner(watch, run)
    cloud = do("read", (str(source), unit), lambda: as_cloud(source, unit))
    scale = do("scale", None, lambda: _measured(cloud, progress))
    edges = do("edges", params.edges, lambda: detect(cloud.points, scale, params.edges, _stage(progress, "finding edges")))
    detected = edges
    if params.boundary:
        edges = do("boundary", params.boundary, lambda: corrected_edges(cloud, edges, params.boundary))
    tell = _stage(progress, "finding faces")
    faces = do("faces", params.segment, lambda: segment_points(cloud.points, scale, edges, params.segment, tell))
    parted = Parted(cloud, scale, edges, faces, np.arange(len(faces.fits), dtype=np.int32), len(faces.fits))
    corrections = params.corrections
    if corrections is not None:
        found = replace(parted, edges=detected)  # what is kept of it does not follow from which points were marked by hand
        parted = replace(do("corrections", corrections, lambda: corrected(found, corrections, params.segment.kinds)), edges=edges)
    if not parted.faces.fits and faces.fits:
        raise NoResultError("No face is left: corrections by hand deleted them all. Undo one of them, or take it out of the corrections.")
    if not parted.faces.fits:
        raise NoResultError("No face was found: no part of the scan is smooth over more than a few points.")
    return parted


def _runner(watch: Stopwatch, run: StageRunner | None) -> StageRunner:
    """Time every stage, and let `run` decide whether it is computed."""

    def do(stage: str, given: object, compute: Callable[[], Result]) -> Result:
        with watch(stage):
            return compute() if run is None else run(stage, given, compute)

    return do


def _measured(cloud: PointCloud, progress: StageProgress | None) -> Scale:
    scale = measure_scale(cloud.points, progress=_stage(progress, "measuring"))
    require_surface(scale)
    return scale


def _stage(progress: StageProgress | None, name: str) -> Progress | None:
    return None if progress is None else lambda done, total: progress(name, done, total)
