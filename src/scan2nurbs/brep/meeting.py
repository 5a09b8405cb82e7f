"""Where two surfaces meet: points near a border are drawn onto it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.surfaces.shape import Kind, Shape, cross, unit

Floats = NDArray[np.float64]

CROSSING = np.sin(np.radians(9.0))
"""Surfaces at a larger angle cross; at a smaller one they touch."""

_STEPS = 12
_REACH = 2.0
_TOUCH_REACH = 4.0
_TURN = 0.02
_STEEP = np.sin(np.radians(30.0))
_CLOSE = 0.12
_TOUCHES = 6


@dataclass(frozen=True)
class Loose:
    """Stands for a surface where a border has lost both of its faces: everything lies on it."""

    kind: ClassVar[Kind] = "plane"
    freedom: int = 0

    def distance(self, points: Floats) -> Floats:
        """Return zeros (N,)."""
        return np.zeros(len(points))

    def normal(self, points: Floats) -> Floats:
        """Return any unit vectors (N, 3)."""
        return np.tile([0.0, 0.0, 1.0], (len(points), 1))

    def distance_and_normal(self, points: Floats) -> tuple[Floats, Floats]:
        """Return both."""
        return self.distance(points), self.normal(points)

    def foot(self, points: Floats) -> Floats:
        """Return the points themselves."""
        return points


@dataclass(frozen=True)
class Meeting:
    """Two surfaces along a border, or one at a free border.

    Attributes
    ----------
    shapes : tuple of Shape
        One or two.
    h : float
        Spacing of the cloud, the unit of how far points may be drawn.
    """

    shapes: tuple[Shape, ...]
    h: float

    def gap(self, points: Floats) -> Floats:
        """Return the largest distance (N,) of points (N, 3) to the surfaces."""
        return np.max([np.abs(shape.distance(points)) for shape in self.shapes], axis=0)

    def sine(self, points: Floats) -> Floats:
        """Return the sine (N,) of the angle between the two surfaces; 0 at a free border."""
        if len(self.shapes) < 2:
            return np.zeros(len(points))
        return np.linalg.norm(cross(self.shapes[0].normal(points), self.shapes[1].normal(points)), axis=1)

    def middle(self, points: Floats, steps: int = 3) -> Floats:
        """Draw points along the common normal onto the middle between the surfaces."""
        for _ in range(steps):
            move = np.zeros_like(points)
            for shape in self.shapes:
                distance, normal = shape.distance_and_normal(points)
                move -= distance[:, None] * normal / len(self.shapes)
            points = points + move
        return points

    def cross(self, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Draw points onto the intersection of the two surfaces by shortest steps; also tell which of them arrived.

        Notes
        -----
        Newton's method for two equations in three unknowns: the step of least length (Moore-Penrose) solves both linearised
        distances; points that would go further than 2 h have no intersection near.
        """
        start, points = points, points.copy()
        first, second = self.shapes
        for _ in range(_STEPS):
            (d1, n1), (d2, n2) = first.distance_and_normal(points), second.distance_and_normal(points)
            c = (n1 * n2).sum(axis=1)
            det = np.maximum(1.0 - c**2, 1e-6)
            move = ((c * d2 - d1) / det)[:, None] * n1 + ((c * d1 - d2) / det)[:, None] * n2
            length = np.linalg.norm(move, axis=1)
            points += move * np.minimum(1.0, self.h / np.maximum(length, 1e-300))[:, None]
            if length.max(initial=0.0) < 1e-13 * self.h:
                break
        arrived = (self.gap(points) < 1e-6 * self.h) & (np.linalg.norm(points - start, axis=1) <= _REACH * self.h)
        return points, arrived & (self.sine(points) >= CROSSING)

    def touch(self, points: Floats, along: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Draw points onto the line where two surfaces touch: where they are parallel across it.

        Parameters
        ----------
        points : (N, 3) float64
        along : (N, 3) float64
            Unit directions of the border.

        Returns
        -------
        points : (N, 3) float64
            In the middle between the surfaces.
        found : (N,) bool
            Whether there is such a line near: the surfaces turn against each other across the border.
        """
        start = points = self.middle(points)
        first, second = self.shapes
        across = unit(cross(first.normal(points), along))
        step = 0.5 * self.h
        good = np.ones(len(points), bool)
        for _ in range(_TOUCHES):
            # Both normals at three places across the border: how they turn against each other is zero on the line of contact.
            at = np.concatenate([points - step * across, points, points + step * across])
            n1, n2 = first.normal(at), second.normal(at)
            side = np.where(np.einsum("nk,nk->n", n1, n2) < 0, -1.0, 1.0)
            slope = np.einsum("snk,nk->sn", (n1 - side[:, None] * n2).reshape(3, -1, 3), across)
            turn = (slope[2] - slope[0]) / (2.0 * step)
            clear = np.abs(turn) * self.h > _TURN
            good &= clear
            move = np.clip(np.divide(-slope[1], turn, out=np.zeros_like(turn), where=clear), -self.h, self.h)
            points = self.middle(points + move[:, None] * across, 1)
            if np.abs(move).max(initial=0.0) < 1e-4 * self.h:
                break
        points = self.middle(points, 2)
        good &= np.linalg.norm(points - start, axis=1) <= _TOUCH_REACH * self.h
        return np.where(good[:, None], points, start), good

    def draw(self, points: Floats, along: Floats) -> tuple[Floats, NDArray[np.int8]]:
        """Draw points onto the border, each as well as the surfaces allow there.

        Returns
        -------
        points : (N, 3) float64
        how : (N,) int8
            2 on the intersection, 1 on the line of contact, 0 in the middle between the surfaces, where they were.
        """
        if len(self.shapes) < 2:
            return self.middle(points), np.zeros(len(points), np.int8)
        touched, found = points, np.zeros(len(points), bool)
        near = self.sine(points) < _STEEP
        if near.any():
            touched, found = self.touch(points, along)
            # Surfaces that touch but for the uncertainty of their fits may cross on either side of their line of contact.
            sure = found & near & (self.gap(touched) <= _CLOSE * self.h)
            if sure.mean() > 0.5:
                return touched, sure.astype(np.int8)
        crossed, arrived = self.cross(points)
        how = np.where(arrived, 2, np.where(found, 1, 0)).astype(np.int8)
        return np.where(arrived[:, None], crossed, touched), how
