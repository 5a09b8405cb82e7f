"""Grouping scans whose lines run along a crease and lie far apart there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.faces.region import Region, RegionParams, group_points
from scan2nurbs.scale import measure_scale


def roof(angle: float, gap: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Two planes whose normals differ by an angle (degrees), scanned in lines along their crease; and which points are on the first.

    Points lie 0.5 apart on lines 1.5 apart, but for those beside the crease.
    """
    rng = np.random.default_rng(0)
    line = np.repeat(np.arange(24) - 11.5, 100)
    x, first = rng.uniform(0, 50, len(line)), line < 0
    away = (np.abs(line) - 0.5) * 1.5 + gap / 2
    tilt = np.radians(angle) / 2
    points = np.stack([x, np.where(first, -away, away) * np.cos(tilt), -away * np.sin(tilt)], axis=1)
    return points + rng.normal(0, 0.2, points.shape), first


def group(points: NDArray[np.float64]) -> tuple[Edges, Region]:
    scale = measure_scale(points)
    edges = detect(points, scale, EdgeParams(operator="one-sided"))
    return edges, group_points(points, scale, edges, edges.mask, RegionParams())


@pytest.mark.parametrize(("angle", "gap"), [(45.0, 2.5), (70.0, 2.5), (70.0, 3.0)])
def test_a_crease_that_few_points_see_parts_surfaces(angle: float, gap: float) -> None:
    points, first = roof(angle, gap)
    edges, region = group(points)
    # The lines on either side are farther apart than the neighbours that an edge point is judged by.
    assert edges.mask.mean() < 0.03
    assert len(region.candidates) == 2
    for label in (0, 1):
        share = first[region.label == label].mean()
        assert min(share, 1 - share) < 0.01


def test_lines_on_one_surface_stay_together() -> None:
    points, _ = roof(6.0, 2.5)
    _, region = group(points)
    assert region.inside.mean() > 0.98
