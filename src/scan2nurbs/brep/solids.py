"""Faces on shared edges become shells, and closed shells solids, cavities included."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from scan2nurbs.brep.check import is_valid, is_valid_meshed
from scan2nurbs.brep.endure import endures
from scan2nurbs.brep.measure import rough_volume


@dataclass(frozen=True)
class Assembled:
    """What faces became.

    Attributes
    ----------
    shape : TopoDS_Shape
        A solid or a shell, or a compound of several.
    n_solids : int
    n_free_edges : int
        Edges with a face on one side only, as a reader of a file will find them.
    joined : bool
        Whether faces that share edges are in one shell.
    """

    shape: Any
    n_solids: int
    n_free_edges: int
    joined: bool = True

    @cached_property
    def valid(self) -> bool:
        """Whether the kernel's own analysis finds nothing wrong with it."""
        return is_valid(self.shape)

    @cached_property
    def sound(self) -> bool:
        """Whether it is also valid once it is triangulated, as `is_sound` tells."""
        return self.valid and is_valid_meshed(self.shape, every=False)

    @cached_property
    def good(self) -> bool:
        """Whether it is sound, and is so once it is read from a file."""
        return self.sound and endures(self.shape)


def assemble(faces: Sequence[Any]) -> Assembled:
    """Join faces that share edges.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
        Oriented outward.

    Notes
    -----
    Faces that hang together make a shell; one whose edges all have two faces is closed. A closed shell that encloses a positive volume
    is the outside of a solid, one with a negative volume a cavity of the solid around it.
    """
    groups = _groups(faces)
    closed, parts, free = [], [], 0
    for group in groups:
        shell, open_edges = _shell([faces[k] for k in group])
        free += open_edges
        (parts if open_edges else closed).append(shell)
    solids = _solids(closed)
    parts = [*solids, *parts]
    return Assembled(parts[0] if len(parts) == 1 else compound(parts), len(solids), free)


def loose(faces: Sequence[Any]) -> Assembled:
    """Leave faces as they are, in no shell: in a file each has edges of its own."""
    return Assembled(compound(faces), 0, assemble([apart(face) for face in faces]).n_free_edges, joined=False)


def compound(shapes: Sequence[Any]) -> Any:
    """Return a ``TopoDS_Compound`` of shapes."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    made, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(made)
    for shape in shapes:
        builder.Add(made, shape)
    return made


def apart(face: Any) -> Any:
    """Return a copy of a face that shares nothing with others."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.TopoDS import TopoDS

    return TopoDS.Face(BRepBuilderAPI_Copy(face).Shape())


def _groups(faces: Sequence[Any]) -> list[list[int]]:
    """Return the faces that hang together by edges, as ascending rows."""
    parent = list(range(len(faces)))

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for users in _edges(faces):
        for k in users[1:]:
            a, b = sorted((root(users[0]), root(k)))
            parent[b] = a
    found: dict[int, list[int]] = {}
    for k in range(len(faces)):
        found.setdefault(root(k), []).append(k)
    return list(found.values())


def _edges(faces: Sequence[Any]) -> list[list[int]]:
    """Return, for every distinct edge that is not shrunk to a point, the faces that use it, once for every use."""
    from OCP.BRep import BRep_Tool
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    known, users = ShapeMap(), []
    for k, face in enumerate(faces):
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge(explorer.Current())
            explorer.Next()
            if BRep_Tool.Degenerated_s(edge):
                continue
            at = known.Add(edge)
            if at > len(users):
                users.append([])
            users[at - 1].append(k)
    return users


def _shell(faces: Sequence[Any]) -> tuple[Any, int]:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Shell

    shell, builder = TopoDS_Shell(), BRep_Builder()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    free = sum(len(users) == 1 for users in _edges(faces))
    shell.Closed(free == 0)
    return shell, free


def _solids(shells: Sequence[Any]) -> list[Any]:
    """Make solids of closed shells: cavities go to the smallest solid around them."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS, TopoDS_Solid

    volumes = [rough_volume(shell) for shell in shells]
    outer = [k for k, v in enumerate(volumes) if v > 0]
    inner: dict[int, list[int]] = {k: [] for k in outer}
    for k in (k for k, v in enumerate(volumes) if v <= 0):
        around = [o for o in outer if volumes[o] > -volumes[k] and _contains(shells[o], shells[k])]
        if around:
            inner[min(around, key=lambda o: volumes[o])].append(k)
        else:
            inner[k] = []
    made, builder = [], BRep_Builder()
    for k, cavities in sorted(inner.items()):
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        builder.Add(solid, shells[k] if volumes[k] > 0 else TopoDS.Shell(shells[k].Reversed()))
        for cavity in cavities:
            builder.Add(solid, shells[cavity])
        made.append(solid)
    return made


def _contains(outer: Any, inner: Any) -> bool:
    """Return whether a vertex of one closed shell lies within another."""
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.TopAbs import TopAbs_IN, TopAbs_VERTEX
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS, TopoDS_Solid

    solid, builder = TopoDS_Solid(), BRep_Builder()
    builder.MakeSolid(solid)
    builder.Add(solid, outer)
    explorer = TopExp_Explorer(inner, TopAbs_VERTEX)
    if not explorer.More():
        return False
    point = BRep_Tool.Pnt_s(TopoDS.Vertex(explorer.Current()))
    return BRepClass3d_SolidClassifier(solid, point, 1e-6).State() == TopAbs_IN
