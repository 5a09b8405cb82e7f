"""A ball that rolls along the corner of two faces: how far points lie from the fillet that it leaves, and where that ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from scan2nurbs.kernels.growth import DISTANCE_CAP

STEP = 1.15
RADII = 0.9 * STEP ** np.arange(16)
"""Radii to try, in h: smaller fillets are as good as sharp at any noise, larger ones are found like every other face."""
FINER = np.array([-0.5, -0.25, 0.25, 0.5])
"""Radii tried about the best one, in steps of `RADII`."""
LEAST_TURN = 25.0
"""Degrees: faces that turn by less are no corner."""
AHEAD, SLANT = 1.0, 0.5
"""How far ahead of the nearest point of a strip points still lie beside it: so many h, and such a share of how far aside they are."""
FEWER = 3.0
"""A ball's radius is one number, a strip's own surface has some seven: the others may explain so much more, times the log of its points."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Corner:
    """Points about the corner of two faces, in units of h: distances from both, positive on the side where the other face lies.

    Attributes
    ----------
    u, v : (N,) float64
        Distances from the first face and from the second.
    cosine : (N,) float64
        Of the angle between the directions in which they grow.
    directions : two (N, 3) float64
        These directions.

    Notes
    -----
    In the plane across the corner the ball's centre is as far from both faces as its radius r. A point between the two lines of contact
    is off the fillet by sqrt((a² + b² − 2abc) / (1 − c²)) − r, with a, b its distances from both faces less r and c the cosine between
    their normals.
    """

    u: Floats
    v: Floats
    cosine: Floats
    directions: tuple[Floats, Floats]

    def beside(self, points: Floats, strip: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tell which of the points (N, 3), in h, lie beside some of a strip, and not ahead of its ends, where a fillet may end too (N,)."""
        along = np.cross(*self.directions)
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        way = points - points[strip][KDTree(points[strip]).query(points)[1]]
        ahead = np.abs(np.einsum("ij,ij->i", way, along))
        return ahead <= AHEAD + SLANT * np.sqrt(np.maximum(np.einsum("ij,ij->i", way, way) - ahead**2, 0.0))

    def at(self, rows: NDArray[np.bool_]) -> Corner:
        """Return the corner of some of the points."""
        m1, m2 = self.directions
        return Corner(self.u[rows], self.v[rows], self.cosine[rows], (m1[rows], m2[rows]))

    @property
    def sharp(self) -> Floats:
        """How far points lie from the nearer of the two faces (N,)."""
        return np.minimum(np.abs(self.u), np.abs(self.v))

    def off(self, radius: float) -> Floats:
        """Return how far points lie from the fillet (N,)."""
        a, b, c = self.u - radius, self.v - radius, self.cosine
        return np.sqrt(np.maximum(a * a + b * b - 2.0 * a * b * c, 0.0) / (1.0 - c * c)) - radius

    def zone(self, radius: float, margin: float = 0.0) -> NDArray[np.bool_]:
        """Tell which points lie between the two lines of contact (N,)."""
        reach = radius * (1.0 - self.cosine) + margin
        return (self.u < reach) & (self.v < reach)

    def off_bevel(self, radius: float) -> Floats:
        """Return how far points lie from the flat bevel that ends in the same lines (N,)."""
        return (self.u + self.v - radius * (1.0 - self.cosine)) / np.sqrt(2.0 + 2.0 * self.cosine)

    def best_radius(self, now: Floats, sigma: float) -> tuple[float, float]:
        """Return the radius of the ball that explains the points best, and by how much better than they are now.

        Parameters
        ----------
        now : (N,) float64
            Distances from the surfaces that points have without a fillet.
        sigma : float
            Noise; costs are half squares in it, up to `DISTANCE_CAP`.
        """
        return self._best(self.off, now, sigma)

    def radius_of_strip(self, now: Floats, sigma: float, n_points: int) -> float | None:
        """Return the radius if a ball explains a strip of so many points about as well as its own surface, and better than a bevel."""
        radius, gain = self._best(self.off, now, sigma)
        return radius if gain >= -FEWER * np.log(n_points) and gain > self._best(self.off_bevel, now, sigma)[1] else None

    def _best(self, off: Callable[[float], Floats], now: Floats, sigma: float) -> tuple[float, float]:
        def cost(residual: Floats) -> float:
            return float(np.minimum(0.5 * (residual / sigma) ** 2, DISTANCE_CAP).sum())

        sharp = self.sharp

        def between(radius: float) -> float:
            return cost(np.where(self.zone(radius), off(radius), sharp))

        costs = {radius: between(radius) for radius in RADII.tolist()}
        best = min(costs, key=lambda radius: costs[radius])
        costs |= {radius: between(radius) for radius in (best * STEP**FINER).tolist()}
        best = min(costs, key=lambda radius: costs[radius])
        return best, cost(now) - costs[best]


def corner_of(first: Floats, second: Floats, side: NDArray[np.integer]) -> Corner | None:
    """Return the corner of two faces; None where they hardly turn.

    Parameters
    ----------
    first, second : (N, 4) float64
        Signed distance from the surface of either face, and its gradient.
    side : (N,) int
        0 for points of the first face, 1 for those of the second, 2 for those between them.
    """
    s1, s2 = np.sign(np.median(first[side == 1, 0])), np.sign(np.median(second[side == 0, 0]))
    m1, m2 = s1 * first[:, 1:], s2 * second[:, 1:]
    cosine = np.clip(np.einsum("ij,ij->i", m1, m2), -0.98, 0.98)
    if np.median(np.abs(cosine)) > np.cos(np.radians(LEAST_TURN)):
        return None
    return Corner(s1 * first[:, 0], s2 * second[:, 0], cosine, (m1, m2))
