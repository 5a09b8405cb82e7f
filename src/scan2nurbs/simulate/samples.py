"""Places on a part's triangles that a scan measures, before anything disturbs them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Samples:
    """Places on the triangles of a `CadPart`.

    Attributes
    ----------
    triangle : (N,) int64
        Rows of ``CadPart.corners``.
    weight : (N, 3) float64
        Barycentric weights there.
    view : (N,) int16
        The view that measures each; −1 in the modes without rays.
    ray : (N, 3) float64
        Unit direction of the ray, towards the scanner; the triangle's normal in the modes without rays.
    area : (N,) float64
        The area of surface that each stands for.
    """

    triangle: NDArray[np.int64]
    weight: NDArray[np.float64]
    view: NDArray[np.int16]
    ray: NDArray[np.float64]
    area: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.triangle)

    def __getitem__(self, rows: Any) -> Samples:
        return Samples(self.triangle[rows], self.weight[rows], self.view[rows], self.ray[rows], self.area[rows])

    def positions(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the places on the triangles, (N, 3)."""
        return np.einsum("nkc,nk->nc", corners[self.triangle], self.weight)

    @staticmethod
    def join(parts: list[Samples]) -> Samples:
        """Return several samples as one."""
        return Samples(*(np.concatenate([getattr(part, name) for part in parts]) for name in Samples.__dataclass_fields__))
