"""Outlines against analytic shapes: topology, distance, area, corners; invariance; tubes; errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from scan2nurbs.edges.corrections import in_polygon
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.crossings import crossing_loops, cut_small_loops
from scan2nurbs.faces.outline import OutlineParams, find_outline

S = 60.0


def outline_loops(*given, **how):
    return find_outline(*given, **how).loops


def circle(radius, centre=(0.0, 0.0), n=400):
    t = 2.0 * np.pi * np.arange(n) / n
    return np.stack([centre[0] + radius * np.cos(t), centre[1] + radius * np.sin(t)], axis=1)


def polygon(*corners):
    return S * np.array(corners, float)


def star():
    t = 0.5 * np.pi + 0.2 * np.pi * np.arange(10)
    r = np.where(np.arange(10) % 2 == 0, 0.7, 0.32)
    return S * np.stack([r * np.cos(t), r * np.sin(t)], axis=1)


def crescent():
    big, small, off = 0.6 * S, 0.48 * S, 0.35 * S
    x = (big**2 - small**2 + off**2) / (2.0 * off)
    y = np.sqrt(big**2 - x**2)
    a = np.linspace(np.arctan2(y, x), 2.0 * np.pi - np.arctan2(y, x), 400)
    b = np.linspace(np.arctan2(-y, x - off) % (2.0 * np.pi), np.arctan2(y, x - off), 400)[1:-1]
    outer = np.stack([big * np.cos(a), big * np.sin(a)], axis=1)
    return np.concatenate([outer, np.stack([off + small * np.cos(b), small * np.sin(b)], axis=1)])


def notched():
    """A rounded plate with a round notch in it: the side from one corner of the notch to the other runs all around the plate."""
    t = np.radians(np.arange(90, 450) - 5)
    x, y = np.cos(t), np.sin(t)
    plate = np.stack([40.0 * np.sign(x) * np.abs(x) ** 0.5, 30.0 * np.sign(y) * np.abs(y) ** 0.5], axis=1)
    plate = plate[np.hypot(plate[:, 0] - 12.0, plate[:, 1] - 30.0) > 8.0]
    plate = np.roll(plate, -int(np.argmin(np.hypot(plate[:, 0] - 4.0, plate[:, 1] - 30.0))), axis=0)
    return np.concatenate([plate, circle(8.0, (12.0, 30.0))[:200:-1]])


SHAPES = {
    "circle": ([circle(0.5 * S)], 0),
    "square": ([polygon((0, 0), (1, 0), (1, 1), (0, 1))], 4),
    "rectangle": ([0.45 * polygon((0, 0), (5, 0), (5, 1), (0, 1))], 4),
    "star": ([star()], 10),
    "T": ([0.4 * polygon((0, 2), (1, 2), (1, 0), (2, 0), (2, 2), (3, 2), (3, 3), (0, 3))], 8),
    "L": ([0.4 * polygon((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))], 6),
    "U": ([0.4 * polygon((0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3))], 8),
    "crescent": ([crescent()], 2),
    "ring": ([circle(0.55 * S), circle(0.25 * S)[::-1]], 0),
    "plate": ([polygon((0, 0), (1.4, 0), (1.4, 1), (0, 1)), circle(4.0, (24.0, 30.0))[::-1], circle(10.0, (60.0, 30.0))[::-1]], 4),
    "dumbbell": (
        [
            0.7
            * polygon(
                (0, 0), (1, 0), (1, 0.42), (1.4, 0.42), (1.4, 0), (2.4, 0), (2.4, 1), (1.4, 1), (1.4, 0.58), (1, 0.58), (1, 1), (0, 1)
            )
        ],
        12,
    ),
}


def inside(points, loops):
    result = np.zeros(len(points), bool)
    for loop in loops:
        result ^= in_polygon(points, loop)
    return result


def rain(loops, rng, density=1.0):
    low, high = np.min([loop.min(axis=0) for loop in loops], axis=0), np.max([loop.max(axis=0) for loop in loops], axis=0)
    points = rng.uniform(low, high, (int(density * (high - low).prod()), 2))
    return points[inside(points, loops)]


def grid(loops, rng):
    low, high = np.min([loop.min(axis=0) for loop in loops], axis=0), np.max([loop.max(axis=0) for loop in loops], axis=0)
    x, y = np.meshgrid(np.arange(low[0] + 0.4, high[0]), np.arange(low[1] + 0.6, high[1]))
    points = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-0.3, 0.3, (x.size, 2))
    return points[inside(points, loops)]


def along(loops, step):
    pieces = []
    for loop in loops:
        ring = np.concatenate([loop, loop[:1]])
        length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
        at = np.arange(0.0, length[-1], step)
        pieces.append(np.stack([np.interp(at, length, ring[:, 0]), np.interp(at, length, ring[:, 1])], axis=1))
    return np.concatenate(pieces)


def deviation(outline, loops):
    """Mean distance between outline and truth, the worse of both ways."""
    found, true = along([loop.points for loop in outline.loops], 0.1), along(loops, 0.1)
    return max(KDTree(true).query(found)[0].mean(), KDTree(found).query(true)[0].mean())


def area(loops):
    return sum(0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) for x, y in (loop.T for loop in loops))


def is_simple(outline):
    return not crossing_loops([np.concatenate([loop.points, loop.points[:1]]) for loop in outline.loops]).any()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("sampling", [rain, grid])
def test_outline_along_the_border_of_the_scan(name, sampling):
    loops, _ = SHAPES[name]
    points = sampling(loops, np.random.default_rng(3))
    outline = find_outline(points, spacing=1.0)
    assert [np.sign(loop.area) for loop in outline.loops] == [1.0] + [-1.0] * (len(loops) - 1)
    assert is_simple(outline)
    assert outline.n_rough == 0
    assert deviation(outline, loops) < 0.5
    perimeter = sum(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum() for loop in loops)
    assert abs(sum(loop.area for loop in outline.loops) - area(loops)) < 0.25 * perimeter


@pytest.mark.parametrize("name", SHAPES)
def test_outline_along_creases_with_noise(name):
    """The points stop 1.5 h before the crease, where edge points were taken out; the outline must still run on it."""
    loops, n_corners = SHAPES[name]
    rng = np.random.default_rng(4)
    points = rain(loops, rng)
    points = points[KDTree(along(loops, 0.1)).query(points)[0] > 1.5]
    points = points + 0.25 * rng.standard_normal(points.shape)
    creases = along(loops, 1.5)
    creases += 0.25 * rng.standard_normal(creases.shape)
    outline = find_outline(points, spacing=1.0, boundary_uv=creases)
    assert len(outline.loops) == len(loops)
    assert is_simple(outline)
    assert deviation(outline, loops) < 0.5
    assert abs(sum(loop.area for loop in outline.loops) / area(loops) - 1.0) < 0.015
    assert np.mean(np.concatenate([loop.on_crease for loop in outline.loops])) > 0.95
    corners = np.concatenate([loop.points[loop.corners] for loop in outline.loops])
    assert abs(len(corners) - n_corners) <= max(1, n_corners // 8)


def test_corners_of_a_rectangle_stay_sharp():
    loops, _ = SHAPES["rectangle"]
    rng = np.random.default_rng(5)
    creases = along(loops, 1.5) + 0.1 * rng.standard_normal((len(along(loops, 1.5)), 2))
    (loop,) = outline_loops(rain(loops, rng), spacing=1.0, boundary_uv=creases)
    assert len(loop.corners) == 4
    distance, nearest = KDTree(loop.points[loop.corners]).query(loops[0])
    assert distance.max() < 0.6
    assert sorted(nearest) == [0, 1, 2, 3]


def test_a_side_that_runs_all_around_the_face_is_kept_whole():
    loops, rng = [notched()], np.random.default_rng(4)
    for creases in (None, along(loops, 1.5)):
        (loop,) = outline_loops(rain(loops, rng), spacing=1.0, boundary_uv=creases)
        assert len(loop.corners) > 0
        assert np.linalg.norm(loop.points - np.roll(loop.points, 1, axis=0), axis=1).max() < 2.0
        assert KDTree(along([loop.points], 0.1)).query(along(loops, 0.1))[0].max() < 2.5


def test_gaps_in_the_creases_are_bridged():
    loops, _ = SHAPES["square"]
    rng = np.random.default_rng(6)
    creases = along(loops, 1.5)
    creases = creases[np.abs(creases[:, 0] - 30.0) > 5.0]
    (loop,) = outline_loops(rain(loops, rng), spacing=1.0, boundary_uv=creases)
    assert deviation(find_outline(rain(loops, rng), spacing=1.0, boundary_uv=creases), loops) < 0.4
    assert 0.5 < loop.on_crease.mean() < 0.98


def test_a_crease_farther_out_is_not_taken_for_the_border():
    loops, _ = SHAPES["square"]
    rng = np.random.default_rng(7)
    near = along(loops, 1.5)
    far = along([(loops[0] - 30.0) * (33.0 / 30.0) + 30.0], 1.0)
    outline = find_outline(rain(loops, rng), spacing=1.0, boundary_uv=np.concatenate([near, far]))
    assert deviation(outline, loops) < 0.3


def test_chance_gaps_and_missing_points_are_no_holes():
    rng = np.random.default_rng(8)
    loops = [200.0 / S * polygon((0, 0), (1, 0), (1, 1), (0, 1))]
    assert len(outline_loops(rain(loops, rng), spacing=1.0)) == 1
    x, y = np.meshgrid(np.arange(80.0), np.arange(80.0))
    lattice = np.stack([x.ravel(), y.ravel()], axis=1)
    assert len(outline_loops(np.delete(lattice, [1640, 1641, 4000], axis=0), spacing=1.0)) == 1


@pytest.mark.parametrize("sampling", [rain, grid])
def test_a_hole_of_six_spacings_is_a_hole(sampling):
    loops = [polygon((0, 0), (1, 0), (1, 1), (0, 1)), circle(3.0, (30.0, 30.0))[::-1]]
    outer, hole = outline_loops(sampling(loops, np.random.default_rng(9)), spacing=1.0)
    assert outer.area > 3400.0
    assert hole.area == pytest.approx(-np.pi * 9.0, rel=0.35)


def test_uneven_density():
    """Density that falls to a sixth across the face leaves no holes and moves the border little."""
    rng = np.random.default_rng(10)
    loops = [2.0 * polygon((0, 0), (1, 0), (1, 1), (0, 1))]
    points = rain(loops, rng, density=1.7)
    points = points[rng.uniform(size=len(points)) < 1.0 / 6.0 + 5.0 / 6.0 * points[:, 0] / (2.0 * S)]
    outline = find_outline(points, spacing=1.0)
    assert len(outline.loops) == 1
    assert deviation(outline, loops) < 0.7
    assert outline.loops[0].area == pytest.approx(area(loops), rel=0.015)


def test_separate_components_are_reported():
    rng = np.random.default_rng(11)
    big, small = rain(SHAPES["square"][0], rng), rain([circle(8.0, (90.0, 20.0))], rng)
    outline = find_outline(np.concatenate([small, big]), spacing=1.0)
    assert len(outline.loops) == 1
    assert outline.n_points == len(big)
    assert outline.n_left_out == (len(small),)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6.28), st.floats(-1e4, 1e4), st.sampled_from([1e-6, 0.03, 1.0, 2e5]))
def test_rigid_motion_scale_and_order_change_nothing(seed, angle, offset, scale):
    rng = np.random.default_rng(2)
    loops = [circle(8.0) * np.array([2.0, 1.0])]
    points = rain(loops, rng)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    moved = (np.random.default_rng(seed).permutation(points) @ turn + offset) * scale
    (before,), (after,) = outline_loops(points, spacing=1.0), outline_loops(moved, spacing=scale)
    np.testing.assert_allclose(after.points / scale, before.points @ turn + offset, atol=1e-6)
    np.testing.assert_array_equal(after.corners, before.corners)


@pytest.mark.parametrize("seam", [0.0, 37.0, -260.0])
def test_tube(seam):
    """Loops once around a tube span the period; a hole across the seam closes."""
    rng = np.random.default_rng(12)
    points = rng.uniform([0.0, 0.0], [100.0, 40.0], (4000, 2))
    points = points[points[:, 1] < 34.0 + 4.0 * np.sin(0.02 * np.pi * points[:, 0])]
    points = points[np.hypot((points[:, 0] + 50.0) % 100.0 - 50.0, points[:, 1] - 15.0) > 6.0]
    low, high, hole = outline_loops(points + np.array([seam, 0.0]), spacing=1.0, period=100.0)
    np.testing.assert_allclose(low.shift, [100.0, 0.0])
    np.testing.assert_allclose(high.shift, [-100.0, 0.0])
    assert np.abs(low.points[:, 1]).mean() < 0.5
    assert np.abs(high.points[:, 1] - 34.0 - 4.0 * np.sin(0.02 * np.pi * (high.points[:, 0] - seam))).mean() < 0.5
    assert hole.area == pytest.approx(-np.pi * 36.0, rel=0.2)
    assert not hole.shift.any()


def test_patch_on_a_tube_across_the_seam():
    rng = np.random.default_rng(13)
    points = rng.uniform([-20.0, 0.0], [20.0, 30.0], (1200, 2))
    points[:, 0] %= 100.0
    (loop,) = outline_loops(points, spacing=1.0, period=100.0)
    assert loop.area == pytest.approx(1200.0, rel=0.05)
    assert not loop.shift.any()


def test_knots_are_cut_out():
    t = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    points = 20.0 * np.stack([np.cos(t), np.sin(t)], axis=1)
    points[50:53] = points[[52, 51, 50]]
    assert crossing_loops([np.concatenate([points, points[:1]])]).all()
    cut, corners, flags = cut_small_loops(points, np.array([51]), np.ones(200, bool), np.zeros(2), longest=20)
    assert not crossing_loops([np.concatenate([cut, cut[:1]])]).any()
    assert len(cut) == len(flags) >= 195
    assert len(corners) == 1


@pytest.mark.parametrize(
    ("points", "options", "error", "message"),
    [
        (np.zeros((5, 3)), {}, ParameterError, "'points_uv'"),
        (np.full((5, 2), np.nan), {}, ParameterError, "'points_uv'"),
        (np.zeros((2, 2)), {}, NoResultError, "at least 3"),
        (np.zeros((9, 2)), {"spacing": -1.0}, ParameterError, "The 'spacing' parameter of find_outline must be a float in"),
        (np.zeros((9, 2)), {"period": 3.0}, ParameterError, "'period'"),
        (np.zeros((9, 2)), {"boundary_uv": np.zeros(4)}, ParameterError, "'boundary_uv'"),
    ],
)
def test_errors(points, options, error, message):
    with pytest.raises(error, match=message):
        find_outline(points, **{"spacing": 1.0, **options})


def test_parameter_ranges():
    with pytest.raises(ParameterError, match=r"'corner_angle' parameter of find_outline must be a float in \(0, 180\). Got 190.0"):
        OutlineParams(corner_angle=190.0)
    with pytest.raises(ParameterError, match="'reach'"):
        OutlineParams(reach=-1.0)


@pytest.mark.parametrize("points", [np.zeros((4, 2)), np.stack([np.arange(9.0), np.zeros(9)], axis=1)])
def test_degenerate_points_still_get_one_outline(points):
    """Too few points to carry a face: a thin outline or an honest refusal, never a crash."""
    try:
        outline = find_outline(points, spacing=1.0)
    except NoResultError:
        return
    assert len(outline.loops) == 1
    assert np.isfinite(outline.loops[0].points).all()
