"""The faces of a part on their way through the stages: numbered, corrected by hand, put into the order of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.cloud import PointCloud
from scan2nurbs.edges.corrections import Selection
from scan2nurbs.edges.detect import Edges
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.corrections import FaceCorrections, Numbered, apply_face_corrections
from scan2nurbs.faces.segmentation import Faces
from scan2nurbs.faces.topology import Topology
from scan2nurbs.scale import Scale
from scan2nurbs.surfaces.shape import KINDS, Kind
from scan2nurbs.surfaces.shape_fit import ShapeFit, choose_shape, fit_shape
from scan2nurbs.surfaces.within import fit_within


@dataclass(frozen=True)
class Parted:
    """A scan, parted into faces.

    Attributes
    ----------
    cloud : PointCloud
        The points, their unit and origin.
    scale : Scale
        Spacing and noise.
    edges : Edges
        Points on edges, in the cloud's order.
    faces : Faces
        The face of each of the cloud's points, and the faces' surfaces.
    numbers : (F,) int32
        The number by which each face goes in files and reports; 0, 1, 2, … unless corrections removed some.
    free : int
        The first number that no face ever had.
    """

    cloud: PointCloud
    scale: Scale
    edges: Edges
    faces: Faces
    numbers: NDArray[np.int32]
    free: int

    @property
    def label(self) -> NDArray[np.int32]:
        """The face's number for every row of the input; −1 for none."""
        numbers = np.append(self.numbers, np.int32(-1))  # label −1 takes the last
        return self.cloud.to_rows(numbers[self.faces.label], -1)

    @property
    def names(self) -> list[str]:
        """A name a face: its type and number."""
        return [f"{fit.shape.kind}_{number}" for fit, number in zip(self.faces.fits, self.numbers, strict=True)]


@dataclass(frozen=True)
class BoundaryStep:
    """One correction of edge points by hand: the points of a selection are added to them, or dropped from them."""

    action: Literal["add", "drop"]
    points: Selection


def corrected_edges(cloud: PointCloud, edges: Edges, steps: tuple[BoundaryStep, ...]) -> Edges:
    """Do corrections of edge points by hand, in their order."""
    mask = edges.mask.copy()
    for step in steps:
        mask[_selected(cloud, step.points)] = step.action == "add"
    return replace(edges, mask=mask)


def _selected(cloud: PointCloud, selection: Selection) -> NDArray[np.bool_]:
    """Tell which of the cloud's points a selection of the input's rows names; where rows coincide, naming one of them is enough."""
    chosen = np.zeros(len(cloud.points), np.bool_)
    rows = cloud.rows[selection.of(cloud.to_rows(cloud.points + cloud.origin, np.nan))]
    chosen[rows[rows >= 0]] = True
    return chosen


def corrected(parted: Parted, corrections: FaceCorrections, kinds: Sequence[Kind] = KINDS) -> Parted:
    """Do corrections by hand; faces whose points, kind or tolerance they change are fitted anew.

    Parameters
    ----------
    parted : Parted
    corrections : FaceCorrections
    kinds : sequence of str
        Kinds of surfaces that such faces may have. The kind that a correction asks for need not be among them: what is said of one face
        alone outweighs what is said of all.

    Raises
    ------
    InputError
        If a correction cannot be done.
    NoResultError
        If no surface can be fitted to a face; the sentence says to which.
    """
    cloud, faces = parted.cloud, parted.faces
    done = apply_face_corrections(faces.label, corrections, lambda selection: _selected(cloud, selection))
    numbers = np.unique(done.label[done.label >= 0])
    label = np.where(done.label >= 0, np.searchsorted(numbers, done.label), -1).astype(np.int32)
    fits = []
    for number in numbers.tolist():
        anew = number in done.changed or number in done.forced or number in done.tolerances
        fits.append(_fitted(parted, done, number, kinds) if anew else faces.fits[number])
    index = {number: k for k, number in enumerate(numbers.tolist())}
    smooth = frozenset((index[i], index[j]) for i, j in faces.smooth if i in index and j in index)
    done_faces = replace(faces, label=label, fits=tuple(fits), smooth=smooth)
    return replace(parted, faces=done_faces, numbers=numbers.astype(np.int32), free=done.free)


def _fitted(parted: Parted, done: Numbered, number: int, kinds: Sequence[Kind]) -> ShapeFit:
    """Fit a surface to a face as corrections have it."""
    points, noise, kind = parted.cloud.points[done.label == number], parted.scale.noise, done.forced.get(number)
    try:
        if number in done.tolerances:
            return fit_within(points, noise=noise, tolerance=done.tolerances[number], kind=kind, kinds=kinds)
        return choose_shape(points, noise=noise, kinds=kinds) if kind is None else fit_shape(kind, points, noise=noise)
    except NoResultError as error:
        wanted = kind or (" or ".join(kinds) if len(kinds) < len(KINDS) else "surface")
        raise NoResultError(f"Face {number} cannot be a {wanted}: {error} Choose another type for it.") from error


def by_topology(parted: Parted, topology: Topology) -> Parted:
    """Put the faces into the order of the topology, which may have parted some and lost some.

    Of a face that fell apart the largest piece keeps the number, by which corrections know them all; the others get numbers that no face
    ever had, and a note. Its points go to the nearest piece. Faces that have no points are left out.
    """
    cloud, faces = parted.cloud, parted.faces
    source = topology.source
    lost = np.setdiff1d(np.unique(faces.label[faces.label >= 0]), source)
    area = topology.areas
    numbers = np.append(parted.numbers[source], parted.numbers[lost])
    label = np.full(len(faces.fits) + 1, -1, np.int32)  # the last stands for no face
    label[lost] = len(source) + np.arange(len(lost))
    label[source] = np.arange(len(source))
    label = label[faces.label]
    free, pieces_of = parted.free, dict[int, int]()
    corners = topology.mesh.vertices[topology.mesh.triangles].mean(axis=1)
    for whole in np.flatnonzero(np.bincount(source) > 1).tolist():
        pieces = np.flatnonzero(source == whole)
        pieces = pieces[np.argsort(-area[pieces], kind="stable")]
        numbers[pieces[1:]] = free + np.arange(len(pieces) - 1)
        free += len(pieces) - 1
        pieces_of.update(dict.fromkeys(pieces[1:].tolist(), int(numbers[pieces[0]])))
        triangles = np.flatnonzero(np.isin(topology.mesh.face, pieces))
        own = np.flatnonzero(faces.label == whole)
        _, nearest = KDTree(corners[triangles]).query(cloud.points[own])
        label[own] = topology.mesh.face[triangles[nearest]]
    order = np.append(source, lost).tolist()
    place = {k: new for new, k in reversed(list(enumerate(order)))}
    smooth = frozenset((min(place[i], place[j]), max(place[i], place[j])) for i, j in faces.smooth if i in place and j in place)
    fits = tuple(_as_piece(faces.fits[k], pieces_of.get(new)) for new, k in enumerate(order))
    return replace(parted, faces=replace(faces, label=label, fits=fits, smooth=smooth), numbers=numbers, free=free)


def _as_piece(fit: ShapeFit, whole: int | None) -> ShapeFit:
    """Note whose piece a face is, if it is one."""
    return fit if whole is None else replace(fit, notes=(*fit.notes, f"A piece of face {whole}: corrections know it by that number."))


def deviations(
    points: NDArray[np.float64], label: NDArray[np.int32], fits: tuple[ShapeFit, ...], outward: NDArray[np.int8]
) -> NDArray[np.float64]:
    """Return each point's signed distance (N,) from its face's surface, positive outside the body; NaN where it has no face."""
    deviation = np.full(len(points), np.nan)
    for k, fit in enumerate(fits):
        own = label == k
        sign = outward[k] if k < len(outward) else 1
        deviation[own] = sign * fit.shape.distance(points[own])
    return deviation
