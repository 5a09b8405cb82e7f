"""The scanner: a raster of parallel rays from every view, into a depth buffer each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.cad import CadPart
from scan2nurbs.errors import ParameterError
from scan2nurbs.kernels.raster import depth_range, measured_range, weights_range
from scan2nurbs.kernels.runner import run_ranges
from scan2nurbs.simulate.params import SimulateParams
from scan2nurbs.simulate.samples import Samples
from scan2nurbs.simulate.views import tilted, view_directions, view_frame

_ROWS = 64
"""Rows of pixels a range."""

_RANGE = 65_536
"""Points a range."""

_MOST_PIXELS = 2**31
"""Pixels of all views together; 4 bytes each."""


@dataclass(frozen=True)
class _Maps:
    """The depth maps of all views (and of their projectors after them), one after the other in `depth`; see `measured_range`."""

    frames: NDArray[np.float64]
    low: NDArray[np.float64]
    shape: NDArray[np.int64]
    offset: NDArray[np.int64]
    depth: NDArray[np.float32]
    hit: list[NDArray[np.int32]]
    pitch: float


def scan_views(part: CadPart, pitch: float, params: SimulateParams) -> Samples:
    """Return what the scanner measures with rays `pitch` apart (in the part's unit).

    Notes
    -----
    With parallel rays a surface at the incidence θ is sampled at 1 / cos θ of the density it has when seen squarely.
    """
    directions = view_directions(params)
    box = part.corners.reshape(-1, 3)
    corners = part.corners - 0.5 * (box.min(axis=0) + box.max(axis=0))
    eyes = len(directions)
    projectors = [tilted(d, params.parallax) for d in directions] if params.parallax > 0 else []
    frames = np.stack([view_frame(d) for d in (*directions, *projectors)])
    maps = _render(corners, frames, eyes, pitch, params)
    rng = np.random.default_rng([params.seed, 1])
    return Samples.join([_measure(part, corners, maps, view, eyes, params, rng) for view in range(eyes)])


def _render(corners: NDArray[np.float64], frames: NDArray[np.float64], eyes: int, pitch: float, params: SimulateParams) -> _Maps:
    flat = np.einsum("vac,nc->vna", frames[:, :2], corners.reshape(-1, 3))
    low = flat.min(axis=1) - 2 * pitch
    shape = np.ceil((flat.max(axis=1) + 2 * pitch - low) / pitch)[:, ::-1]
    if shape.prod(axis=1).sum() > _MOST_PIXELS:
        raise ParameterError("The scan is too fine for this part: its views would need more than 2^31 rays. Ask for fewer points or views.")
    shape = shape.astype(np.int64)
    offset = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
    store, hits = np.empty(offset[-1], np.float32), []
    for view, frame in enumerate(frames):
        depth, hit = _depth_map(_in_pixels(corners, frame, low[view], pitch), tuple(shape[view]), params, view)
        store[offset[view] : offset[view + 1]] = depth.ravel()
        if view < eyes:
            hits.append(hit)
    return _Maps(frames, low, shape, offset, store, hits, pitch)


def _in_pixels(corners: NDArray[np.float64], frame: NDArray[np.float64], low: NDArray[np.float64], pitch: float) -> NDArray[np.float64]:
    seen = corners @ frame.T
    return np.concatenate([(seen[..., :2] - low) / pitch, -seen[..., 2:]], axis=2)


def _depth_map(
    triangles: NDArray[np.float64], shape: tuple[int, ...], params: SimulateParams, view: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    depth, hit = np.full(shape, np.inf), np.full(shape, -1, np.int32)

    def work(start: int, stop: int) -> None:
        depth_range(triangles, _ray_seed(params, view), params.jitter, start, stop, depth, hit)

    run_ranges(work, shape[0], size=_ROWS)
    return depth, hit


def _ray_seed(params: SimulateParams, view: int) -> int:
    return int(np.random.default_rng([params.seed, 2, view]).integers(2**62))


def _measure(
    part: CadPart,
    corners: NDArray[np.float64],
    maps: _Maps,
    view: int,
    eyes: int,
    params: SimulateParams,
    rng: np.random.Generator,
) -> Samples:
    """Return what one view measures of what it sees."""
    hit = maps.hit[view].ravel()
    pixel = np.flatnonzero(hit >= 0)
    triangle = hit[pixel].astype(np.int64)
    weight = np.empty((len(pixel), 3))
    flat = _in_pixels(corners, maps.frames[view], maps.low[view], maps.pitch)
    columns, seed = int(maps.shape[view, 1]), _ray_seed(params, view)

    def weigh(start: int, stop: int) -> None:
        weights_range(flat, seed, params.jitter, columns, pixel, triangle, start, stop, weight)

    run_ranges(weigh, len(pixel), size=_RANGE)
    side = np.einsum("nkc,nk->nc", part.normals[triangle], weight)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    cosine = side @ maps.frames[view, 2]
    # An open shell shows its inside too: the scanner measures whichever side it sees.
    side[cosine < 0] *= -1.0
    cosine = np.maximum(np.abs(cosine), 1e-6)
    kept = _by_incidence(cosine, params, rng)
    triangle, weight, side, cosine = triangle[kept], weight[kept], side[kept], cosine[kept]
    points, measured = np.einsum("nkc,nk->nc", corners[triangle], weight), np.empty(len(triangle), np.bool_)
    sheet = np.array([not face.solid for face in part.faces])[part.face[triangle]]
    limit = math.cos(math.radians(params.grazing_limit))
    fields = (maps.frames, maps.low, maps.shape, maps.offset, maps.depth, maps.pitch)

    def decide(start: int, stop: int) -> None:
        thin, projectors = params.overlap == "thin", len(maps.frames) > eyes
        measured_range(points, side, sheet, view, limit, eyes, projectors, thin, *fields, start, stop, measured)

    run_ranges(decide, len(points), size=_RANGE)
    count = int(measured.sum())
    return Samples(
        triangle=triangle[measured],
        weight=weight[measured],
        view=np.full(count, view, np.int16),
        ray=np.broadcast_to(maps.frames[view, 2], (count, 3)),
        area=maps.pitch**2 / cosine[measured],
    )


def _by_incidence(cosine: NDArray[np.float64], params: SimulateParams, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw which rays come back: all up to the fade, none beyond the limit."""
    incidence = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    if params.grazing_fade == 0:
        return incidence <= params.grazing_limit
    return rng.random(len(incidence)) < (params.grazing_limit - incidence) / params.grazing_fade
