"""How time and memory grow: ratios of processor time, never seconds."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable

import numpy as np

from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.moments import ball_planes
from scan2nurbs.scale import measure_scale


def sheet(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    xy = rng.random((n, 2)) * np.sqrt(n)
    return np.c_[xy, 3.0 * np.sin(xy[:, 0] / 40.0)]


def processor_time(work: Callable[[], object]) -> float:
    work()  # compiles
    least = np.inf
    for _ in range(3):
        start = time.process_time()
        work()
        least = min(least, time.process_time() - start)
    return least


def test_cost_does_not_grow_with_the_radius():
    cells = build_cells(sheet(60_000), 5.7)
    at = {radius: processor_time(lambda r=radius: ball_planes(cells, r, sectors=4, only_normals=True)) for radius in (15.0, 60.0)}
    # Sixteen times as many neighbours; summing each would take about twelve times as long.
    assert at[60.0] < 3.0 * at[15.0]


def test_time_grows_with_the_number_of_points():
    small, large = (build_cells(sheet(n), 5.7) for n in (20_000, 160_000))
    times = [processor_time(lambda c=cells: ball_planes(c, 8.0, only_normals=True)) for cells in (small, large)]
    assert times[1] < 16.0 * times[0]


def test_planes_and_spacing_take_few_bytes_a_point():
    points = sheet(400_000)
    cells = build_cells(points, 5.7)
    measure_scale(points[:2000])
    for work, most in ((lambda: ball_planes(cells, 8.0, sectors=4, only_normals=True), 50), (lambda: measure_scale(points), 200)):
        work()
        tracemalloc.start()
        result = work()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak / len(points) < most, result
