"""Faces that do not fit their neighbours, spanned between these: one smooth surface through the edges around them."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.check import is_sound
from scan2nurbs.brep.deviation import sample
from scan2nurbs.brep.measure import rough_area, tolerance
from scan2nurbs.brep.occ import CONFUSION, KernelError, kernel_errors, to_knots, to_points, to_surface
from scan2nurbs.brep.patch import patch_within
from scan2nurbs.brep.solids import assemble
from scan2nurbs.errors import InputError
from scan2nurbs.faces.topology import Topology
from scan2nurbs.surfaces.bspline import BSplineSurface

Floats = NDArray[np.float64]

_EDGES = 60
"""Edges around a face, above which no one surface spans it."""
_SMOOTH = (0.05, 0.2, 0.8)
"""Weights of smoothness that are tried."""
_COARSE = 17
_SAMPLES = (16, 400)
_SHORT = 0.3
"""Share by which the edges around faces may be longer or shorter than the borders that were read: else some are missing."""
_MORE = 1.5
"""How many times as large as its points' mesh a surface may be, or as small."""
_NEAR = 2.0
"""How far, in h, the edges around faces, and what spans them, may lie from their points."""
_OFF = 0.02
"""Share of a surface, and of the points that it stands for, that may lie farther from each other."""
_CLOSE = 0.7
"""Points that lie closer to the edges than so many h say less than these."""
_FINE = 0.5
"""Distance of points along edges, in h."""
_MARGIN = 1.25


def span(
    faces: Sequence[tuple[Any, ...]], missing: Sequence[int], topology: Topology, h: float, scale: float, widest: float
) -> dict[int, Any]:
    """Span faces that do not fit their neighbours by surfaces between the free edges that these have around them.

    Parameters
    ----------
    faces : sequence of tuple of TopoDS_Face
        The pieces of each face, oriented outward, in kernel units.
    missing : sequence of int
        Faces to be spanned; those that touch are spanned together.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    widest : float
        Largest tolerance, in kernel units.

    Returns
    -------
    dict of int to TopoDS_Face
        By the largest of the faces that each stands for; none where no valid surface through the edges follows the points.

    Notes
    -----
    Their edges have the curves of their neighbours', but are others: sew them.
    """
    out = dict[int, Any]()
    kept = [piece for f, pieces in enumerate(faces) if f not in missing for piece in pieces]
    if not kept or not missing:
        return out
    mesh = topology.mesh
    try:
        loops = [(loop, [_along(edge) / scale for edge in loop]) for loop in _free_loops(kept)]
        for group in _touching(missing, topology):
            triangles = mesh.triangles[np.isin(mesh.face, group)]
            if not len(triangles):
                continue
            patch = mesh.vertices[triangles]
            tree = KDTree(mesh.vertices[np.unique(triangles)])
            around = [(loop, lines) for loop, lines in loops if tree.query(np.vstack(lines))[0].max() <= _NEAR * h]
            length, whole = sum(_span(line) for _, lines in around for line in lines), _length_around(group, topology)
            if sum(len(loop) for loop, _ in around) <= _EDGES and abs(length - whole) <= _SHORT * whole:
                face = _spanned([loop for loop, _ in around], patch, tree, h, scale, widest)
                if face is not None:
                    out[max(group, key=lambda f: (topology.areas[f], -f))] = face
    except KernelError:
        return out
    return out


def touching(missing: Sequence[int], topology: Topology, f: int) -> list[int]:
    """Return the missing faces that touch one of them, directly or by others, itself included."""
    return next(group for group in _touching(missing, topology) if f in group)


def _touching(missing: Sequence[int], topology: Topology) -> list[list[int]]:
    """Return the groups of faces that touch along borders."""
    row = {f: k for k, f in enumerate(missing)}
    pairs = [(row[a], row[b]) for a, b in (border.faces for border in topology.borders) if a in row and b in row]
    i, j = np.array(pairs, int).reshape(-1, 2).T
    count, group = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(len(row), len(row))), directed=False)
    return [[f for f, k in zip(missing, group.tolist(), strict=True) if k == n] for n in range(count)]


def _length_around(group: Sequence[int], topology: Topology) -> float:
    """Return the length of the borders between a group of faces and others."""
    return sum(_span(border.points) for border in topology.borders if len({f in group for f in border.faces}) > 1)


def _free_loops(faces: Sequence[Any]) -> list[list[Any]]:
    """Return the closed loops of edges that have a face on one side only, each in order."""
    from OCP.BRepTools import BRepTools_WireExplorer
    from OCP.ShapeAnalysis import ShapeAnalysis_FreeBounds
    from OCP.TopAbs import TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    loops = []
    with kernel_errors("find free edges"):
        wires = TopExp_Explorer(ShapeAnalysis_FreeBounds(assemble(faces).shape, True, False, False).GetClosedWires(), TopAbs_WIRE)
        while wires.More():
            along, loop = BRepTools_WireExplorer(TopoDS.Wire(wires.Current())), []
            while along.More():
                loop.append(along.Current())
                along.Next()
            loops.append(loop)
            wires.Next()
    return loops


def _along(edge: Any) -> Floats:
    """Return points (K, 3) along an edge."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve

    with kernel_errors("follow an edge"):
        curve = BRepAdaptor_Curve(edge)
        return _at(curve, np.linspace(curve.FirstParameter(), curve.LastParameter(), _COARSE))


def _spanned(loops: Sequence[Sequence[Any]], patch: Floats, tree: KDTree, h: float, scale: float, widest: float) -> Any | None:
    """Return a face within loops of edges that is valid and follows a patch (M, 3, 3), facing outward; None if there is none."""
    points = np.asarray(tree.data)
    sides = sorted(([_followed(edge, h * scale) for edge in loop] for loop in loops), key=_length, reverse=True)
    rims = [np.vstack([side.points[:-1] for side in loop]) / scale for loop in sides]
    inner = points[KDTree(np.vstack(rims)).query(points)[0] > _CLOSE * h]
    for smooth in _SMOOTH:
        try:
            surface, parameters = patch_within(rims, inner, h, smooth)
            face = _face(surface, sides, parameters, scale)
        except (RuntimeError, ValueError):  # singular equations, too few points
            continue
        facing = _facing(face, patch, tree, h, scale)
        if facing and tolerance(face) <= widest and is_sound(face):
            return face if facing > 0 else _turned(face)
    return None


@dataclass(frozen=True)
class _Side:
    """An edge along a loop: its parameters (K,) and the points (K, 3) there, in the kernel's lengths, from where the loop begins."""

    edge: Any
    forward: bool
    t: Floats
    points: Floats

    def turned(self) -> _Side:
        return _Side(self.edge, not self.forward, self.t[::-1], self.points[::-1])


def _followed(edge: Any, step: float) -> _Side:
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_REVERSED

    with kernel_errors("follow an edge"):
        curve = BRepAdaptor_Curve(edge)
        ends = curve.FirstParameter(), curve.LastParameter()
        t = np.linspace(*ends, int(np.clip(_span(_along(edge)) / (_FINE * step), *_SAMPLES)) + 1)
        side = _Side(edge, True, t, _at(curve, t))
    return side.turned() if edge.Orientation() == TopAbs_REVERSED else side


def _at(curve: Any, t: Floats) -> Floats:
    points = (curve.Value(x) for x in t.tolist())
    return np.array([(p.X(), p.Y(), p.Z()) for p in points])


def _span(points: Floats) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _length(loop: Sequence[_Side]) -> float:
    return sum(_span(side.points) for side in loop)


def _face(surface: BSplineSurface, loops: Sequence[Sequence[_Side]], parameters: Sequence[Floats], scale: float) -> Any:
    """Return the face of a disc's image within edges that have the curves of the given ones."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Face

    build, geometry, face = BRep_Builder(), to_surface(surface, scale=scale), TopoDS_Face()
    with kernel_errors("span a face"):
        build.MakeFace(face, geometry, CONFUSION)
        for k, (loop, uv) in enumerate(zip(loops, parameters, strict=True)):
            area = float(np.sum(uv[:, 0] * np.roll(uv[:, 1], -1) - uv[:, 1] * np.roll(uv[:, 0], -1)))
            closed = np.vstack([uv, uv[:1]])
            if (area > 0.0) == (k == 0):
                build.Add(face, _wire(surface, geometry, loop, closed, scale))
            else:  # the face lies on the left of its outer loop and of its holes
                build.Add(face, _wire(surface, geometry, [side.turned() for side in reversed(loop)], closed[::-1], scale))
    return face


def _wire(surface: BSplineSurface, geometry: Any, loop: Sequence[_Side], uv: Floats, scale: float) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS_Vertex, TopoDS_Wire

    build, wire, corners = BRep_Builder(), TopoDS_Wire(), list[Any]()
    build.MakeWire(wire)
    for side in loop:
        vertex = TopoDS_Vertex()
        build.MakeVertex(vertex, gp_Pnt(*side.points[0].tolist()), CONFUSION)
        corners.append(vertex)
    corners.append(corners[0])
    start = 0
    for k, side in enumerate(loop):
        end = start + len(side.t) - 1
        own = uv[start : end + 1]
        gap = float(np.linalg.norm(scale * surface.evaluate(own) - side.points, axis=1).max())
        build.Add(wire, _edge(side, own, max(CONFUSION, _MARGIN * gap), geometry, corners[k : k + 2]))
        start = end
    wire.Closed(True)
    return wire


def _edge(side: _Side, uv: Floats, most: float, geometry: Any, corners: Sequence[Any]) -> Any:
    """Return an edge with the curve of a given one, and a curve on a surface through parameters (K, 2) of that."""
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS_Edge

    along, uv, corners = (side, uv, corners) if side.forward else (side.turned(), uv[::-1], corners[::-1])
    spline = make_interp_spline(along.t, uv, k=3)
    on_surface = Geom2d_BSplineCurve(to_points(np.ascontiguousarray(spline.c)), *to_knots(spline.t), 3)
    edge, build = TopoDS_Edge(), BRep_Builder()
    build.MakeEdge(edge, BRep_Tool.Curve_s(side.edge, 0.0, 0.0), most)
    for corner, end, way in zip(corners, along.points[[0, -1]].tolist(), (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
        build.UpdateVertex(corner, 1.01 * most + BRep_Tool.Pnt_s(corner).Distance(gp_Pnt(*end)))
        build.Add(edge, corner.Oriented(way))
    build.UpdateEdge(edge, on_surface, geometry, TopLoc_Location(), most)
    build.Range(edge, float(along.t[0]), float(along.t[-1]))
    build.SameRange(edge, True)
    build.SameParameter(edge, True)
    return edge.Oriented(TopAbs_FORWARD if side.forward else TopAbs_REVERSED)


def _facing(face: Any, patch: Floats, tree: KDTree, h: float, scale: float) -> int:
    """Return 1 where a face follows a patch and looks outward, −1 where it looks inward, 0 where it does not follow it."""
    outward = 0.5 * np.cross(patch[:, 1] - patch[:, 0], patch[:, 2] - patch[:, 0])
    size = float(np.linalg.norm(outward, axis=1).sum())
    if not size / _MORE <= rough_area(face) / scale**2 <= _MORE * size:
        return 0
    try:
        places, normals = sample(tessellate(face, deflection=0.25 * h * scale, least=0.5 * h * scale), 0.5 * h * scale)
    except InputError:  # it has no triangle
        return 0
    places = places / scale
    far = float(np.mean(tree.query(places)[0] > _NEAR * h)), float(np.mean(KDTree(places).query(tree.data)[0] > _NEAR * h))
    if max(far) > _OFF:
        return 0
    nearest = KDTree(patch.mean(axis=1)).query(places)[1]
    return 1 if float(np.einsum("nk,nk->", normals, outward[nearest])) > 0.0 else -1


def _turned(face: Any) -> Any:
    from OCP.TopoDS import TopoDS

    return TopoDS.Face(face.Reversed())
