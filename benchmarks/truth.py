"""Truth from CAD: a cloud sampled from a part, with its true faces and edges; `benchmarks.scores` says how near a result comes to it.

Definitions
-----------
h                the mean spacing, sqrt(area / points)
true face        a face of the part after adjacent faces of the same surface are merged
patch            true faces joined across edges whose faces meet smoothly (median angle below 15 degrees)
median face      square root of the median face area, in h: the width of a typical face
sharp edge       a sample of an edge where the normals of its two faces differ by more than 15 degrees, or where one face ends
faint edge       one where they differ by 5 to 15 degrees: neither asked for nor held against a result
noise s          Gaussian with a standard deviation of s · h on every coordinate
"""

# pyright: reportAttributeAccessIssue=false
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart, load_cad, tessellate
from scan2nurbs.simulate import SimulatedScan, SimulateParams, simulate_scan

Floats = NDArray[np.float64]

SHARP, FAINT = 15.0, 5.0
POINTS = 60_000

CONDITIONS: dict[str, dict[str, Any]] = {
    "noise 0": {"noise": 0.0},
    "noise .25": {"noise": 0.25},
    "noise .5": {"noise": 0.5},
    "noise 1": {"noise": 1.0},
    "random .5": {"mode": "random", "noise": 0.5},
    "uneven .25": {"mode": "uneven", "noise": 0.25, "holes": 6},
    "1 % outliers .25": {"noise": 0.25, "outliers": 0.01},
}
"""How a part is sampled: a jittered grid unless said otherwise; noise and lengths in h."""


@dataclass(frozen=True)
class TrueEdges:
    """Samples along the edges of a part.

    Attributes
    ----------
    points : (E, 3) float64
    angle : (E,) float64
        Degrees between the outward normals of the two faces; 180 where one face ends.
    convex : (E,) bool
        Whether the part is convex there.
    border : (E,) bool
        Whether one face ends there.
    pair : (E, 2) int32
        The two faces; the same one twice at a border or a seam.
    """

    points: Floats
    angle: Floats
    convex: NDArray[np.bool_]
    border: NDArray[np.bool_]
    pair: NDArray[np.int32]

    def take(self, rows: NDArray[np.bool_]) -> TrueEdges:
        """Return some of the samples."""
        return TrueEdges(self.points[rows], self.angle[rows], self.convex[rows], self.border[rows], self.pair[rows])

    @property
    def sharp(self) -> Floats:
        """The places of the sharp samples."""
        return self.points[self.angle > SHARP]

    @property
    def faint(self) -> Floats:
        """The places of the faint samples."""
        return self.points[(self.angle > FAINT) & (self.angle <= SHARP)]


@dataclass(frozen=True)
class Truth:
    """A sampled cloud and what is true of it.

    Attributes
    ----------
    scan : SimulatedScan
        The cloud, the face of every point, and the exact places.
    part : CadPart
        With adjacent faces of the same surface merged.
    edges : TrueEdges
        h/2 apart, where points were sampled nearby.
    patch : (F,) int32
        The patch of each true face.
    h : float
    median_face : float
        In h.
    """

    scan: SimulatedScan
    part: CadPart
    edges: TrueEdges
    patch: NDArray[np.int32]
    h: float
    median_face: float

    @property
    def points(self) -> Floats:
        """The cloud, (N, 3)."""
        return self.scan.points


def true_part(source: Any) -> CadPart:
    """Read a file or take a shape, with adjacent faces of the same surface merged."""
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    shape = load_cad(source).shape if isinstance(source, str) or hasattr(source, "suffix") else source
    job = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    job.Build()
    return tessellate(job.Shape())


def sample(part: CadPart, condition: dict[str, Any], *, points: int = POINTS, seed: int = 1) -> Truth:
    """Sample a part in a condition such as those of `CONDITIONS`."""
    noise = condition.get("noise", 0.0)
    settings = {"mode": "grid", "hole_radius": 7.5, **condition, "noise_across": noise, "noise_growth": 0.0}
    scan = simulate_scan(part, SimulateParams(n_points=points, seed=seed, **settings))
    h = scan.spacing
    edges = edge_samples(part, 0.5 * h)
    if len(edges.points):
        edges = edges.take(KDTree(scan.clean[scan.face >= 0]).query(edges.points)[0] < 3 * h)
    median_face = float(np.sqrt(np.median(part.face_area)) / h)
    return Truth(scan, part, edges, patches(len(part.faces), edges), h, median_face)


def edge_samples(part: CadPart, step: float) -> TrueEdges:
    """Sample the edges of a part about `step` apart, with the angle between the faces that meet there."""
    from OCP.BRep import BRep_Tool

    found: list[TrueEdges] = []
    for users in _edge_users(part.shape):
        curve_parameters = _parameters(users[0][1], step)
        sides = [_side(part, face, edge, curve_parameters, BRep_Tool) for face, edge in users[:2]]
        where, normal, _ = sides[0]
        n = len(where)
        border = len(users) < 2
        cosine = np.full(n, -1.0) if border else np.einsum("nc,nc->n", normal, sides[1][1])
        # The other face runs away from the outer side of this one where the part is convex.
        convex = np.ones(n, bool) if border else np.einsum("nc,nc->n", normal, sides[1][2]) < 0.0
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        pair = np.tile(np.array([users[0][0], users[-1][0]], np.int32), (n, 1))
        found.append(TrueEdges(where, angle, convex, np.full(n, border), pair))
    if not found:
        return TrueEdges(np.empty((0, 3)), np.empty(0), np.empty(0, bool), np.empty(0, bool), np.empty((0, 2), np.int32))
    names = ("points", "angle", "convex", "border", "pair")
    return TrueEdges(*(np.concatenate([getattr(piece, name) for piece in found]) for name in names))


def _edge_users(shape: Any) -> list[list[tuple[int, Any]]]:
    """Return for each edge that is no point the faces that use it, with the edge as it is used there; a seam is used twice by one."""
    from OCP.BRep import BRep_Tool
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
    from OCP.TopExp import TopExp, TopExp_Explorer
    from OCP.TopoDS import TopoDS

    faces, edges = ShapeMap(), ShapeMap()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    TopExp.MapShapes_s(shape, TopAbs_EDGE, edges)
    users: list[list[tuple[int, Any]]] = [[] for _ in range(edges.Extent())]
    for i in range(faces.Extent()):
        explorer = TopExp_Explorer(faces.FindKey(i + 1), TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge(explorer.Current())
            if not BRep_Tool.Degenerated_s(edge):
                users[edges.FindIndex(edge) - 1].append((i, edge))
            explorer.Next()
    return [use for use in users if use]


def _parameters(edge: Any, step: float) -> Floats:
    """Return parameters about evenly spaced by arc length."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve

    curve = BRepAdaptor_Curve(edge)
    fine = np.linspace(curve.FirstParameter(), curve.LastParameter(), 257)
    places = np.array([(p.X(), p.Y(), p.Z()) for p in map(curve.Value, map(float, fine))])
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))]
    return np.interp(np.linspace(0.0, length[-1], max(2, round(length[-1] / step) + 1)), length, fine)


def _side(part: CadPart, face: int, edge: Any, parameters: Floats, tool: Any) -> tuple[Floats, Floats, Floats]:
    """Return places on an edge, the outward normal of a face there, and the direction across the edge into that face."""
    from OCP.TopAbs import TopAbs_REVERSED

    shape = part_face(part, face)
    curve = tool.CurveOnSurface_s(edge, shape, 0.0, 0.0)
    uv = np.array([(p.X(), p.Y()) for p in map(curve.Value, map(float, parameters))])
    points, along_u, along_v = part.faces[face].evaluate(np.ascontiguousarray(uv[:, 0]), np.ascontiguousarray(uv[:, 1]))
    normal = np.cross(along_u, along_v) * part.faces[face].sign
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    tangent = np.gradient(points, axis=0) * (-1.0 if edge.Orientation() == TopAbs_REVERSED else 1.0)
    return points, normal, np.cross(normal, tangent)


def part_face(part: CadPart, face: int) -> Any:
    """Return a face of the part as the CAD kernel holds it."""
    from scan2nurbs.brep.cad import _faces_of

    return _faces_of(part.shape)[face]


def patches(n_faces: int, edges: TrueEdges) -> NDArray[np.int32]:
    """Join faces across edges whose median angle is below `SHARP`; return the patch of each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    key = np.sort(edges.pair, axis=1)
    smooth = [pair for pair in np.unique(key, axis=0) if np.median(edges.angle[(key == pair).all(axis=1)]) < SHARP]
    rows = np.array(smooth, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(rows)), (rows[:, 0], rows[:, 1])), shape=(n_faces, n_faces))
    return connected_components(graph, directed=False)[1].astype(np.int32)
