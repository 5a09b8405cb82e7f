"""What a fit of a shape returns."""

from __future__ import annotations

from dataclasses import dataclass

from scan2nurbs.surfaces.shape import Floats, Shape
from scan2nurbs.surfaces.shape_parameters import uncertainty


@dataclass(frozen=True)
class ShapeFit:
    """A fitted shape and how well it is known.

    Attributes
    ----------
    shape : Shape
    n_points : int
        Points that it was fitted to.
    rms : float
        Root mean square of the distances of the points within 4.7 standard deviations; in the points' unit.
    covariance : (freedom, freedom) float64 or None
        Of the parameters in the order that `shape_parameters` documents, at the noise given; None for splines.
    criterion : float
        Σ ρ(d/σ) + freedom · log n, lower is better; what `choose_shape` compares.
    notes : tuple of str
        What the caller should know, one sentence each.
    tolerance : float, optional
        How far the shape may lie from the points besides their noise, where that was asked for; in the points' unit.
    """

    shape: Shape
    n_points: int
    rms: float
    covariance: Floats | None
    criterion: float
    notes: tuple[str, ...] = ()
    tolerance: float | None = None

    @property
    def uncertainty(self) -> dict[str, float]:
        """Standard deviations by name; see `shape_parameters.uncertainty`."""
        return uncertainty(self.shape, self.covariance)
