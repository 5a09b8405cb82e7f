"""Tell the pieces of freeform faces from designed primitives: away from its border, one of these leaves noise and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.contacts import Contacts
from scan2nurbs.surfaces.explain import study
from scan2nurbs.surfaces.shape import Shape
from scan2nurbs.surfaces.shape_fit import ShapeFit
from scan2nurbs.surfaces.shape_parameters import SPHERE, Pose, Primitive, pose

RINGS = 3
"""So many rings of points from their border are not asked: some are a neighbour's."""
LEAST = 100
"""Fewer points amid a piece tell nothing of it."""
STRAY = 1e-5
"""Chance below which what a primitive leaves is no noise; among hundreds of designed faces the least was a thousandth."""
SOUND = 1e-2
"""Chance above which nothing speaks against a primitive."""
WEIGHTY = 0.5
"""That counts for a piece with so many times the points that speak against its neighbour."""
PARALLEL = np.cos(np.radians(3.0))
"""Axes nearer to each other are one direction, ..."""
APART = 1.0
"""... and one line if no more than so many h lie between them."""


@dataclass(frozen=True)
class Amid:
    """What is amid the pieces.

    Attributes
    ----------
    chance : (M,) float64
        That noise leaves as much as the points do; 1 where it is not known.
    count : (M,) int64
        Points that were asked.
    """

    chance: NDArray[np.float64]
    count: NDArray[np.int64]

    def astray(self, piece: int) -> bool:
        """Tell whether a piece is none of the design: its primitive leaves more than noise."""
        return bool(self.chance[piece] < STRAY)

    def likely(self, pair: tuple[int, int]) -> bool:
        """Tell whether one of two pieces is astray, and the other, though it may be well explained, too small to count against that."""
        sound = (self.chance > SOUND) & (self.count > 0)
        return any(self.astray(a) and not (sound[b] and self.count[b] >= WEIGHTY * self.count[a]) for a, b in (pair, pair[::-1]))


def look_amid(points: NDArray[np.float64], label: NDArray[np.int32], fits: tuple[ShapeFit, ...], contacts: Contacts, noise: float) -> Amid:
    """Look at what the pieces leave of their points.

    Parameters
    ----------
    points : (N, 3) float64
    label : (N,) int32
        Piece of every point; −1 = none.
    fits : tuple of ShapeFit
        Of each piece.
    contacts : Contacts
        Of the same points.
    noise : float
        Standard deviation across the surface.
    """
    near = contacts.neighbours
    border = (label[near] != label[:, None]).any(axis=1)
    for _ in range(RINGS - 1):
        border |= border[near].any(axis=1)
    amid = np.flatnonzero(~border & (label >= 0))
    order = amid[np.argsort(label[amid], kind="stable")]
    count = np.bincount(label[order], minlength=len(fits))
    chance = np.ones(len(fits))
    for m, mine in enumerate(np.split(order, np.cumsum(count)[:-1])):
        if len(mine) >= LEAST:
            shape = fits[m].shape
            chance[m] = study(shape.foot(points[mine]), shape.distance(points[mine]), noise).chance
    return Amid(chance, np.where(count >= LEAST, count, 0))


def one_sweep(one: Shape, other: Shape, near: NDArray[np.float64], h: float) -> bool:
    """Tell whether two surfaces are primitives that may belong to one profile, revolved about the axis of both or drawn along it.

    Parameters
    ----------
    one, other : Shape
    near : (3,) float64
        A place on their border: far from it axes part.
    h : float
        Spacing of the points.
    """
    if not (isinstance(one, Primitive) and isinstance(other, Primitive)):
        return False
    poses = [pose(one), pose(other)]
    axes = [(k.frame[:3], k.frame[9:]) for k in poses if k.kind != SPHERE]
    if len(axes) < 2:
        return len(axes) == 1 and _from_line(*axes[0], _centre(poses)) <= APART * h
    flat = [shape.kind == "plane" for shape in (one, other)]
    cosine = abs(float(axes[0][1] @ axes[1][1]))
    if any(flat):
        curved = (one, other)[int(flat[0])]
        along = curved.kind == "cylinder" and cosine < np.sqrt(1.0 - PARALLEL**2)
        return bool(not all(flat) and (cosine > PARALLEL or along))
    if cosine <= PARALLEL:
        return False
    along = float((near - axes[0][0]) @ axes[0][1])
    beside = axes[0][0] + along * axes[0][1]
    return one.kind == other.kind == "cylinder" or _from_line(*axes[1], beside) <= APART * h


def _centre(poses: list[Pose]) -> NDArray[np.float64]:
    return next(k.frame[:3] for k in poses if k.kind == SPHERE)


def _from_line(origin: NDArray[np.float64], axis: NDArray[np.float64], place: NDArray[np.float64]) -> float:
    offset = place - origin
    return float(np.linalg.norm(offset - (offset @ axis) * axis))
