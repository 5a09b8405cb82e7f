"""What is true of a simulated part: where its edges are, and how far a result is from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart
from scan2nurbs.simulate import SimulatedScan

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHARP = 15.0
"""Degrees between the normals of two faces from which their common edge is an edge of the truth."""

TOLERANCE = 2.0
"""A marked point is right, and a true edge found, within so many h."""


@dataclass(frozen=True)
class MeshEdges:
    """The sides of triangles at which two faces meet.

    Attributes
    ----------
    ends : (E, 2, 3) float64
    faces : (E, 2) int64
    angle : (E,) float64
        Degrees between the faces' normals, in [0, 180].
    """

    ends: Array
    faces: NDArray[np.int64]
    angle: Array

    def take(self, rows: Mask) -> MeshEdges:
        """Return some of them."""
        return MeshEdges(self.ends[rows], self.faces[rows], self.angle[rows])

    def sample(self, step: float) -> tuple[Array, NDArray[np.int64]]:
        """Return points along the edges at most `step` apart, and the row of the edge of each."""
        length = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        count = np.maximum(np.ceil(length / step).astype(np.int64), 1)
        row = np.repeat(np.arange(len(count)), count)
        place = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
        return self.ends[row, 0] + place[:, None] * (self.ends[row, 1] - self.ends[row, 0]), row


def edges_between_faces(part: CadPart) -> MeshEdges:
    """Find where the faces of a tessellated part meet: their triangles share nodes there."""
    nodes, index = np.unique(part.corners.reshape(-1, 3), axis=0, return_inverse=True)
    triangle = index.reshape(-1, 3)
    ends = np.stack([triangle, np.roll(triangle, -1, axis=1)], axis=2).reshape(-1, 2)
    normals = np.stack([part.normals, np.roll(part.normals, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    turned = ends[:, 0] > ends[:, 1]
    ends[turned], normals[turned] = ends[turned, ::-1], normals[turned, ::-1]
    owner = np.repeat(part.face.astype(np.int64), 3)
    order = np.lexsort(ends.T)
    ends, normals, owner = ends[order], normals[order], owner[order]
    pair = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1) & (owner[1:] != owner[:-1]))
    cosine = np.einsum("ekc,ekc->ek", normals[pair], normals[pair + 1])
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max(axis=1)
    return MeshEdges(nodes[ends[pair]], np.column_stack([owner[pair], owner[pair + 1]]), angle)


def seen_by(scan: SimulatedScan, samples: Array, faces: NDArray[np.int64], reach: float) -> Mask:
    """Tell at which samples of edges the scan holds points of both faces: the others are hidden, and nobody can find them."""
    seen = np.ones(len(samples), bool)
    for face in np.unique(faces):
        mine = scan.clean[scan.face == face]
        rows = np.flatnonzero((faces == face).any(axis=1))
        if len(mine) == 0:
            seen[rows] = False
            continue
        distance, _ = KDTree(mine).query(samples[rows], distance_upper_bound=reach)
        seen[rows] &= np.isfinite(distance)
    return seen


@dataclass(frozen=True)
class StandIn:
    """A simulated scan and its truth, one row a point.

    Attributes
    ----------
    title : str
    points, clean : (N, 3) float64
        As measured, and without noise.
    inside : (N,) bool
        Points of the functional surface.
    judged : (N,) bool
        Points that are inside or outside without doubt: farther than 2 h from its border.
    side : (N,) int8
        On which side of that border a point lies: 1 inside, −1 outside, 0 on the wall of a smooth step.
    near : (N,) bool
        Points within 2 h of a true edge.
    edges : (K, 3) float64
        Samples of the true edges, as far as they were scanned.
    detail : (K,) bool
        Those of details: edges of a face smaller than a disc of 30 d̄.
    border : (B, 3) float64
        Samples of the border of the functional surface.
    h, sigma : float
        Mean spacing, and standard deviation of the noise.
    """

    title: str
    points: Array
    clean: Array
    inside: Mask
    judged: Mask
    side: NDArray[np.int8]
    near: Mask
    edges: Array
    detail: Mask
    border: Array
    h: float
    sigma: float

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class EdgeScore:
    """How well marked points show the true edges: all shares in [0, 1].

    Attributes
    ----------
    marked : float
        Share of all points that are marked.
    precision : float
        Share of the marked points within 2 h of a true edge.
    recall : float
        Share of the true edges' length with a marked point within 2 h.
    detail : float
        The same of the edges of details; NaN without any.
    """

    marked: float
    precision: float
    recall: float
    detail: float

    @property
    def f1(self) -> float:
        """The harmonic mean of precision and recall."""
        both = self.precision + self.recall
        return 2 * self.precision * self.recall / both if both > 0 else 0.0


def score_edges(cloud: StandIn, mask: Mask) -> EdgeScore:
    """Compare marked points with the true edges."""
    if not mask.any() or len(cloud.edges) == 0:
        return EdgeScore(float(mask.mean()), 0.0, 0.0, 0.0)
    found = reached(cloud.edges, cloud.clean[mask], TOLERANCE * cloud.h)
    detail = float(found[cloud.detail].mean()) if cloud.detail.any() else np.nan
    return EdgeScore(float(mask.mean()), float(cloud.near[mask].mean()), float(found.mean()), detail)


def reached(targets: Array, points: Array, distance: float) -> Mask:
    """Tell which targets have a point within a distance."""
    if len(points) == 0:
        return np.zeros(len(targets), bool)
    return np.isfinite(KDTree(points).query(targets, distance_upper_bound=distance, workers=-1)[0])


@dataclass(frozen=True)
class LineScore:
    """How well thinned points lie on the border of the functional surface.

    Attributes
    ----------
    n_points : int
    distance : float
        Mean distance to it, in h, of those within 10 h.
    stray : float
        Share farther than 10 h: they belong to no part of it.
    covered : float
        Share of the border with a thinned point within 2 h.
    """

    n_points: int
    distance: float
    stray: float
    covered: float


def score_line(cloud: StandIn, points: Array) -> LineScore:
    """Compare thinned points with the true border."""
    if len(points) == 0:
        return LineScore(0, np.nan, np.nan, 0.0)
    distance = KDTree(cloud.border).query(points)[0] / cloud.h
    close = distance <= 10.0
    mean = float(distance[close].mean()) if close.any() else np.nan
    return LineScore(len(points), mean, float(1 - close.mean()), float(reached(cloud.border, points, TOLERANCE * cloud.h).mean()))


@dataclass(frozen=True)
class InsideScore:
    """How well inside and outside are told apart, where there is no doubt: accuracy, and intersection over union of the inside."""

    accuracy: float
    iou: float


def score_inside(cloud: StandIn, found: Mask) -> InsideScore:
    """Compare the points said to be inside with those of the functional surface."""
    truth, answer = cloud.inside[cloud.judged], found[cloud.judged]
    union = np.count_nonzero(truth | answer)
    return InsideScore(float((truth == answer).mean()), np.count_nonzero(truth & answer) / union if union else 0.0)
