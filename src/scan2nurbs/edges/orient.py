"""Which side is outside: normals without sign become arrows, alike over each connected surface and pointing away from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, issparse
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from scan2nurbs.kernels.cells import Cells
from scan2nurbs.kernels.flood import between_components, flood_signs, turn_rows
from scan2nurbs.kernels.outermost import outward_signs
from scan2nurbs.kernels.wedge_sides import WedgeSides, wedge_sides

# Neighbours whose normals turn by less are of one face for sure; by less than LOOSE, they have a say.
SAFE, LOOSE = np.cos(np.radians(20.0)), np.cos(np.radians(50.0))
# Directions in which the outermost points are looked for: those to the faces, edges and corners of a cube.
_CUBE = np.array([(x, y, z) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0) if (x, y, z) != (0.0, 0.0, 0.0)])
_DIRECTIONS = _CUBE / np.linalg.norm(_CUBE, axis=1, keepdims=True)
# What a crease says counts as much as so many links.
CREASE_WEIGHT = 4.0


class Creases(NamedTuple):
    """Places where two faces meet: foot points (M, 3), unit directions (M, 3), turns (M,) in radians, and the radius to look at."""

    foot: NDArray[np.float64]
    direction: NDArray[np.float64]
    turn: NDArray[np.float64]
    radius: float


@dataclass(frozen=True)
class Orientation:
    """Oriented normals, in the order of the sorted points.

    Attributes
    ----------
    normal : (N, 3) float64
        Unit normals that point outwards; NaN where unknown, as on the edges themselves.
    group : (N,) int32
        Connected surface of each point; −1 where its normal is unknown. Whether two groups agree is not known.
    sides : WedgeSides
        The faces at each crease, with cosines against the oriented normals.
    agreement : (M,) float64
        How far both faces of a crease agree on its kind, in [0, 1].
    """

    normal: NDArray[np.float64]
    group: NDArray[np.int32]
    sides: WedgeSides
    agreement: NDArray[np.float64]


def orient_normals(
    cells: Cells, normals: NDArray[np.float64], neighbours: NDArray[np.int32], doubtful: NDArray[np.bool_], creases: Creases, noise: float
) -> Orientation:
    """Give all normals a sign.

    Parameters
    ----------
    cells : Cells
        The sorted points.
    normals : (N, 3) float64
        Unit normals as lines, best one-sided, in sorted order; NaN where unknown.
    neighbours : (N, k) int32
        A few nearest neighbours of each sorted point; −1 where there is none.
    doubtful : (N,) bool
        Points whose normals may belong to either of two faces, as on edges: they take no part.
    creases : Creases
        Where faces meet sharply.
    noise : float
        Standard deviation of the points across the surface.

    Notes
    -----
    Signs spread within smooth patches over links between nearly parallel normals. Patches are then joined by a maximum spanning tree
    (Hoppe et al. 1992, with patches for points) whose weights are sums of votes. Across a crease the angle between two normals says
    nothing about their signs, since the dihedral angle is no smaller than it is large. But the two faces' directions from the crease do:
    both outward normals point to the other face's side where the edge is concave, neither does where it is convex. Each crease point
    votes by that. Last, every group is turned so that normals point outwards where it reaches farthest.
    """
    known = np.isfinite(normals[:, 0])
    component, sign = flood_signs(neighbours, normals, known & ~doubtful, float(SAFE))
    signed = normals.copy()
    turn_rows(signed, np.where(sign == 0, np.nan, sign))
    sides = wedge_sides(cells, signed, component, creases.foot, creases.direction, creases.turn, creases.radius, noise)
    n = int(component.max(initial=-1)) + 1
    votes = _votes(component, signed, neighbours, sides, n)
    flip, group_of = _join(votes, n)
    turn_rows(signed, np.where(component >= 0, flip[component], np.nan))
    group = np.where(component >= 0, group_of[component], -1).astype(np.int32)
    outwards = outward_signs(cells.points, signed, group, _DIRECTIONS)
    factor = np.where(sides.component >= 0, (flip * outwards[group_of])[sides.component], np.nan)
    turn_rows(signed, np.where(group >= 0, outwards[group], np.nan))
    towards = sides.towards * factor
    with np.errstate(invalid="ignore"):
        agreement = np.nan_to_num(np.abs(towards.sum(axis=1)) / 2.0)
    return Orientation(signed, group, sides._replace(towards=towards), agreement)


def _votes(
    component: NDArray[np.int32], normals: NDArray[np.float64], neighbours: NDArray[np.int32], sides: WedgeSides, n: int
) -> csr_array:
    """Sum what links and creases say about the signs of two components: positive where they agree."""
    rows, columns, values = [], [], []
    between = between_components(component, neighbours)
    for beside in neighbours[between].T:
        across = (beside >= 0) & (component[beside] >= 0) & (component[between] != component[beside])
        here, there = between[across], beside[across]
        cosine = np.einsum("nc,nc->n", normals[here], normals[there])
        loose = np.abs(cosine) > LOOSE
        rows.append(component[here[loose]])
        columns.append(component[there[loose]])
        values.append(cosine[loose])
    a, b = sides.component.T
    both = (a >= 0) & (b >= 0) & (a != b)
    rows.append(a[both])
    columns.append(b[both])
    values.append(CREASE_WEIGHT * sides.towards[both, 0] * sides.towards[both, 1])
    votes = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)).tocsr()
    return csr_array(votes + votes.T)


def _join(votes: csr_array, n: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the sign of each component, alike over its group, and the group."""
    if n == 0:
        return np.ones(1), np.zeros(1, np.int32)
    # The strongest votes make the tree; csgraph looks for the least sum, and takes 0 for no link.
    weights = votes.copy()
    weights.data = 1.0 / (1.0 + np.abs(votes.data))
    tree = minimum_spanning_tree(weights)
    tree = csr_array(tree + tree.T)
    _, group = connected_components(tree, directed=False)
    # One more node holds the first of every group, so that a single walk visits all.
    _, first = np.unique(group, return_index=True)
    roots = coo_array((np.ones(len(first)), (np.full(len(first), n), first)), shape=(n + 1, n + 1))
    tree.resize((n + 1, n + 1))
    order, before = breadth_first_order(csr_array(tree + roots.tocsr()), n, directed=False)
    below = order[before[order] != n][1:]
    alike = np.ones(n + 1)
    said: Any = votes[before[below], below] if len(below) else np.zeros(0)
    alike[below] = np.where((said.toarray() if issparse(said) else np.asarray(said)).ravel() >= 0.0, 1.0, -1.0)
    sign = np.ones(n + 1)
    for node in below:
        sign[node] = sign[before[node]] * alike[node]
    return sign[:n], group.astype(np.int32)
