"""Ways to sample all of a part without a scanner: nothing is hidden, nothing missing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.cad import CadPart
from scan2nurbs.kernels.raster import collect_range, count_range
from scan2nurbs.kernels.runner import run_ranges
from scan2nurbs.simulate.params import SimulateParams
from scan2nurbs.simulate.samples import Samples

_TRIANGLES = 1024
"""Triangles a range."""


def sample_grid(part: CadPart, pitch: float, params: SimulateParams) -> Samples:
    """Sample by jittered rasters along the three axes; each triangle takes the one along which it is largest."""
    normal = _normals(part)
    axis = np.abs(normal).argmax(axis=1)
    rng = np.random.default_rng([params.seed, 3])
    pieces = []
    for k in range(3):
        others = [c for c in range(3) if c != k]
        shift = rng.random(2)
        seed = int(rng.integers(2**62))
        chosen = np.flatnonzero(axis == k)
        flat = np.zeros((len(chosen), 3, 3))
        # From the part's own corner: coordinates far from zero would lose the raster's digits.
        flat[..., :2] = (part.corners[chosen][..., others] - part.corners.min(axis=(0, 1))[others]) / pitch + shift
        triangle, weight = _collect(flat, seed, params.jitter)
        triangle = chosen[triangle]
        pieces.append(_without_rays(triangle, weight, normal, pitch**2 / np.abs(normal[triangle, k])))
    return Samples.join(pieces)


def _collect(flat: NDArray[np.float64], seed: int, jitter: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    count = np.zeros(len(flat), np.int64)

    def tally(start: int, stop: int) -> None:
        count_range(flat, seed, jitter, start, stop, count)

    run_ranges(tally, len(flat), size=_TRIANGLES)
    first = np.concatenate([[0], np.cumsum(count)])
    weight = np.empty((int(first[-1]), 3))

    def fill(start: int, stop: int) -> None:
        collect_range(flat, seed, jitter, first, start, stop, weight)

    run_ranges(fill, len(flat), size=_TRIANGLES)
    return np.repeat(np.arange(len(flat)), count), weight


def sample_random(part: CadPart, pitch: float, params: SimulateParams) -> Samples:
    """Sample uniformly at random, one point to every pitch²."""
    rng = np.random.default_rng([params.seed, 3])
    area = part.triangle_area
    n = max(1, round(area.sum() / pitch**2))
    triangle = np.searchsorted(np.cumsum(area), rng.random(n) * area.sum()).clip(max=len(area) - 1)
    square = rng.random((n, 2))
    square = np.where(square.sum(axis=1, keepdims=True) > 1, 1 - square, square)
    weight = np.column_stack([1 - square.sum(axis=1), square])
    return _without_rays(triangle, weight, _normals(part), np.full(n, area.sum() / n))


def sample_uneven(part: CadPart, pitch: float, params: SimulateParams) -> Samples:
    """Sample at random with a density that swings between one and a sixth of its largest, in waves about the size of the part."""
    # On average 58 percent are kept; `pitch` stays about the mean one.
    samples = sample_random(part, pitch * np.sqrt(0.58), params)
    low, high = part.corners.min(axis=(0, 1)), part.corners.max(axis=(0, 1))
    place = (samples.positions(part.corners) - low) / (high - low).max() * 2 * np.pi
    wave = 0.5 + 0.5 * np.sin(1.3 * place[:, 0] + 0.7) * np.cos(1.7 * place[:, 1] + place[:, 2])
    kept = np.random.default_rng([params.seed, 4]).random(len(samples)) < 0.16 + 0.84 * wave
    samples = samples[kept]
    samples.area[:] = part.area / max(len(samples), 1)
    return samples


def _normals(part: CadPart) -> NDArray[np.float64]:
    normal = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _without_rays(
    triangle: NDArray[np.int64], weight: NDArray[np.float64], normal: NDArray[np.float64], area: NDArray[np.float64]
) -> Samples:
    return Samples(triangle, weight, np.full(len(triangle), -1, np.int16), normal[triangle], area)
