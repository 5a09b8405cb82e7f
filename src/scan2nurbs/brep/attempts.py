"""Trim the faces of a part, in as many attempts as it takes: closer to the points, with surfaces bent, without those that still fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.conform import conformed, mesh_surface, yielding
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.measure import tolerance
from scan2nurbs.brep.shared import SharedFaces, sphere_axis, trim_faces
from scan2nurbs.brep.untangle import Untangled, untangled
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.topology import Topology
from scan2nurbs.kernels.runner import Progress

ATTEMPTS = 5
"""Most attempts that are told of as progress."""

_ROUNDS, _BENDS, _UNTANGLED = 3, 2, 2
_DENSE = 0.4
_TIP = 0.25
"""Shorter tips, in h, lie within the tolerances of their vertices, and are no reason to fail."""
_MARGIN = 0.8
"""Gaps within this share of a tolerance can be held by it."""
TOO_WIDE = "Its edges would lie too far from its neighbours."


@dataclass(frozen=True)
class Attempt:
    """Faces as they came out.

    Attributes
    ----------
    made : SharedFaces
    shapes : tuple of Shape
        Of each face; bent ones are B-splines.
    caution : tuple of int
        As in `lay_borders`, a border.
    topology : Topology
        The borders by which they were trimmed.
    bent : frozenset of int
        Faces whose surface was bent to reach its borders.
    other_way : bool
        As in `trim_part`.
    """

    made: SharedFaces
    shapes: tuple[Any, ...]
    caution: tuple[int, ...]
    topology: Topology
    bent: frozenset[int] = frozenset()
    other_way: bool = False

    def wide(self, most: float) -> list[int]:
        """Return the borders that lie farther than `most` from their surfaces."""
        return [k for k, curve in enumerate(self.made.curves) if curve.gap > most]

    def left(self, most: float) -> dict[int, str]:
        """Return the faces that cannot stay, and why: those that failed, and as few as hold all borders wider than `most`."""
        left = dict(self.made.failures)
        wide = [faces for faces in (self.made.curves[k].faces for k in self.wide(most)) if min(faces) >= 0 and not left.keys() & set(faces)]
        # The other way, a face is wrong of which most borders are wide, and not the larger ones around it.
        n_borders = np.array([max(sum(map(len, loops)), 1) if self.other_way else 1 for loops in self.topology.loops])
        while wide:
            counts = np.bincount(np.ravel(wide), minlength=self.topology.n_faces) / n_borders
            worst = int(np.flatnonzero(counts == counts.max())[-1])
            left[worst] = TOO_WIDE
            wide = [faces for faces in wide if worst not in faces]
        return left

    def spoilt(self, most: float) -> set[int]:
        """Return the faces with an edge or vertex that only a tolerance above `most`, in the kernel's lengths, holds together."""
        return {f for f, pieces in enumerate(self.made.faces) if max(map(tolerance, pieces), default=0.0) > most}


def trim_part(
    shapes: Sequence[Any],
    topology: Topology,
    h: float,
    scale: float,
    widest: float,
    bearable: float,
    tell: Progress,
    known: Known | None = None,
    fine: bool = False,
    other_way: bool = False,
) -> tuple[Attempt, list[str]]:
    """Trim the faces of a part along shared borders.

    Parameters
    ----------
    shapes : sequence of Shape
        Of each face.
    topology : Topology
    h : float
        Spacing of the cloud.
    scale : float
        Kernel lengths over the cloud's.
    widest : float
        Tolerance of an edge, in h, above which another attempt is worth it.
    bearable : float
        Tolerance of an edge, in h, above which one of its faces is left out.
    tell : callable
        Called with (attempts done, `ATTEMPTS`).
    known : Known, optional
        What was computed for the same topology.
    fine : bool
        Whether faces must have fine triangles, too.
    other_way : bool
        Whether borders of faces that fail meet where they cross beside a vertex, and faces are left out by how many of their borders are
        wide. Neither way is better; what one leaves open the other may close.

    Returns
    -------
    attempt : Attempt
        The best one, of which no edge is wider than bearable.
    notes : list of str
        What was bent, and what stayed wide.
    """
    most = _MARGIN * widest * h

    def rank(attempt: Attempt) -> tuple[int, int]:
        return len(attempt.left(_MARGIN * bearable * h)), len(attempt.wide(most))

    best, known = None, known or Known()
    caution = (0,) * len(topology.borders)
    for turn in range(_ROUNDS):
        tried = _trimmed(shapes, topology, caution, h, scale, known, fine, other_way)
        tell(turn + 1, ATTEMPTS)
        best = tried if best is None or rank(tried) < rank(best) else best
        if rank(best) == (0, 0):
            break
        topology = tried.topology
        near = {k for f in tried.made.failures for loop in topology.loops[f] for k, _ in loop} | set(tried.wide(most))
        caution = tuple(min(care + (k in near), 2) for k, care in enumerate(tried.caution))
    assert best is not None
    unbent = best.shapes
    for turn in range(_BENDS):
        if rank(best) == (0, 0):
            break
        tried = _bent(best, unbent, h, scale, widest, known, fine)
        tell(_ROUNDS + turn + 1, ATTEMPTS)
        if tried is None or rank(tried) >= rank(best):
            break
        best = tried
    best = _loosened(best, h, scale, bearable, known, fine)
    tried = _on_mesh(best, h, scale, bearable, known, fine)
    best = best if tried is None else _loosened(tried, h, scale, bearable, known, fine)
    return best, _notes(best.made.curves, best.bent, unbent, widest * h, h)


def _trimmed(
    shapes: Sequence[Any],
    topology: Topology,
    caution: Sequence[int],
    h: float,
    scale: float,
    known: Known,
    fine: bool,
    other_way: bool,
    without: Mapping[int, str] | None = None,
    bent: frozenset[int] = frozenset(),
) -> Attempt:
    """Trim faces; where borders of one that fails cross beside a vertex, they meet there if that helps."""
    made = trim_faces(shapes, topology, h, scale, caution, without, known, fine)
    best = Attempt(made, tuple(shapes), tuple(caution), topology, bent, other_way)
    for _ in range(_UNTANGLED if other_way else 0):
        found = untangled(best.topology, best.made.tangles(best.topology, sorted(best.made.failures), h, _TIP * h), h)
        if found is None:
            break
        care = _careful(best, found)
        made = trim_faces(shapes, found.topology, h, scale, care, without, known, fine)
        if len(made.failures) >= len(best.made.failures):
            break
        best = replace(best, made=made, caution=care, topology=found.topology)
    return best


def _careful(attempt: Attempt, found: Untangled) -> tuple[int, ...]:
    """Return the caution of the borders once some meet where they crossed: there surfaces hardly do, and the borders' points say more."""
    return tuple(2 if k in found.changed else attempt.caution[old] for k, old in enumerate(found.kept.tolist()))


def without_tips(
    attempt: Attempt, faces: Sequence[int], h: float, scale: float, bearable: float, known: Known, fine: bool
) -> Attempt | None:
    """Trim the faces of an attempt once more, so that borders of some of them meet where they cross; None where none do, or it fails."""
    found = untangled(attempt.topology, attempt.made.tangles(attempt.topology, faces, h), h)
    if found is None:
        return None
    care = _careful(attempt, found)
    made = trim_faces(attempt.shapes, found.topology, h, scale, care, attempt.left(_MARGIN * bearable * h), known, fine)
    again = replace(attempt, made=made, caution=care, topology=found.topology)
    before, after = (len(one.left(_MARGIN * bearable * h)) for one in (attempt, again))
    return again if after <= before else None


def _bent(
    best: Attempt,
    unbent: Sequence[Any],
    h: float,
    scale: float,
    widest: float,
    known: Known,
    fine: bool,
) -> Attempt | None:
    """Bend the surfaces of faces that fail or do not meet their neighbours, and try again."""
    topology = best.topology
    first = sorted(best.bent | best.made.failures.keys())
    faces, curves = yielding(unbent, topology, h, best.caution, _MARGIN * widest, first, known)
    shapes, bent = list(unbent), set()
    for f in faces:
        loops, lines = topology.loops[f], _lines(f, topology, curves, h)
        # What could not even be made holds a pole of its surface, as a narrow torus does.
        own = unbent[f] if best.made.faces[f] or f not in best.made.failures else None
        bend = _reaching(own, f, topology, lines, h, sphere_axis(unbent[f], loops, curves), known)
        if bend is not None:
            shapes[f] = bend
            bent.add(f)
    if not bent:
        return None
    around = {k for f in bent for loop in topology.loops[f] for k, _ in loop}
    caution = tuple(max(care, int(k in around) + int(k in around and bool(best.bent))) for k, care in enumerate(best.caution))
    return _trimmed(shapes, topology, caution, h, scale, known, fine, best.other_way, bent=frozenset(bent))


def _reaching(
    shape: Any | None,
    f: int,
    topology: Topology,
    lines: list[NDArray[np.float64]],
    h: float,
    towards: NDArray[np.float64] | None,
    known: Known,
) -> Any | None:
    """Return the surface of a face bent to its borders, or that of its part of the mesh if that cannot be; None if neither can."""

    def bend() -> Any | None:
        for surface in (lambda: shape, lambda: mesh_surface(topology, f, h)):
            try:
                found = surface()
                if found is not None:
                    return conformed(found, lines, h, towards)
            except (NoResultError, ValueError):
                continue
        return None

    borders = (line.tobytes() for line in lines)
    return known(("bend", f, "none" if shape is None else shape, b"" if towards is None else towards.tobytes(), *borders), bend)


def _on_mesh(best: Attempt, h: float, scale: float, bearable: float, known: Known, fine: bool) -> Attempt | None:
    """Try again with surfaces through the mesh for the faces that cannot stay; return None where no fewer are left then.

    A surface of the wrong kind, as a cylinder for a strip that is none, may cross itself when it is bent to its borders; what the mesh
    shows does not. The borders are those that its neighbours have without it.
    """
    left, topology = best.left(_MARGIN * bearable * h), best.topology
    shapes: dict[int, Any] = {}
    for f in sorted(left):
        bend = _reaching(None, f, topology, _lines(f, topology, best.made.curves, h), h, None, known)
        if bend is not None:
            shapes[f] = bend
    # Those that would need too wide a tolerance stay out at a second try, for the sake of the others.
    for _ in range(2):
        if not shapes:
            return None
        around = {k for f in shapes for loop in topology.loops[f] for k, _ in loop}
        caution = tuple(2 if k in around else care for k, care in enumerate(best.caution))
        all_shapes = [shapes.get(f, shape) for f, shape in enumerate(best.shapes)]
        others = {f: why for f, why in left.items() if f not in shapes}
        tried = _trimmed(all_shapes, topology, caution, h, scale, known, fine, best.other_way, others, best.bent | shapes.keys())
        spoilt = tried.spoilt(bearable * h * scale)
        if len(tried.left(_MARGIN * bearable * h).keys() | spoilt) < len(left):
            return tried
        shapes = {f: shape for f, shape in shapes.items() if f not in spoilt} if spoilt else {}
    return None


def _lines(f: int, topology: Topology, curves: Sequence[BorderCurve], h: float) -> list[NDArray[np.float64]]:
    """Return points (K, 3) along every loop of a face."""
    lines = []
    for loop in topology.loops[f]:
        parts = [_dense(curves[k], h) for k, _ in loop]
        lines.append(np.vstack([line if forward else line[::-1] for line, (_, forward) in zip(parts, loop, strict=True)]))
    return lines


def _dense(border: BorderCurve, h: float) -> NDArray[np.float64]:
    points = border.curve(border.curve.samples(64))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return points if length < 64 * _DENSE * h else border.curve(border.curve.samples(int(np.ceil(length / (_DENSE * h)))))


def _loosened(best: Attempt, h: float, scale: float, bearable: float, known: Known, fine: bool) -> Attempt:
    """Trim the faces again without those that failed, or that only too wide a tolerance would hold to their neighbours."""
    for _ in range(2):
        left = best.left(_MARGIN * bearable * h)
        if left.keys() == best.made.left_out:
            break
        best = replace(best, made=trim_faces(best.shapes, best.topology, h, scale, best.caution, left, known, fine))
    return best


def _notes(curves: Sequence[BorderCurve], bent: frozenset[int], unbent: Sequence[Any], widest: float, h: float) -> list[str]:
    notes = [f"The surface of face {f + 1} ({unbent[f].kind}) was bent to meet its neighbours." for f in sorted(bent)]
    said = "The surfaces of faces {} and {} lie {:.2g} spacings from the edge between them."
    wide = [c for c in curves if c.gap > widest and min(c.faces) >= 0]
    return notes + [said.format(c.faces[0] + 1, c.faces[1] + 1, c.gap / h) for c in wide]
