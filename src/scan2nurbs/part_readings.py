"""A part's model from that reading of its borders that closes it: where faces do not fit their neighbours, all is read once more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.known import Known
from scan2nurbs.brep.part import ModelParams, PartModel, build_part
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.dissolve import Dissolved, dissolve
from scan2nurbs.faces.topology import Topology, TopologyParams, find_topology
from scan2nurbs.kernels.runner import Progress
from scan2nurbs.part_faces import Parted
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.relations import Related
from scan2nurbs.surfaces.shape_fit import ShapeFit

READINGS = 3
"""Most readings of a part."""
_SOME = 4
"""Where more faces than these do not fit their neighbours, another reading does not help: their surfaces are wrong."""
_BENT = 0.4
"""So it is where a larger share of all faces had to be bent."""
_COVERED = 0.95
"""Where a model covers less of the scan than this, a surface is missing, or is on the wrong side of its borders."""
_WIDER = 2.0
"""Where a face does not fit its neighbours, tolerances may be so many times as wide: better than an open part."""
_GIVEN_UP = 2
"""How often faces that fit nowhere are given up: what closes one place may show that another does not fit."""
_SMALL = 0.1
"""Faces of less than this share of the area are spanned, where that closes the part, rather than read again."""
_WAYS = 2
"""How many readings are tried for whether surfaces between the edges of their neighbours can take the place of faces that do not fit;
one of them where another reading does not help."""
_LESS = 0.02
"""How much more of the scan a model has to cover to be the better one for it, closed or not."""

_LEFT_OPEN = "The holes in the data could not be closed by extending the surfaces around them: they were left open."


@dataclass(frozen=True)
class Reading:
    """A part as one reading of its borders gives it.

    Attributes
    ----------
    part : PartModel
    topology : Topology
    fits : tuple of ShapeFit
        The surfaces it was built of.
    released : frozenset of int
        Faces, as the fits are numbered, whose surfaces were taken as they were before relations were imposed.
    dissolved : Dissolved, optional
        The faces of the points, where some were given up.
    """

    part: PartModel
    topology: Topology
    fits: tuple[ShapeFit, ...]
    released: frozenset[int] = frozenset()
    dissolved: Dissolved | None = None

    @property
    def misfits(self) -> list[int]:
        """The topology's faces that do not share their edges with their neighbours."""
        return [f for f, face in enumerate(self.part.faces) if face.trimmed in ("alone", "lost")]

    @property
    def apart(self) -> float:
        """The share of the area that these have."""
        area = self.topology.areas
        return float(area[self.misfits].sum() / area.sum())

    @property
    def fits_together(self) -> bool:
        """Whether there is nothing that another reading might do better: an open scan is not closed by reading it again."""
        part = self.part
        return part.valid and part.coverage >= _COVERED and part.joined and (part.closed or not self.misfits)

    @property
    def worth_another(self) -> bool:
        """Whether another reading may help, and it is not the surfaces that are wrong."""
        bent = sum(face.trimmed == "bent" for face in self.part.faces)
        return len(self.misfits) <= _SOME and bent <= _BENT * len(self.part.faces)

    def betters(self, other: Reading) -> bool:
        """Tell whether this is the better model of the two."""
        mine, its = self.part, other.part
        if mine.valid != its.valid:
            return mine.valid
        if abs(mine.coverage - its.coverage) > _LESS:
            return mine.coverage > its.coverage
        mine_fits, its_fit = (mine.closed, mine.joined, -len(self.misfits)), (its.closed, its.joined, -len(other.misfits))
        return (*mine_fits, -mine.n_free_edges) > (*its_fit, -its.n_free_edges)


def build_from_readings(
    points: NDArray[np.float64],
    label: NDArray[np.int32],
    fits: Sequence[ShapeFit],
    unrelated: Sequence[ShapeFit],
    topology: Topology,
    scale: Scale,
    topology_params: TopologyParams,
    params: ModelParams,
    progress: Progress | None = None,
) -> Reading:
    """Build the model of a part; where a face does not fit its neighbours, read the borders again and take the best of the models.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Face of each point, −1 for none.
    fits, unrelated : sequence of ShapeFit
        The surface of each face, under its relations and before any were imposed.
    topology : Topology
        The first reading.
    scale : Scale
    topology_params, params : TopologyParams, ModelParams
    progress : callable, optional

    Raises
    ------
    NoResultError
        If no face could be made at all.

    Notes
    -----
    Where a border runs within the spacing of the points is chance, and now and then chance draws one that no face can be trimmed by. Each
    further reading leaves out another tenth of the points, so that its borders are others. A surface that a relation has moved may
    also have been moved off a neighbour that the relation does not know of: around what does not fit, relations are given up, in the
    last reading all of them. Before that, wider tolerances are tried, which hold from then on. Readings give way in turns in one of two
    ways where a face does not fit. What is left open then by faces that lie as close to their neighbours' surfaces as points do that belong
    to them, is closed without these, if it can be; and else by surfaces between the edges of their neighbours, which is also what small
    faces get at once where that closes the part, and else after two readings. Where holes in the data were to be filled, and the part is
    not closed all the same, a model that leaves them open is taken if it is the better one. Deterministic.
    """
    reader = _Reader(points, label, tuple(fits), tuple(unrelated), scale, params, progress)
    found = reader.read(topology, topology_params)
    if not topology_params.fill_holes or found.part.closed:
        return found
    as_they_are = replace(topology_params, fill_holes=False)
    try:
        left_open = reader.read(find_topology(points, label, fits, scale, as_they_are), as_they_are)
    except NoResultError:
        return found
    if not left_open.betters(found):
        return found
    return replace(left_open, part=replace(left_open.part, notes=(*left_open.part.notes, _LEFT_OPEN)))


@dataclass(frozen=True)
class _Reader:
    """What all readings of a part have in common; the fields are the parameters of `build_from_readings`."""

    points: NDArray[np.float64]
    label: NDArray[np.int32]
    fits: tuple[ShapeFit, ...]
    unrelated: tuple[ShapeFit, ...]
    scale: Scale
    params: ModelParams
    progress: Progress | None

    def read(self, topology: Topology, topology_params: TopologyParams) -> Reading:
        """Return the best of the readings of a part, as `build_from_readings` tells."""
        params, known = self.params, Known()
        build = partial(build_part, self.points, scale=self.scale, progress=self.progress, spanned=_SMALL)
        best = last = Reading(build(self.fits, topology, params=params, known=known), topology, self.fits)
        related = frozenset(f for f, fit in enumerate(self.fits) if fit is not self.unrelated[f])
        ways: list[tuple[Reading, Callable[..., PartModel]]] = []
        if not best.fits_together:
            params = replace(params, bearable=_WIDER * params.bearable)
            for other_way in (True, False):
                way = partial(build, self.fits, topology, params=params, known=known, other_way=other_way)
                if other_way:
                    last = replace(best, part=way())
                    best = last if last.betters(best) else best
                ways.append((last, way))
        for turn in range(1, READINGS):
            if best.fits_together or not best.worth_another or (turn > 1 and 0.0 < best.apart < _SMALL):
                break
            released = (last.released | _around(last)) & related if turn < READINGS - 1 else related
            use = tuple(self.unrelated[f] if f in released else fit for f, fit in enumerate(self.fits))
            try:
                again = find_topology(self.points, self.label, use, self.scale, topology_params, reading=turn)
                # Triangles are what some faces fail for. Bent surfaces are not asked for fine ones: that may take minutes.
                fine = all(face.trimmed != "bent" for face in last.part.faces)
                way = partial(build, use, again, params=params, fine=fine, other_way=turn % 2 == 1)
                last = Reading(way(), again, use, released)
            except NoResultError:
                continue
            ways.append((last, way))
            best = last if last.betters(best) else best
        if not best.fits_together and best.worth_another:
            best = self._dissolved(best, topology_params, params)
        return best if best.fits_together else _spanned(best, ways)

    def _dissolved(self, best: Reading, topology_params: TopologyParams, params: ModelParams) -> Reading:
        """Return a model without small faces that fit nowhere, if that closes it; else the best one that there was."""
        label, last, gone, off = self.label, best, frozenset[int](), 0.0
        shapes = [fit.shape for fit in best.fits]
        for _ in range(_GIVEN_UP):
            reach = params.reach * self.scale.h + 3.0 * self.scale.noise
            given = dissolve(self.points, label, shapes, last.topology, last.misfits, reach)
            if given is None:
                break
            label, gone, off = given.label, gone.union(given.faces), max(off, given.off)
            try:
                topology = find_topology(self.points, label, best.fits, self.scale, topology_params)
                part = build_part(self.points, best.fits, topology, self.scale, params)
            except NoResultError:
                break
            last = Reading(part, topology, best.fits, best.released, Dissolved(label, tuple(sorted(gone)), off))
            if last.fits_together and last.betters(best):
                return last
        return best


def _spanned(best: Reading, ways: Sequence[tuple[Reading, Callable[..., PartModel]]]) -> Reading:
    """Return a reading in which surfaces between their neighbours take the place of faces that do not fit, if one is better so."""
    rank = {id(reading): len(reading.misfits) + (reading is not best) for reading, _ in ways}
    most = _WAYS if best.worth_another else 1
    for reading, way in sorted(ways, key=lambda given: rank[id(given[0])])[:most]:
        made = replace(reading, part=way(spanned=1.0))
        if made.betters(best):
            best = made
        if best.fits_together:
            break
    return best


def without_dissolved(parted: Parted, reading: Reading) -> Parted:
    """Return the faces with the points that a reading gave to others, and say so."""
    gone = reading.dissolved
    if gone is None:
        return parted
    names = " and ".join(parted.names[f] for f in gone.faces)
    they, their, were = ("they", "their", "were") if len(gone.faces) > 1 else ("it", "its", "was")
    note = (
        f"{names} {were} given up, since {they} could not be trimmed between {their} neighbours, which have {their} points now: "
        f"95 % of these lie within {gone.off:.3g} of the neighbours' surfaces."
    )
    faces = parted.faces
    return replace(parted, faces=replace(faces, label=gone.label, notes=(*faces.notes, note)))


def without_relations(related: Related, reading: Reading, names: Sequence[str]) -> Related:
    """Return the relations that hold in a reading, and say what was given up."""
    gone = () if reading.dissolved is None else reading.dissolved.faces
    relations = tuple(relation for relation in related.relations if not set(gone).intersection(relation.faces))
    kept = tuple(relation for relation in relations if not reading.released.intersection(relation.faces))
    if len(kept) == len(relations):
        return replace(related, fits=reading.fits, relations=kept)
    lost = len(relations) - len(kept)
    given_up = ", ".join(names[f] for f in sorted(reading.released))
    note = f"{lost} relations of {given_up} were given up, since with them a face did not fit its neighbours."
    return Related(reading.fits, kept, (*related.notes, note))


def _around(reading: Reading) -> frozenset[int]:
    """Return the surfaces of the faces that do not fit, and of their neighbours."""
    misfits = set(reading.misfits)
    near = misfits | {f for border in reading.topology.borders for f in border.faces if f >= 0 and misfits.intersection(border.faces)}
    return frozenset(int(reading.topology.source[f]) for f in near)
