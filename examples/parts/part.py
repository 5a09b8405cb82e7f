"""What every example part declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from scan2nurbs.brep.cad import CadPart, tessellate
from scan2nurbs.simulate import SimulateParams

FROM_ABOVE = {"views": 9, "spread": 50.0}
"""The scanner looks from above in a cone, so that walls are seen too, obliquely."""


@dataclass(frozen=True)
class Part:
    """An example part.

    Attributes
    ----------
    name : str
    description : str
        What it is good for, one sentence.
    model : callable
        Makes the ``TopoDS_Shape``, in millimetres.
    seed : (float, float, float)
        A point on the functional surface, away from its border.
    n_points : int
        Size of a fitting scan.
    scan : dict
        How it is scanned: values for `SimulateParams`.
    """

    name: str
    description: str
    model: Callable[[], Any]
    seed: tuple[float, float, float]
    n_points: int = 40_000
    scan: dict[str, Any] = field(default_factory=lambda: dict(FROM_ABOVE))

    def build(self) -> Any:
        """Return the shape."""
        return self.model()

    def functional_faces(self, shape: Any) -> tuple[int, ...]:
        """Return the ids of the faces (of a shape or `CadPart`) that make up the functional surface."""
        part = shape if isinstance(shape, CadPart) else tessellate(shape)
        return (part.nearest_face(self.seed),)

    def params(self, **changes: Any) -> SimulateParams:
        """Return the parameters of its scan, with changes."""
        given = {"n_points": self.n_points, **self.scan, **changes}
        return SimulateParams(**given)
