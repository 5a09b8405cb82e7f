"""Faces that do not fit their neighbours, spanned between these: one smooth surface through the edges around them."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.check import is_sound
from scan2nurbs.brep.deviation import sample
from scan2nurbs.brep.disc import along, disc_face, follow, loop_length
from scan2nurbs.brep.measure import rough_area, tolerance
from scan2nurbs.brep.occ import KernelError, kernel_errors
from scan2nurbs.brep.patch import patch_within
from scan2nurbs.brep.sewn import sew
from scan2nurbs.brep.solids import assemble
from scan2nurbs.errors import InputError
from scan2nurbs.faces.complex import length_of
from scan2nurbs.faces.topology import Topology

Floats = NDArray[np.float64]

_EDGES = 60
"""Edges around a face, above which no one surface spans it."""
_SMOOTH = (0.05, 0.2, 0.8)
"""Weights of smoothness that are tried."""
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
        loops = [(loop, [along(edge) / scale for edge in loop]) for loop in _free_loops(kept)]
        for group in _touching(missing, topology):
            triangles = mesh.triangles[np.isin(mesh.face, group)]
            if not len(triangles):
                continue
            patch = mesh.vertices[triangles]
            tree = KDTree(mesh.vertices[np.unique(triangles)])
            around = [(loop, lines) for loop, lines in loops if tree.query(np.vstack(lines))[0].max() <= _NEAR * h]
            length, whole = sum(length_of(line) for _, lines in around for line in lines), _length_around(group, topology)
            if 0 < sum(len(loop) for loop, _ in around) <= _EDGES and abs(length - whole) <= _SHORT * whole:
                face = _spanned([loop for loop, _ in around], kept, patch, tree, h, scale, widest)
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
    return sum(length_of(border.points) for border in topology.borders if len({f in group for f in border.faces}) > 1)


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
            way, loop = BRepTools_WireExplorer(TopoDS.Wire(wires.Current())), []
            while way.More():
                loop.append(way.Current())
                way.Next()
            loops += [loop] if loop else []
            wires.Next()
    return loops


def _spanned(
    loops: Sequence[Sequence[Any]], kept: Sequence[Any], patch: Floats, tree: KDTree, h: float, scale: float, widest: float
) -> Any | None:
    """Return a face within loops of edges of other faces that follows a patch (M, 3, 3), facing outward; None if there is none.

    It is valid, and stays so when it is sewn to these, which moves its edges a little.
    """
    beside = [(face,) for face in kept]
    points = np.asarray(tree.data)
    sides = sorted(([follow(edge, h * scale) for edge in loop] for loop in loops), key=loop_length, reverse=True)
    rims = [np.vstack([side.points[:-1] for side in loop]) / scale for loop in sides]
    inner = points[KDTree(np.vstack(rims)).query(points)[0] > _CLOSE * h]
    for smooth in _SMOOTH:
        try:
            surface, parameters = patch_within(rims, inner, h, smooth)
            face = disc_face(surface, sides, parameters, scale)
        except (RuntimeError, ValueError):  # singular equations, too few points
            continue
        facing = _facing(face, patch, tree, h, scale)
        if facing and tolerance(face) <= widest and is_sound(face):
            face = face if facing > 0 else _turned(face)
            if sew([*beside, (face,)], widest) is not None:
                return face
    return None


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
