"""A whole part: faces trimmed along shared edges, shells and solids, checked and measured against the scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.attempts import ATTEMPTS, TOO_WIDE, Attempt, trim_part, without_tips
from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.check import check, is_valid, is_valid_meshed
from scan2nurbs.brep.deviation import deviation
from scan2nurbs.brep.face import kernel_scale
from scan2nurbs.brep.join import OUTLINED, Spanning, Surroundings, join_faces
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.measure import area, tolerance, volume
from scan2nurbs.brep.occ import silence
from scan2nurbs.brep.room import Room, on_its_own, size_of
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.topology import Fitted, Topology
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.ranges import require_float
from scan2nurbs.scale import Scale

Floats = NDArray[np.float64]

_TOO_LARGE = "It would reach far beyond its points"
_TOO_SMALL = "It would leave out a part of its points"


@dataclass(frozen=True, kw_only=True)
class ModelParams:
    """How a part is built.

    Attributes
    ----------
    widest : float
        Tolerance of an edge, in h, (0, inf), above which its border is laid anew, closer to the points, and listed if that does not help.
    bearable : float
        Tolerance of an edge, in h, (0, inf), above which one of its faces leaves its neighbours and gets an outline of its own.
    reach : float
        Distance, in h and beyond three times the noise, up to which points and model belong together, (0, inf).
    """

    widest: float = 0.5
    bearable: float = 0.5
    reach: float = 1.0

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("widest", "bearable", "reach"):
            require_float(getattr(self, name), name, "build_part", 0)


@dataclass(frozen=True)
class PartFace:
    """A face of the model.

    Attributes
    ----------
    number : int
        Of its surface among the fits; faces whose points fall apart have one surface.
    kind : str
        Of its surface.
    shapes : tuple of TopoDS_Face
        Usually one; several where the face consists of pieces that do not touch; none where it was lost.
    trimmed : {"shared", "followed", "bent", "covered", "alone", "lost"}
        By edges shared with its neighbours; by shared edges that follow the borders' points, or that its surface was bent to; not itself,
        since a neighbour's surface covers its points; by its own outline; not at all.
    """

    number: int
    kind: str
    shapes: tuple[Any, ...] = field(repr=False)
    trimmed: str


@dataclass(frozen=True)
class PartEdge:
    """An edge between two faces, or at a free border.

    Attributes
    ----------
    faces : (int, int)
        Left and right, seen from outside; -1 where the scan ends.
    kind : {"line", "circle", "spline"}
    mode : {"crossing", "contact", "middle"}
        How the two surfaces meet.
    gap : float
        Largest distance of the edge to its surfaces, in the cloud's unit.
    angle : float
        Median angle between the surfaces, in degrees; 180 at a free border.
    length : float
    points : (K, 3) float64
        Places along it.
    """

    faces: tuple[int, int]
    kind: str
    mode: str
    gap: float
    angle: float
    length: float
    points: Floats = field(repr=False)


@dataclass(frozen=True)
class PartModel:
    """A part as an object of the CAD kernel, and what is known about it.

    Attributes
    ----------
    shape : TopoDS_Shape
        A solid, a shell, or a compound of them; its lengths are the cloud's times `kernel_scale`.
    kernel_scale : float
    faces : tuple of PartFace
    edges : tuple of PartEdge
    valid, closed : bool
        Valid by the kernel's own analysis, triangulated, too; closed if every edge has two faces, in shells.
    joined : bool
        Whether faces that share edges are joined to shells; not where the kernel finds these invalid.
    n_free_edges, n_solids : int
    max_tolerance : float
        In the cloud's unit.
    coverage, precision, rms : float
        As in `Deviation`.
    notes : tuple of str
        What fell back, one sentence each.
    """

    shape: Any = field(repr=False)
    kernel_scale: float
    faces: tuple[PartFace, ...]
    edges: tuple[PartEdge, ...]
    valid: bool
    closed: bool
    joined: bool
    n_free_edges: int
    n_solids: int
    max_tolerance: float
    coverage: float
    precision: float
    rms: float
    notes: tuple[str, ...]

    @property
    def n_apart(self) -> int:
        """How many faces do not share their edges with their neighbours."""
        return sum(face.trimmed in ("alone", "lost") for face in self.faces)

    @cached_property
    def areas(self) -> tuple[float, ...]:
        """The area of each face, in the cloud's unit squared; found when it is asked for, since it takes long where surfaces are bent."""
        return tuple(sum(map(area, face.shapes)) / self.kernel_scale**2 for face in self.faces)

    @property
    def area(self) -> float:
        """The area of all faces, in the cloud's unit squared."""
        return sum(self.areas)

    @cached_property
    def volume(self) -> float:
        """The volume, in the cloud's unit cubed; 0 for a part that is open."""
        return abs(volume(self.shape)) / self.kernel_scale**3 if self.closed else 0.0


def build_part(
    points: Floats,
    fits: Sequence[Fitted],
    topology: Topology,
    scale: Scale,
    params: ModelParams | None = None,
    progress: Progress | None = None,
    *,
    known: Known | None = None,
    fine: bool = False,
    other_way: bool = False,
    spanned: float = 0.0,
) -> PartModel:
    """Build the model of a part from its surfaces and from how they meet.

    Parameters
    ----------
    points : (N, 3) float64
        The cloud's points, against which the model is measured.
    fits : sequence of ShapeFit
        The surface of each face.
    topology : Topology
        Borders, vertices and loops.
    scale : Scale
    params : ModelParams, optional
    progress : callable, optional
    known : Known, optional
        What was computed for this very topology and these surfaces before.
    fine : bool
        Whether each face must have fine triangles as well as coarse ones to count as trimmed: that takes longer, and now and then it
        is what keeps a face with its neighbours.
    other_way : bool
        As in `trim_part`: one of two ways to give way where faces do not fit.
    spanned : float
        Which share of the part's area, [0, 1], faces may have that do not fit and that surfaces between the edges of their neighbours take
        the place of; 1 where these are taken even if they do not close the part.

    Raises
    ------
    NoResultError
        If no face could be made at all.
    """
    silence()
    params = params or ModelParams()
    if not len(fits):
        raise NoResultError("There is no face to build a model of.")
    factor = kernel_scale(float(np.linalg.norm(np.ptp(points, axis=0))))
    tell = progress or (lambda _done, _total: None)
    known, shapes = known or Known(), [fits[k].shape for k in topology.source]
    trimmed, notes = trim_part(shapes, topology, scale.h, factor, params.widest, params.bearable, tell, known, fine, other_way)
    model, unseen = _model(points, trimmed, shapes, scale, factor, params, notes, spanned)
    again = without_tips(trimmed, unseen, scale.h, factor, params.bearable, known, fine) if unseen else None
    if again is not None:
        other, _ = _model(points, again, shapes, scale, factor, params, notes, spanned)
        model = other if other.valid and other.n_apart < model.n_apart else model
    tell(ATTEMPTS, ATTEMPTS)
    return model


def _completed(
    trimmed: Attempt, shapes: list[Any], h: float, factor: float, params: ModelParams, notes: list[str]
) -> tuple[list[tuple[Any, ...]], list[str]]:
    """Give faces that failed an outline of their own."""
    made, caution, topology = trimmed.made, trimmed.caution, trimmed.topology
    faces, how = list(made.faces), []
    for f in range(len(shapes)):
        room = Room.of(topology, f, h, factor)
        why_not = made.failures.get(f, _TOO_LARGE if room.is_left_by(faces[f]) else "")
        why_not = why_not or (_TOO_SMALL if size_of(faces[f], factor) < room.least else "")
        why_not = why_not or _spoilt(faces[f], params.bearable * h * factor)
        if not why_not:
            borders = {k for loop in topology.loops[f] for k, _ in loop}
            how.append("bent" if f in trimmed.bent else "followed" if any(caution[k] for k in borders) else "shared")
            continue
        faces[f] = on_its_own(f, shapes[f], topology, h, factor, room)
        how.append("alone" if faces[f] else "lost")
        why = f"Face {f + 1} ({shapes[f].kind}) does not fit its neighbours ({why_not.rstrip('.')}): "
        notes.append(why + (OUTLINED if faces[f] else "it could not be made."))
    return faces, how


def _spoilt(pieces: tuple[Any, ...], widest: float) -> str:
    """Say what is wrong with a face now that all its neighbours are made: they share edges, and may have widened them."""
    if max(map(tolerance, pieces), default=0.0) > widest:
        return TOO_WIDE
    return "" if all(is_valid(face) and is_valid_meshed(face) for face in pieces) else "Its neighbours spoil its edges"


def _model(
    points: Floats,
    trimmed: Attempt,
    unbent: list[Any],
    scale: Scale,
    factor: float,
    params: ModelParams,
    notes: Sequence[str],
    spanned: float,
) -> tuple[PartModel, tuple[int, ...]]:
    """Return the model of faces that were trimmed, and those that had to leave it since they would be lost where it is shown."""
    notes, shapes, topology = list(notes), trimmed.shapes, trimmed.topology
    faces, how = _completed(trimmed, unbent, scale.h, factor, params, notes)
    around = Surroundings(shapes, topology, scale.h, factor)
    joined = join_faces(faces, how, around, params.widest, notes, Spanning(spanned, params.bearable))
    faces, how, whole = joined.faces, joined.how, joined.whole
    found = check(whole.shape, whole.sound)
    measured = deviation(whole.shape, points, h=scale.h, reach=params.reach * scale.h + 3.0 * scale.noise, scale=factor)
    model = PartModel(
        shape=whole.shape,
        kernel_scale=factor,
        faces=tuple(PartFace(int(topology.source[f]), shapes[f].kind, pieces, how[f]) for f, pieces in enumerate(faces)),
        edges=tuple(_edge(curve) for curve in trimmed.made.curves),
        valid=found.valid,
        closed=found.closed and whole.joined,
        joined=whole.joined,
        n_free_edges=whole.n_free_edges,
        n_solids=whole.n_solids,
        max_tolerance=found.max_tolerance / factor,
        coverage=measured.coverage,
        precision=measured.precision,
        rms=measured.rms,
        notes=tuple(notes),
    )
    return model, joined.unseen


def _edge(curve: BorderCurve) -> PartEdge:
    points = curve.curve(curve.curve.samples(64))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return PartEdge(curve.faces, curve.curve.kind, curve.mode, curve.gap, curve.angle, length, points)
