"""Faces become shells and solids that are valid, in a file too; what spoils them leaves its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scan2nurbs.brep.alone import trim_alone
from scan2nurbs.brep.check import check, is_valid, is_valid_meshed
from scan2nurbs.brep.endure import endures
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.brep.sewn import sew
from scan2nurbs.brep.solids import Assembled, apart, area, assemble, compound
from scan2nurbs.brep.viewed import unseen
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.topology import Topology

Pieces = tuple[Any, ...]

_SHOWN = 4
"""Most faces that leave their neighbours for how the part is shown."""


@dataclass(frozen=True)
class Surroundings:
    """What a face is trimmed by when it is made anew.

    Attributes
    ----------
    shapes : sequence of Shape
        Of each face.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    """

    shapes: Sequence[Any]
    topology: Topology
    h: float
    scale: float


def join_faces(
    faces: list[Pieces], how: list[str], around: Surroundings, widest: float, notes: list[str]
) -> tuple[list[Pieces], list[str], Assembled]:
    """Join faces that share edges, and sew those with outlines of their own to them where that keeps all valid.

    Parameters
    ----------
    faces : list of tuple of TopoDS_Face
        The pieces of each face.
    how : list of str
        How each was trimmed, see `PartFace`.
    around : Surroundings
    widest : float
        Largest distance of edges that are sewn, in h.
    notes : list of str
        Is told what changed.

    Returns
    -------
    faces, how : lists
        As they are after that.
    whole : Assembled

    Raises
    ------
    NoResultError
        If no face is valid at all.
    """
    faces, how, whole = _shown(faces, how, around, notes)
    if whole.n_free_edges and "alone" in how:
        sewn = sew(faces, widest * around.h * around.scale)
        if sewn is not None and endures((joined := _together(sewn)).shape):
            notes.append(f"Faces with outlines of their own were sewn to their neighbours; {joined.n_free_edges} free edges are left.")
            return sewn, how, joined
    if _good(whole):
        return faces, how, whole
    faces, how = _mended(faces, how, around, notes)
    whole = _together(faces)
    if _good(whole):
        return faces, how, whole
    loose = Assembled(compound([face for pieces in faces for face in pieces]), 0, whole.n_free_edges)
    if _good(loose):
        notes.append("The CAD kernel finds the shells of these faces invalid: the faces are not joined to shells.")
        return faces, how, loose
    notes.append("The CAD kernel finds faces invalid that share edges: every face has edges of its own.")
    return _parted(faces)


def _together(faces: Sequence[Pieces]) -> Assembled:
    every = [face for pieces in faces for face in pieces]
    if not every:
        raise NoResultError("No face of the part could be made.")
    return assemble(every)


def _shown(faces: list[Pieces], how: list[str], around: Surroundings, notes: list[str]) -> tuple[list[Pieces], list[str], Assembled]:
    """Give outlines of their own to faces that would be lost, or spoil a neighbour, where the part is shown."""
    faces, how, whole = list(faces), list(how), _together(faces)
    for _ in range(_SHOWN):
        try:
            lost = [f for f in unseen(faces, whole.shape) if how[f] not in ("alone", "lost")] if is_valid(whole.shape) else []
        except KernelError:  # what the kernel cannot triangulate at all is found, and told, below
            break
        if not lost:
            break
        # Of two neighbours with a bad edge between them the narrower one is at fault.
        worst = min(lost, key=lambda f: (sum(map(area, faces[f])), f))
        faces[worst] = trim_alone(worst, around.shapes[worst], around.topology, around.h, around.scale)
        how[worst] = "alone" if faces[worst] else "lost"
        done = "it has its own outline." if faces[worst] else "it is left out."
        notes.append(f"Face {worst + 1} ({around.shapes[worst].kind}) would be lost where the part is shown: {done}")
        whole = _together(faces)
    return faces, how, whole


def _good(whole: Assembled) -> bool:
    return check(whole.shape).valid and endures(whole.shape)


def _mended(faces: list[Pieces], how: list[str], around: Surroundings, notes: list[str]) -> tuple[list[Pieces], list[str]]:
    """Give outlines of their own to faces that are invalid in a file even without their neighbours."""
    faces, how = list(faces), list(how)
    for f, pieces in enumerate(faces):
        if all(endures(apart(piece)) for piece in pieces):
            continue
        alone = trim_alone(f, around.shapes[f], around.topology, around.h, around.scale) if how[f] != "alone" else ()
        faces[f] = tuple(piece for piece in alone if endures(piece))
        how[f] = "alone" if faces[f] else "lost"
        done = "it has its own outline." if faces[f] else "it is left out."
        notes.append(f"Face {f + 1} ({around.shapes[f].kind}) is invalid once it is read from a file: {done}")
    return faces, how


def _parted(faces: Sequence[Pieces]) -> tuple[list[Pieces], list[str], Assembled]:
    """Give every face edges of its own, and leave out what is not even valid then."""
    kept = [
        tuple(piece for piece in map(apart, pieces) if is_valid(piece) and is_valid_meshed(piece, every=False) and endures(piece))
        for pieces in faces
    ]
    every = [piece for pieces in kept for piece in pieces]
    if not every:
        raise NoResultError("No face of the part could be made.")
    how = ["alone" if pieces else "lost" for pieces in kept]
    return kept, how, Assembled(compound(every), 0, assemble(every).n_free_edges)
