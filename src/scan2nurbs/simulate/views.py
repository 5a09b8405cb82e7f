"""From where a scanner looks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.simulate.params import SimulateParams

_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


def view_directions(params: SimulateParams) -> NDArray[np.float64]:
    """Return the unit directions towards the scanner, (V, 3).

    A number of views is spread over the cap by a spiral whose turns hold equal areas: the first looks from `up`, the last lies on the
    cap's rim (Fibonacci lattice).
    """
    if not isinstance(params.views, int):
        return _unit(np.asarray(params.views, dtype=np.float64))
    n = params.views
    height = 1.0 - np.linspace(0.0, 1.0, n) * (1.0 - math.cos(math.radians(params.spread)))
    turn = _GOLDEN * np.arange(n)
    radius = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    local = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return _unit(local @ view_frame(_unit(np.asarray(params.up, dtype=np.float64))))


def view_frame(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a right-handed frame as rows x, y, z, with z the unit direction and x level where that is defined."""
    reference = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    x = np.cross(reference, direction)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(direction, x), direction])


def tilted(direction: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """Turn a view direction sideways by an angle: where the projector stands."""
    x, _, z = view_frame(direction)
    return math.cos(math.radians(degrees)) * z + math.sin(math.radians(degrees)) * x


def _unit(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)
