"""Take up relations one by one, each judged by all that the ones before it say (a Kalman filter over the parameters of a part)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.scale import chi2_quantile
from scan2nurbs.surfaces.constraints import ANGLE, Values, evaluate
from scan2nurbs.surfaces.relation_search import Candidate, Floors, Known
from scan2nurbs.surfaces.relation_solve import room
from scan2nurbs.surfaces.shape import Floats
from scan2nurbs.surfaces.shape_parameters import Primitive, moved

_PROBABILITY = 0.997
_SMOOTH_PROBABILITY = 1.0 - 1e-7  # neighbours that meet smoothly are tangent unless the points speak clearly against it
_SMOOTH_FLOOR = 2.0
_EXACT = 0.03  # an imposed equation holds as well as this share of the floor, as far as the filter is concerned
_FELT = 1e-3  # standard deviations that a primitive must move to be moved


def select_relations(
    known: Sequence[Known], candidates: Sequence[Candidate], tangent: Sequence[tuple[Candidate, ...]], floors: Floors
) -> tuple[list[Candidate], list[Candidate], dict[int, Primitive]]:
    """Return the relations that hold all at once, those that are refused, and the primitives under the former, nearly.

    Parameters
    ----------
    known : sequence of Known
    candidates : sequence of Candidate
        Taken up in this order, but for equal radii.
    tangent : sequence of tuple of Candidate
        Ways of tangency; of each tuple the best is taken, before equal radii.
    floors : Floors
    """
    filter_ = _Filter(known, floors)
    kept, refused = [], []
    # The best known first: their answer settles which way the others go. Equal radii are the surest to happen by chance, so they come last.
    tangent = sorted(tangent, key=filter_.doubt)
    alike = [(c,) for c in candidates if c.kind == "equal radius"]
    for ways in [*((c,) for c in candidates if c.kind != "equal radius"), *tangent, *alike]:
        smooth = ways[0].kind == "tangent"
        best = filter_.take(ways, _SMOOTH_PROBABILITY if smooth else _PROBABILITY, _SMOOTH_FLOOR if smooth else 1.0)
        if best is None:
            refused.append(ways[0])
        else:
            kept.append(best)
    return kept, refused, filter_.shapes


def tangency_doubts(known: Sequence[Known], tangent: Sequence[tuple[Candidate, ...]], floors: Floors) -> dict[tuple[int, int], float]:
    """Return, for each pair of faces (i < j), how badly its best way of tangency holds: beyond one the points speak against it."""
    alone = _Filter(known, floors)
    found = ((ways[0].faces, alone.judge(ways, _SMOOTH_PROBABILITY, _SMOOTH_FLOOR).doubt) for ways in tangent)
    return {(min(faces), max(faces)): doubt for faces, doubt in found}


class _Judged(NamedTuple):
    """A relation, its Wald statistic over the threshold, and what imposing it takes."""

    doubt: float
    way: Candidate
    at: NDArray[np.int64]
    values: Values | None
    floor: Floats


class _Filter:
    """Parameters of all primitives with their joint covariance."""

    def __init__(self, known: Sequence[Known], floors: Floors) -> None:
        self.shapes = {k.face: k.shape for k in known}
        sizes = [len(k.covariance) for k in known]
        ends = np.cumsum(sizes)
        self.at = {k.face: np.arange(end - size, end) for k, size, end in zip(known, sizes, ends, strict=True)}
        self.covariance = np.zeros((int(ends[-1]), int(ends[-1]))) if len(known) else np.zeros((0, 0))
        for k in known:
            self.covariance[np.ix_(self.at[k.face], self.at[k.face])] = k.covariance
        self.floors = floors

    def doubt(self, ways: tuple[Candidate, ...]) -> float:
        """Return how badly the worse of two faces is known."""
        return max(float(self.covariance[at, at].sum()) for at in (self.at[face] for face in ways[0].faces))

    def judge(self, ways: tuple[Candidate, ...], probability: float, factor: float) -> _Judged:
        """Return the best of several relations with its Wald statistic over its threshold."""
        best = _Judged(np.inf, ways[0], np.zeros(0, np.int64), None, np.zeros(0))
        for way in ways:
            index = np.concatenate([self.at[f] for f in way.faces])
            values = evaluate(way.equations, self.shapes[way.faces[0]], self.shapes[way.faces[1]])
            floor = factor * np.array([self.floors.angle if u == ANGLE else self.floors.length for u in values.unit])
            spread = values.slope @ self.covariance[np.ix_(index, index)] @ values.slope.T + np.diag(floor**2)
            fit = float(values.value @ np.linalg.solve(spread, values.value)) / chi2_quantile(probability, len(floor))
            if fit <= best.doubt:
                best = _Judged(fit, way, index, values, floor)
        return best

    def take(self, ways: tuple[Candidate, ...], probability: float, factor: float) -> Candidate | None:
        """Impose the best of several relations if it holds; return it."""
        best = self.judge(ways, probability, factor)
        if best.values is None or best.doubt > 1.0:
            return None
        self._impose(best.at, best.values, best.floor)
        return best.way

    def _impose(self, index: NDArray[np.int64], values: Values, floor: Floats) -> None:
        reach = self.covariance[:, index] @ values.slope.T
        spread = values.slope @ reach[index] + np.diag((_EXACT * floor) ** 2)
        gain = np.linalg.solve(spread, reach.T).T
        step = -gain @ values.value
        felt = np.abs(step) > _FELT * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        self.covariance -= gain @ reach.T
        for face, at in self.at.items():
            if felt[at].any():
                self.shapes[face] = moved(self.shapes[face], room(self.shapes[face], step[at]) * step[at])
