"""Gather the pieces of smooth surfaces into faces, by what is known of each pair of neighbours."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Pair = tuple[int, int]

CERTAIN = 4.0
"""Doubt beyond which neighbours are not tangent, even if stray points spoil small ones; of those that bend alike any doubt will do."""
RUNS_ON = 2.0
"""A surface runs on over points that lie within so many deviations of it, root mean square; a fillet bends away much faster."""
PARTS = 4.0
"""The same for the other way about: the smaller of two pieces is known less well."""
LEAST_CHAIN = 6
"""So many pieces in a row that hardly bend differently where they meet are no arcs of a designed profile, even if all are tangent."""
MOST = 0.5
"""Share of the points that lies on freeform faces where a cloud is no part of primitives at all."""
SMALL = 0.2
"""A piece is small with less than this share of a freeform face's points: it joins without further evidence."""


@dataclass(frozen=True)
class Pairs:
    """What is known of neighbouring pieces.

    Attributes
    ----------
    reach : dict
        Of pairs that meet smoothly, how far either surface runs on over the other's points beside the border, root mean square in
        deviations.
    doubt : dict
        Of these, how clearly the points say that they are not tangent, see `relations.doubt_tangency`.
    even : frozenset of (int, int)
        Those that bend alike across their border.
    freeform : frozenset of (int, int)
        Those of which the points say that they are pieces of a freeform face, tangent or not.
    """

    reach: dict[Pair, tuple[float, float]]
    doubt: dict[Pair, float]
    even: frozenset[Pair]
    freeform: frozenset[Pair] = frozenset()

    def doubted(self, pair: Pair) -> bool:
        """Tell whether two pieces are not tangent."""
        return self.doubt.get(pair, np.inf) > 1.0

    def runs_on(self, pair: Pair) -> bool:
        """Tell whether the surfaces of two pieces run on over each other's points."""
        return pair in self.reach and min(self.reach[pair]) < RUNS_ON and max(self.reach[pair]) < PARTS

    def chains(self, among: Iterable[Pair]) -> set[Pair]:
        """Return which of some pairs are links of long chains."""
        alike = sorted(pair for pair in among if pair in self.even and max(self.reach[pair]) < PARTS)
        group = joined(1 + max((max(pair) for pair in alike), default=0), alike)
        long = np.bincount(group, minlength=len(group))[group] >= LEAST_CHAIN
        return {pair for pair in alike if long[pair[0]]}


def gather(
    size: NDArray[np.int64],
    flat: NDArray[np.bool_],
    pairs: Pairs,
    bent: Collection[Pair],
    smooth: Collection[Pair],
    sure: Collection[Pair] = (),
) -> NDArray[np.int64]:
    """Gather pieces into faces.

    Parameters
    ----------
    size : (M,) int64
        Points of each piece.
    flat : (M,) bool
        Whether it is a plane.
    pairs : Pairs
    bent : collection of (int, int)
        Neighbours that may belong together, i < j.
    smooth : collection of (int, int)
        Those of them, and others, that meet smoothly.
    sure : collection of (int, int)
        Those that belong together whatever else is known of them.

    Returns
    -------
    (M,) int64
        The lowest member of each piece's face.
    """
    run_on = {pair for pair in bent if pairs.runs_on(pair)}
    certain = {pair for pair in run_on if pair in pairs.freeform or pairs.doubt[pair] > (1.0 if pair in pairs.even else CERTAIN)}
    joins = sorted({*certain, *pairs.chains(pair for pair in bent if pair in pairs.reach), *sure})
    doubted = {pair: pair in run_on for pair in bent if pairs.doubted(pair)}
    tangent = {pair: pair in pairs.even and not flat[list(pair)].any() for pair in sorted(run_on - doubted.keys())}
    parent = _continued(size, flat, doubted, tangent, joins)
    return _absorbed(size, {pair: pairs.reach[pair] for pair in smooth}, parent)


def _continued(
    size: NDArray[np.int64], flat: NDArray[np.bool_], doubted: dict[Pair, bool], tangent: dict[Pair, bool], joins: list[Pair]
) -> NDArray[np.int64]:
    """Let what is freeform for certain go on up to the next crease, over pieces that stand alone where their surface runs on.

    Where most of the points are freeform, it goes on over all pieces that are not tangent. What happens to be tangent belongs to it as
    well if it is freeform too, or bends alike and is no plane. A plane in two pieces is no freeform face.
    """
    parent = joined(len(size), joins)
    plane = joined(len(parent), [(i, j) for i, j in joins if flat[i] and flat[j]])
    while True:
        free = np.bincount(parent[np.unique(plane)], minlength=len(parent))[parent] > 1
        organic = size[free].sum() > MOST * size.sum()
        either = {pair for pair, runs_on in doubted.items() if runs_on or organic} | {pair for pair, alike in tangent.items() if alike}
        more = [pair for pair in [*doubted, *tangent] if free[list(pair)].all() or (pair in either and free[list(pair)].any())]
        wider = joined(len(parent), [*joins, *more])
        if (wider == parent).all():
            return parent
        parent = wider


def _absorbed(size: NDArray[np.int64], reach: dict[Pair, tuple[float, float]], parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give freeform faces the small pieces beside them onto which their surface runs on."""
    while True:
        members, total = np.bincount(parent, minlength=len(parent)), np.bincount(parent, weights=size, minlength=len(parent))
        more = []
        for (i, j), (over_j, over_i) in reach.items():
            for own, other, over in ((i, j, over_j), (j, i, over_i)):
                group, small = parent[own], parent[other]
                if group != small and members[group] > 1 and total[small] <= SMALL * total[group] and over < RUNS_ON:
                    more.append((int(group), int(small)))
        if not more:
            return parent
        parent = joined(len(parent), [*enumerate(parent.tolist()), *more])


def joined(n: int, pairs: Iterable[Pair]) -> NDArray[np.int64]:
    """Return the lowest member of the group of each of n, given which ones belong together."""
    i, j = np.array(list(pairs), np.int64).reshape(-1, 2).T
    _, group = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)
    return np.unique(group, return_index=True)[1][group]


def groups(parent: NDArray[np.int64]) -> list[list[int]]:
    """Return the members of each group of more than one."""
    kept, count = np.unique(parent, return_counts=True)
    return [np.flatnonzero(parent == k).tolist() for k in kept[count > 1]]
