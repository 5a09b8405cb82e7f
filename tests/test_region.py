"""The default grouping on plateaus of many outlines: what lies inside is known."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path as Polygon
from scipy.spatial import KDTree

from scan2nurbs.cloud import as_cloud
from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.inside import enclosed_by_centroid
from scan2nurbs.faces.region import Region, RegionParams, group_points
from scan2nurbs.scale import measure_scale

turn = np.linspace(0.0, 2 * np.pi, 200, endpoint=False)
circle = np.c_[np.cos(turn), np.sin(turn)]
OUTLINES: dict[str, list[np.ndarray]] = {
    "circle": [45 * circle],
    "rectangle 5:1": [np.array([[-55, -11], [55, -11], [55, 11], [-55, 11.0]])],
    "L": [np.array([[-40, -40], [40, -40], [40, -12], [-12, -12], [-12, 40], [-40, 40.0]])],
    "U": [np.array([[-45, -45], [45, -45], [45, 45], [20, 45], [20, -20], [-20, -20], [-20, 45], [-45, 45.0]])],
    "star": [(30 + 16 * np.cos(5 * turn))[:, None] * circle],
    "crescent": [np.r_[45 * circle[:130], (38 * circle[:130] + [11, 11])[::-1]]],
    "ring": [50 * circle, 20 * circle],
}


def plateau(name: str, noise: float, n: int = 20_000, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of a curved plateau with slopes of 45 degrees down from its outline; which are on it; how far off the outline they are."""
    rng = np.random.default_rng(seed)
    side = np.sqrt(n)
    xy = (rng.random((n, 2)) - 0.5) * side
    loops = OUTLINES[name]
    inside = Polygon(loops[0]).contains_points(xy)
    for hole in loops[1:]:
        inside &= ~Polygon(hole).contains_points(xy)
    fine = []
    for loop in loops:
        closed = np.r_[loop, loop[:1]]
        steps = np.linspace(0, 1, 200)[:, None, None]
        fine.append((closed[:-1] * (1 - steps) + closed[1:] * steps).reshape(-1, 2))
    distance = KDTree(np.concatenate(fine)).query(xy)[0]
    z = 8.0 * np.cos(xy[:, 0] / 60.0) * np.cos(xy[:, 1] / 60.0) - np.where(inside, 0.0, distance)
    return np.c_[xy, z] + noise * rng.normal(size=(n, 3)), inside, distance


def group(points: np.ndarray, params: RegionParams | None = None) -> Region:
    cloud = as_cloud(points)
    scale = measure_scale(cloud.points)
    edges = detect(cloud.points, scale, EdgeParams(operator="one-sided"))
    return group_points(cloud.points, scale, edges, edges.mask, params or RegionParams())


@pytest.mark.parametrize("noise", [0.0, 0.25])
@pytest.mark.parametrize("name", OUTLINES)
def test_plateaus_of_any_outline_are_found(name, noise):
    points, inside, distance = plateau(name, noise)
    region = group(points, RegionParams(seed=tuple(points[np.argmax(np.where(inside, distance, -1))])))
    clear = distance > 3.0
    assert np.mean(region.inside[clear] == inside[clear]) > 0.99
    rim = region.rim & (distance > 1.0)
    assert inside[rim].mean() > 0.94


@pytest.mark.parametrize(("name", "good"), [("circle", True), ("L", False), ("U", False), ("ring", False)])
def test_algorithm_3_needs_outlines_that_are_star_shaped(name, good):
    points, inside, distance = plateau(name, 0.0)
    accuracy = np.mean(enclosed_by_centroid(points, points[distance < 0.5])[distance > 3.0] == inside[distance > 3.0])
    assert bool(accuracy > 0.99) is good


def test_the_enclosed_surface_is_preferred_to_a_larger_open_one():
    points, inside, distance = plateau("circle", 0.1)
    region = group(points)
    assert region.candidates[0].area > region.candidates[region.chosen].area
    assert np.mean(region.inside[distance > 3] == inside[distance > 3]) > 0.99
    chosen = region.candidates[region.chosen]
    assert chosen.enclosed > 0.9
    assert chosen.area == pytest.approx(np.pi * 45**2, rel=0.15)


def test_a_gap_in_the_boundary_does_not_leak():
    points, inside, distance = plateau("circle", 0.0)
    cloud = as_cloud(points)
    scale = measure_scale(cloud.points)
    edges = detect(cloud.points, scale, EdgeParams(operator="one-sided"))
    gap = edges.mask & ~((points[:, 0] > 0) & (np.abs(points[:, 1]) < 1.5))
    assert gap.sum() < edges.mask.sum()
    region = group_points(cloud.points, scale, edges, gap, RegionParams())
    assert np.mean(region.inside[distance > 3] == inside[distance > 3]) > 0.99


def test_a_neck_does_not_part_a_surface():
    points, _, _ = plateau("circle", 0.0)
    points[:, 2] = 0.0
    wall = (np.abs(points[:, 0]) < 1.5) & (np.abs(points[:, 1]) > 4.0)
    points = points[~wall | (np.arange(len(points)) % 1 == 1)]
    walls = np.random.default_rng(1).random((6000, 3)) * [3.0, 141.0, 20.0] - [1.5, 70.5, 0.0]
    walls[:, 0] = np.where(walls[:, 0] < 0, -1.5, 1.5)
    region = group(np.r_[points, walls[np.abs(walls[:, 1]) > 4.0]])
    left, right = (np.abs(points[:, 0] - x) < 30 for x in (-40, 40))
    label = region.label[: len(points)]
    assert np.bincount(label[left] + 1).argmax() == np.bincount(label[right] + 1).argmax()


def test_the_border_of_the_scan_is_no_edge():
    points, _, _ = plateau("circle", 0.1)
    points[:, 2] = 5.0 * np.cos(points[:, 0] / 40.0)
    region = group(points)
    assert len(region.candidates) == 1
    assert region.inside.mean() > 0.97
    outermost = np.abs(points[:, :2]).max(axis=1) > 0.5 * np.sqrt(len(points)) - 0.7
    inner = np.abs(points[:, :2]).max(axis=1) < 0.5 * np.sqrt(len(points)) - 3.0
    assert region.border[outermost].mean() > 0.8
    assert region.border[inner].mean() < 0.03  # random sampling leaves small holes


def test_no_surface_is_an_answer_with_a_reason():
    cloud = as_cloud(plateau("circle", 0.1)[0][::20])
    scale = measure_scale(cloud.points)
    edges = detect(cloud.points, scale, EdgeParams(operator="one-sided"))
    with pytest.raises(NoResultError, match="1000 of 1000 points are on an edge"):
        group_points(cloud.points, scale, edges, np.ones(1000, bool), RegionParams())


@pytest.mark.parametrize("params", [{"min_points": 2}, {"seed": (0.0, np.nan, 1.0)}])
def test_parameters_out_of_range_are_refused(params):
    with pytest.raises(ParameterError, match=next(iter(params))):
        RegionParams(**params)


def ridge(noise: float = 0.1) -> np.ndarray:
    """Two slopes that run into each other over a rounding of ten spacings."""
    rng = np.random.default_rng(7)
    along, around = rng.random(12_000) * 100.0, (rng.random(12_000) - 0.5) * 120.0
    turn = np.clip(around / 10.0, -np.pi / 4, np.pi / 4)
    flat = around - turn * 10.0
    points = np.c_[along, 10.0 * np.sin(turn) + flat * np.cos(turn), 10.0 * (np.cos(turn) - 1) - flat * np.sin(turn)]
    return points + noise * rng.normal(size=points.shape)


def test_a_bend_parts_a_surface_only_where_that_is_asked_for():
    cloud = as_cloud(ridge())
    scale = measure_scale(cloud.points)
    edges = detect(cloud.points, scale, EdgeParams(operator="one-sided"))
    assert edges.mask.mean() > 0.03
    whole = group_points(cloud.points, scale, edges, edges.mask, RegionParams())
    assert whole.inside.mean() > 0.95
    parted = group_points(cloud.points, scale, edges, edges.mask, RegionParams(bends_part=True))
    assert parted.inside.mean() < 0.6
