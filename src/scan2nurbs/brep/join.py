"""Faces become shells and solids that are valid, in a file too; what spoils them leaves its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scan2nurbs.brep.check import extent_of, is_valid, is_valid_meshed
from scan2nurbs.brep.endure import endures, spoilt
from scan2nurbs.brep.measure import rough_area
from scan2nurbs.brep.occ import KernelError
from scan2nurbs.brep.room import on_its_own
from scan2nurbs.brep.sewn import sew
from scan2nurbs.brep.solids import Assembled, apart, assemble, compound, loose
from scan2nurbs.brep.spanned import span, touching
from scan2nurbs.brep.viewed import unseen
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.topology import Topology

Pieces = tuple[Any, ...]

OUTLINED = "it has its own outline."
"""What a note says of a face that left its neighbours, in the end."""
_SHOWN = 4
"""Most faces that leave their neighbours for how the part is shown."""
_READ = 4
"""How often faces leave their neighbours for how the part is read from a file."""


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


@dataclass(frozen=True)
class Joined:
    """Faces that were joined.

    Attributes
    ----------
    faces : list of tuple of TopoDS_Face
        The pieces of each face.
    how : list of str
        How each was trimmed, see `PartFace`.
    whole : Assembled
    unseen : tuple of int
        Faces that left their neighbours, since they would be lost where the part is shown.
    """

    faces: list[Pieces]
    how: list[str]
    whole: Assembled
    unseen: tuple[int, ...] = ()


@dataclass(frozen=True)
class Spanning:
    """Where surfaces between the edges of their neighbours take the place of faces that do not fit.

    Attributes
    ----------
    share : float
        Where these faces have at most this share of the area, [0, 1]; if it is less than 1, then only if that closes the part.
    widest : float
        Largest tolerance of such a surface, in h.
    """

    share: float = 0.0
    widest: float = 0.0


def join_faces(
    faces: list[Pieces], how: list[str], around: Surroundings, widest: float, notes: list[str], spanning: Spanning | None = None
) -> Joined:
    """Join faces that share edges; span those that do not fit, or sew their outlines to their neighbours, where that keeps all valid.

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
    spanning : Spanning, optional

    Raises
    ------
    NoResultError
        If no face is valid at all.
    """
    shown = _shown(faces, how, around, notes)
    made = _spanned(shown, around, spanning or Spanning(), notes)
    if made is not None:
        return made
    faces, how, whole = _valid(shown, around, widest, notes)
    return Joined(faces, how, whole, shown.unseen)


def _valid(shown: Joined, around: Surroundings, widest: float, notes: list[str]) -> tuple[list[Pieces], list[str], Assembled]:
    """Sew on what has an outline of its own; what is invalid then leaves its neighbours."""
    faces, how, whole = shown.faces, shown.how, shown.whole
    if whole.n_free_edges and "alone" in how:
        sewn = sew(faces, widest * around.h * around.scale)
        if sewn is not None and endures((joined := _together(sewn)).shape):
            notes.append(f"Faces with outlines of their own were sewn to their neighbours; {joined.n_free_edges} free edges are left.")
            return sewn, how, joined
    if whole.good:
        return faces, how, whole
    faces, how, whole = _released(faces, how, around, notes)
    if whole.good:
        return faces, how, whole
    faces, how = _mended(faces, how, around, notes)
    whole = _together(faces)
    if whole.good:
        return faces, how, whole
    unjoined = loose([face for pieces in faces for face in pieces])
    if unjoined.good:
        notes.append("The CAD kernel finds the shells of these faces invalid: the faces are not joined to shells.")
        return faces, how, unjoined
    notes.append("The CAD kernel finds faces invalid that share edges: every face has edges of its own.")
    return _parted(faces, how, around, notes)


def _spanned(shown: Joined, around: Surroundings, spanning: Spanning, notes: list[str]) -> Joined | None:
    """Span faces that do not fit by surfaces between their neighbours, where that keeps all valid and leaves fewer free edges."""
    missing = [f for f, kind in enumerate(shown.how) if kind in ("alone", "lost")]
    if not missing or not _allowed(missing, around.topology, spanning.share):
        return None
    most = spanning.widest * around.h * around.scale
    found = span(shown.faces, missing, around.topology, around.h, around.scale, most)
    faces, how, said = list(shown.faces), list(shown.how), list[str]()
    for by, face in found.items():
        for f in touching(missing, around.topology, by):
            faces[f], how[f] = ((face,), "bent") if f == by else ((), "covered")
            done = (
                "a surface between its neighbours' edges takes its place" if f == by else f"the surface of face {by + 1} covers its points"
            )
            said.append(f"Face {f + 1} ({around.shapes[f].kind}) does not fit its neighbours: {done}.")
    # What keeps an outline of its own runs beside its neighbours' edges, and must not be sewn so widely.
    left = [kind in ("alone", "lost") for kind in how]
    sewn = sew([() if own else pieces for pieces, own in zip(faces, left, strict=True)], most) if found else None
    if sewn is None:
        return None
    faces = [pieces if own else joined for pieces, joined, own in zip(faces, sewn, left, strict=True)]
    whole = _together(faces)
    most_free = shown.whole.n_free_edges - 1 if spanning.share >= 1.0 else 0
    if whole.n_free_edges > most_free or not whole.good:
        return None
    instead = tuple(f"Face {f + 1} (" for f in missing if how[f] in ("bent", "covered"))
    notes[:] = [note for note in notes if not (note.startswith(instead) and note.endswith(OUTLINED))] + said
    return Joined(faces, how, whole, shown.unseen)


def _allowed(missing: Sequence[int], topology: Topology, share: float) -> bool:
    """Tell whether faces that do not fit may be spanned; what has an end where the scan ends is not closed by that."""
    is_open = any(min(border.faces) < 0 for border in topology.borders)
    return share >= 1.0 or (not is_open and 0.0 < topology.areas[missing].sum() <= share * topology.areas.sum())


def _together(faces: Sequence[Pieces]) -> Assembled:
    every = [face for pieces in faces for face in pieces]
    if not every:
        raise NoResultError("No face of the part could be made.")
    return assemble(every)


def _shown(faces: list[Pieces], how: list[str], around: Surroundings, notes: list[str]) -> Joined:
    """Give outlines of their own to faces that would be lost, or spoil a neighbour, where the part is shown."""
    faces, how, whole, left = list(faces), list(how), _together(faces), list[int]()
    for _ in range(_SHOWN):
        try:
            # What was trimmed by its own outline may lie on a surface through the mesh.
            wrinkled = [f for f, kind in enumerate(how) if kind in ("bent", "alone")]
            lost = _joined(unseen(faces, whole.shape, wrinkled), how) if whole.valid else []
        except KernelError:  # what the kernel cannot triangulate at all is found, and told, below
            break
        if not lost:
            break
        # Of two neighbours with a bad edge between them the narrower one is at fault.
        worst = min(lost, key=lambda f: (sum(map(rough_area, faces[f])), f))
        left.append(worst)
        faces[worst], how[worst] = _alone(worst, around)
        notes.append(_left(worst, around, how, "would be lost where the part is shown"))
        whole = _together(faces)
    return Joined(faces, how, whole, tuple(left))


def _released(faces: list[Pieces], how: list[str], around: Surroundings, notes: list[str]) -> tuple[list[Pieces], list[str], Assembled]:
    """Give outlines of their own to faces that are invalid beside the others, or once the part is read from a file."""
    faces, how, whole = list(faces), list(how), _together(faces)
    for _ in range(_READ):
        extent = extent_of(whole.shape)
        unsound = {f for f, pieces in enumerate(faces) if not all(_is_sound(piece, extent) for piece in pieces)}
        lost = sorted(unsound or _joined(spoilt(faces, whole.shape), how))
        if not lost:
            break
        for f in lost:
            faces[f], how[f] = _alone(f, around) if how[f] != "alone" else ((), "lost")
            notes.append(
                _left(f, around, how, "is invalid beside the others" if unsound else "is invalid once the part is read from a file")
            )
        whole = _together(faces)
    return faces, how, whole


def _is_sound(piece: Any, extent: float) -> bool:
    """Tell whether a piece is valid, with triangles of its own size and of the whole part's."""
    return is_valid(piece) and is_valid_meshed(piece, every=False) and is_valid_meshed(piece, every=False, extent=extent)


def _joined(lost: Sequence[int], how: Sequence[str]) -> list[int]:
    """Return those of the faces that have not left their neighbours."""
    return [f for f in lost if how[f] not in ("alone", "lost")]


def _alone(f: int, around: Surroundings) -> tuple[Pieces, str]:
    pieces = on_its_own(f, around.shapes[f], around.topology, around.h, around.scale)
    return pieces, "alone" if pieces else "lost"


def _left(f: int, around: Surroundings, how: Sequence[str], why: str) -> str:
    done = OUTLINED if how[f] == "alone" else "it is left out."
    return f"Face {f + 1} ({around.shapes[f].kind}) {why}: {done}"


def _mended(faces: list[Pieces], how: list[str], around: Surroundings, notes: list[str]) -> tuple[list[Pieces], list[str]]:
    """Give outlines of their own to faces that are invalid in a file even without their neighbours."""
    faces, how = list(faces), list(how)
    for f, pieces in enumerate(faces):
        if all(endures(apart(piece)) for piece in pieces):
            continue
        alone = _alone(f, around)[0] if how[f] != "alone" else ()
        faces[f] = tuple(piece for piece in alone if endures(piece))
        how[f] = "alone" if faces[f] else "lost"
        notes.append(_left(f, around, how, "is invalid once it is read from a file"))
    return faces, how


def _parted(
    faces: Sequence[Pieces], how: Sequence[str], around: Surroundings, notes: list[str]
) -> tuple[list[Pieces], list[str], Assembled]:
    """Give every face edges of its own, and leave out what is not even valid then."""
    extent = extent_of(compound([piece for pieces in faces for piece in pieces]))

    kept = [tuple(piece for piece in map(apart, pieces) if _is_sound(piece, extent) and endures(piece)) for pieces in faces]
    if not any(kept):
        raise NoResultError("No face of the part could be made.")
    left = ["alone" if pieces else "lost" for pieces in kept]
    notes += [_left(f, around, left, "is invalid") for f in _joined(range(len(kept)), how) if not kept[f]]
    every = [piece for pieces in kept for piece in pieces]
    return kept, left, loose(every)
