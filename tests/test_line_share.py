"""Points on curves are refused; points on surfaces, however scanned, are not taken for them."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.errors import NoResultError
from scan2nurbs.pipeline import reconstruct_surface
from scan2nurbs.scale import line_share, measure_scale


def tube_vertices(n: int = 200) -> np.ndarray:
    """Vertices of a triangulated tube: circles of points, far from one another."""
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.concatenate([np.stack([10 * np.cos(turn), 10 * np.sin(turn), np.full(n, z)], axis=1) for z in (0.0, 40.0, 60.0)])


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_vertices_of_a_cad_mesh_are_refused_with_the_reason(unit: float) -> None:
    with pytest.raises(NoResultError, match="100% of the points form a line"):
        reconstruct_surface(tube_vertices() * unit, unit="mm")


@pytest.mark.parametrize("apart", [1.0, 3.0])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_the_lines_of_a_scan_are_a_surface(apart: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    points = np.stack(np.meshgrid(np.arange(80.0), apart * np.arange(80.0), [0.0]), axis=3).reshape(-1, 3)
    points += rng.normal(0, max(noise, 1e-3), points.shape)
    assert line_share(measure_scale(points).cells) < 0.1
