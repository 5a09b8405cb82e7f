"""Borders that cross beside a vertex meet where they cross."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.brep.borders import BorderCurve
from scan2nurbs.brep.charts import chart_of
from scan2nurbs.brep.space import interpolate
from scan2nurbs.brep.untangle import Tangle, find_tangles, untangled
from scan2nurbs.faces.topology import Border
from scan2nurbs.surfaces.plane import Plane
from test_part import topology

H = 0.5
FLOOR = Plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def flat(x, y):
    return np.column_stack([x, y, np.zeros(len(x))])


def curve(points, vertices):
    return BorderCurve(interpolate(points, False), (0, 1), vertices, "contact", 0.0, 5.0)


def lens(cross):
    """A lens from x = 0 to 20 whose sides cross at x = `cross`: up to there the lower one runs above the other."""
    x = np.linspace(0.0, 20.0, 60)
    width = x * (x - cross) * (20.0 - x) / 300.0
    return curve(flat(x, -width), (0, 1)), curve(flat(x, width), (0, 1))


def test_sides_of_a_lens_that_cross_beside_its_tip_are_found():
    low, high = lens(1.5)
    tangle = only(find_tangles(chart_of(FLOOR, 1.0), [((0, True), (1, False))], [low, high], H))
    assert set(tangle.borders) == {0, 1}
    assert tangle.within == ()
    assert tangle.vertices == (0,)
    assert tangle.place == pytest.approx([1.5, 0.0, 0.0], abs=0.1)


@pytest.mark.parametrize("start", [0, 1])
def test_it_does_not_matter_where_the_loop_begins(start):
    low, high = lens(0.05)
    loop = ((0, True), (1, False))
    found = find_tangles(chart_of(FLOOR, 1.0), [loop[start:] + loop[:start]], [low, high], H)
    assert only(found).vertices == (0,)


def test_short_tips_are_left_out_where_only_long_ones_are_asked_for():
    low, high = lens(0.1)
    chart, loops = chart_of(FLOOR, 1.0), [((0, True), (1, False))]
    assert len(find_tangles(chart, loops, [low, high], H)) == 1
    assert find_tangles(chart, loops, [low, high], H, 0.25 * H) == []


def test_sides_that_cross_in_their_middle_are_no_tip():
    assert find_tangles(chart_of(FLOOR, 1.0), [((0, True), (1, False))], list(lens(10.0)), H) == []


def test_a_lens_with_open_tips_has_none():
    assert find_tangles(chart_of(FLOOR, 1.0), [((0, True), (1, False))], list(lens(-1.0)), H) == []


def test_sides_that_cross_before_the_short_border_between_them():
    """A trapezium whose top is turned over."""
    corners = [(0.0, 0.0), (10.0, 0.0), (4.9, 9.0), (5.1, 9.0)]
    sides = [curve(flat(*np.linspace(corners[k], corners[(k + 1) % 4], 9).T), (k, (k + 1) % 4)) for k in range(4)]
    tangle = only(find_tangles(chart_of(FLOOR, 1.0), [tuple((k, True) for k in range(4))], sides, H))
    assert (tangle.borders, tangle.within, tangle.vertices) == ((1, 3), (2,), (2, 3))
    assert tangle.place[1] == pytest.approx(8.83, abs=0.1)


def only(found):
    assert len(found) == 1
    return found[0]


def lens_between():
    """A lens (0) between two faces (1 above, 2 below) whose common border leads on from both of its tips, and their outer border."""
    x = np.linspace(0.0, 20.0, 41)
    width = x * (20.0 - x) / 40.0
    borders = [
        Border(flat(x, -width), (0, 2), (0, 1)),
        Border(flat(x, width), (1, 0), (0, 1)),
        Border(flat(np.linspace(-10.0, 0.0, 21), np.zeros(21)), (1, 2), (2, 0)),
        Border(flat(np.linspace(20.0, 30.0, 21), np.zeros(21)), (1, 2), (1, 3)),
        Border(flat(np.linspace(30.0, -10.0, 9), np.array([0, 15, 20, 20, 20, 20, 20, 15, 0.0])), (1, -1), (3, 2)),
        Border(flat(np.linspace(-10.0, 30.0, 9), -np.array([0, 15, 20, 20, 20, 20, 20, 15, 0.0])), (2, -1), (2, 3)),
    ]
    vertices = flat(np.array([0.0, 20.0, -10.0, 30.0]), np.zeros(4))
    return topology(borders, vertices, [1, 1, 1])


def test_borders_end_where_they_crossed_and_the_third_leads_on_to_there():
    place = np.array([3.0, 0.0, 0.0])
    found = untangled(lens_between(), [Tangle((0, 1), (), (0,), place)], H)
    assert found is not None
    borders = found.topology.borders
    assert found.changed == {0, 1, 2}
    assert found.kept.tolist() == [0, 1, 2, 3, 4, 5]
    assert np.array_equal(found.topology.vertices[0], place)
    for k in (0, 1):
        assert np.array_equal(borders[k].points[0], place)
        assert borders[k].points[1:, 0].min() > 0.5 * place[0]
    assert np.array_equal(borders[2].points[-1], place)
    assert (np.diff(borders[2].points[:, 0]) > 0.0).all()
    assert np.count_nonzero(borders[2].points[:, 0] > 0.0) > 2  # along the tip
    assert found.topology.loops == lens_between().loops
    assert found.topology.held == frozenset()


def test_where_four_borders_meet_only_a_small_tip_is_given_up():
    four = lens_between()
    spoke = Border(flat(np.linspace(-10.0, 0.0, 9), np.linspace(-8.0, 0.0, 9)), (2, 2), (3, 0))
    four = topology([*four.borders[:5], four.borders[5], spoke], four.vertices, [1, 1, 1])
    assert untangled(four, [Tangle((0, 1), (), (0,), np.array([1.5, 0.0, 0.0]))], H) is None
    found = untangled(four, [Tangle((0, 1), (), (0,), np.array([0.2, 0.0, 0.0]))], H)
    assert found is not None
    assert found.topology.held == {0}
    assert all(np.allclose(b.points[k], [0.2, 0.0, 0.0]) for b in found.topology.borders for k in (0, -1) if b.vertices[k] == 0)


def wedge():
    """A wedge (0) that ends in a short border (2) to a third face, between two long ones."""
    tip = np.linspace([10.0, 0.2, 0.0], [10.0, -0.2, 0.0], 5)
    borders = [
        Border(np.linspace([0.0, -4.0, 0.0], [10.0, -0.2, 0.0], 21), (0, 2), (0, 1)),
        Border(np.linspace([10.0, 0.2, 0.0], [0.0, 4.0, 0.0], 21), (0, 1), (2, 3)),
        Border(tip[::-1].copy(), (0, 3), (1, 2)),
        Border(np.linspace([0.0, 4.0, 0.0], [0.0, -4.0, 0.0], 9), (0, -1), (3, 0)),
        Border(np.linspace([10.0, -0.2, 0.0], [20.0, -9.0, 0.0], 21), (3, 2), (1, 4)),
        Border(np.linspace([20.0, 9.0, 0.0], [10.0, 0.2, 0.0], 21), (3, 1), (5, 2)),
        Border(np.linspace([20.0, -9.0, 0.0], [20.0, 9.0, 0.0], 21), (3, -1), (4, 5)),
        Border(np.linspace([20.0, 9.0, 0.0], [0.0, 4.0, 0.0], 21), (1, -1), (5, 3)),
        Border(np.linspace([0.0, -4.0, 0.0], [20.0, -9.0, 0.0], 21), (2, -1), (0, 4)),
    ]
    vertices = np.array([[0, -4, 0], [10, -0.2, 0], [10, 0.2, 0], [0, 4, 0], [20, -9, 0], [20, 9, 0]], float)
    return topology(borders, vertices, [1, 1, 1, 1])


def test_a_short_border_between_sides_that_cross_vanishes():
    given, place = wedge(), np.array([9.5, 0.0, 0.0])
    found = untangled(given, [Tangle((0, 1), (2,), (1, 2), place)], H)
    assert found is not None
    assert found.kept.tolist() == [0, 1, 3, 4, 5, 6, 7, 8]
    new = found.topology
    meeting = [b for b in new.borders if 1 in b.vertices]
    assert len(meeting) == 4
    assert not any(2 in b.vertices for b in new.borders)
    assert all(np.array_equal(b.points[k], place) for b in meeting for k in (0, -1) if b.vertices[k] == 1)
    assert [sorted(map(len, loops)) for loops in new.loops] == [[3], [3], [3], [3]]


def test_nothing_to_untangle():
    assert untangled(lens_between(), [], H) is None
