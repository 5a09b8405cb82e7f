"""Attempts remember what earlier ones computed."""

from __future__ import annotations

import numpy as np

from scan2nurbs.brep.borders import lay_borders
from scan2nurbs.brep.known import Known
from scan2nurbs.faces.topology import Border
from scan2nurbs.surfaces.plane import Plane


class Counted:
    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return [self.calls]


def test_a_result_is_computed_once_for_equal_numbers_and_the_same_objects():
    known, compute, thing = Known(), Counted(), object()
    first = known(("curve", 1, 0.5, b"ends", thing), compute)
    assert known(("curve", 1, 0.5, b"ends", thing), compute) is first
    assert compute.calls == 1


def test_other_numbers_names_and_objects_have_results_of_their_own():
    known, compute, thing = Known(), Counted(), object()
    for given in (("a", 1, thing), ("b", 1, thing), ("a", 2, thing), ("a", 1, object()), ("a", 1), ("a", 1, str(id(thing)))):
        known(given, compute)
    assert compute.calls == 6


def test_objects_that_are_gone_are_not_taken_for_new_ones():
    known, compute = Known(), Counted()
    for _ in range(200):
        known(("a", object()), compute)  # without being held, the next object would take the place of the last
    assert compute.calls == 200


def test_borders_laid_again_are_those_laid_before_and_only_changed_ones_are_new():
    x = np.linspace(0.0, 20.0, 21)
    zero = np.zeros_like(x)
    lines = [np.column_stack([x, zero, zero]), np.column_stack([zero, x, zero])]
    borders = [Border(lines[0], (0, 1), (0, 1)), Border(lines[1], (0, 2), (0, 2))]
    vertices = np.array([[0.0, 0, 0], [20.0, 0, 0], [0.0, 20, 0]])
    floor, front, side = (Plane(point=np.zeros(3), direction=np.eye(3)[k]) for k in (2, 1, 0))
    known = Known()
    first, placed = lay_borders(borders, vertices, [floor, front, side], 1.0, known=known)
    again, _ = lay_borders(borders, vertices, [floor, front, side], 1.0, known=known)
    assert all(a is b for a, b in zip(first, again, strict=True))
    moved = Plane(point=np.array([0.0, 0.05, 0.0]), direction=np.eye(3)[1])
    other, _ = lay_borders(borders, vertices, [floor, moved, side], 1.0, known=known)
    fresh, _ = lay_borders(borders, vertices, [floor, moved, side], 1.0)
    assert other[0] is not first[0]
    for a, b in zip(other, fresh, strict=True):
        t = a.curve.samples(16)
        np.testing.assert_array_equal(a.curve(t), b.curve(t))
        assert a.gap == b.gap
    np.testing.assert_allclose(placed[0], 0.0, atol=1e-9)
