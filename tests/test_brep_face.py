"""Trimmed faces: valid whatever the loops, and of the right area."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brep_samples import circle, cylinder, plate, true_area
from scan2nurbs.brep import face as face_module
from scan2nurbs.brep.check import check
from scan2nurbs.brep.face import Loop, trimmed_face
from scan2nurbs.brep.occ import KernelError, from_surface, kernel_errors, to_surface
from scan2nurbs.brep.seam import roll, with_true_seams
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.surfaces.bspline import BSplineSurface

TOLERANCE = 0.05
TURN = np.linspace(0, 1, 201)


def ring(height, wave=2.0, start=0.15):
    return Loop(np.column_stack([TURN + start, height + wave * np.sin(2 * np.pi * TURN)]), closed=False)


def test_without_loops_the_face_is_the_whole_surface():
    face = trimmed_face(plate(bend=0.0), tolerance=TOLERANCE)
    assert face.valid
    assert face.n_edges == 4
    assert face.area == pytest.approx(8000.0, rel=1e-9)
    assert face.notes == ()


def test_a_smooth_outline_is_one_edge_and_a_square_four():
    assert trimmed_face(plate(), [circle(0.5, 0.5, 0.3)], tolerance=TOLERANCE).n_edges == 1
    t = np.linspace(0, 1, 50, endpoint=False)[:, None]
    corners = np.array([[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]])
    square = np.vstack([a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    assert trimmed_face(plate(), [square], tolerance=TOLERANCE).n_edges == 4
    assert trimmed_face(plate(), [corners], tolerance=TOLERANCE).n_edges == 4
    noisy = square + np.random.default_rng(0).normal(size=square.shape) * 1e-3
    assert trimmed_face(plate(), [noisy], tolerance=0.5).n_edges == 4


@pytest.mark.parametrize("reverse", [False, True])
def test_holes_in_any_order_and_direction(reverse):
    loops = [circle(0.3, 0.4, 0.08), circle(0.5, 0.5, 0.4), circle(0.65, 0.6, 0.1)]
    face = trimmed_face(plate(), [loop[::-1] if reverse else loop for loop in loops], tolerance=TOLERANCE)
    assert face.valid
    assert len(face.wires) == 3
    assert face.area == pytest.approx(true_area(plate(), [loops[1], loops[0], loops[2]]), rel=2e-3)


def test_a_loop_beyond_the_border_is_cut_there_with_a_note():
    loop = circle(0.9, 0.5, 0.3)
    face = trimmed_face(plate(), [loop], tolerance=TOLERANCE)
    assert face.valid
    assert any(edge.side == (0, 1) for edge in face.wires[0])
    assert any("cut at its border" in note for note in face.notes)
    assert face.area == pytest.approx(true_area(plate(), [loop]), rel=2e-3)


def test_a_loop_along_the_border_becomes_the_border():
    rng = np.random.default_rng(1)
    t = np.linspace(0, 1, 100, endpoint=False)
    zero = np.zeros_like(t)
    loop = np.concatenate([np.c_[t, zero], np.c_[zero + 1, t], np.c_[1 - t, zero + 1], np.c_[zero, 1 - t]])
    face = trimmed_face(plate(), [loop + rng.normal(size=loop.shape) * 1e-4], tolerance=TOLERANCE * 2)
    assert face.n_edges == 4
    assert all(edge.side is not None for edge in face.wires[0])


def test_a_loop_that_crosses_itself_and_a_hole_that_crosses_the_outline():
    t = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    curl = np.column_stack([0.5 + 0.3 * np.cos(t) + 0.1 * np.cos(7 * t), 0.5 + 0.3 * np.sin(t) + 0.1 * np.sin(7 * t)])
    face = trimmed_face(plate(), [curl, circle(0.85, 0.5, 0.1)], tolerance=TOLERANCE)
    assert face.valid
    assert face.area == pytest.approx(true_area(plate(), [curl, circle(0.85, 0.5, 0.1)]), rel=0.02)


def test_tiny_loops_are_dropped_with_a_note():
    face = trimmed_face(plate(), [circle(0.5, 0.5, 0.3), circle(0.5, 0.5, 1e-4), np.zeros((5, 2))], tolerance=TOLERANCE)
    assert len(face.wires) == 1
    assert len(face.notes) == 2


def test_useless_loops_leave_the_whole_surface_with_a_note():
    face = trimmed_face(plate(), [np.full((4, 2), np.nan), np.array([[0.1, 0.1], [0.9, 0.9]])], tolerance=TOLERANCE)
    assert face.valid
    assert face.n_edges == 4
    assert "the face is the whole surface" in face.notes[-1]


@given(
    seed=st.integers(0, 1000),
    bend=st.floats(0.0, 0.4),
    lobes=st.integers(2, 7),
    depth=st.floats(0.0, 0.5),
    noise=st.sampled_from([0.0, 1e-3, 4e-3]),
    notch=st.booleans(),
    hole=st.booleans(),
    exponent=st.integers(-4, 4),
)
@settings(max_examples=30)
def test_any_outline_gives_a_valid_face_of_the_right_area(seed, bend, lobes, depth, noise, notch, hole, exponent):
    size = 100.0 * 10.0**exponent
    surface, rng = plate(bend=bend, size=size, seed=seed), np.random.default_rng(seed)
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    radius = 0.33 * (1 + depth * np.sin(lobes * t)) / (1 + depth)
    radius = np.where((t > 1.0) & (t < 1.6) & notch, 0.4 * radius, radius)
    loop = 0.5 + radius[:, None] * np.column_stack([np.cos(t), np.sin(t)])
    loops = [loop + rng.normal(size=loop.shape) * noise] + [circle(0.5, 0.5, 0.05)] * hole
    tolerance = size * max(5 * noise, 1e-3)
    face = trimmed_face(surface, loops, tolerance=tolerance)
    length = sum(np.linalg.norm(np.diff(surface.evaluate(loop), axis=0), axis=1).sum() for loop in loops)
    assert face.valid
    assert face.deviation <= 2 * tolerance
    assert face.n_edges <= 40
    assert face.max_tolerance <= 1e-4 * size
    assert abs(face.area - true_area(surface, loops)) <= 0.5 * tolerance * length + 1e-3 * size**2


def test_a_half_tube_is_trimmed_as_any_other():
    face = trimmed_face(cylinder(share=0.5), [circle(0.25, 20.0, 0.15, 10.0)], tolerance=0.02)
    assert face.valid
    assert face.area == pytest.approx(true_area(cylinder(share=0.5), [circle(0.25, 20.0, 0.15, 10.0)]), rel=3e-3)


def test_a_tube_has_a_seam():
    face = trimmed_face(cylinder(), tolerance=TOLERANCE)
    found = check(face.shape)
    assert (found.valid, found.n_edges, found.free_edges) == (True, 3, 2)
    assert found.area == pytest.approx(2 * np.pi * 10 * 40, rel=1e-6)


def test_loops_around_a_tube_bound_it_and_holes_may_lie_on_its_seam():
    hole = circle(0.01, 20.0, 0.08, 5.0)
    face = trimmed_face(cylinder(), [ring(10.0), ring(30.0), Loop(hole)], tolerance=0.02)
    assert face.valid
    around = np.pi * 0.08 * 5.0 * 2 * np.pi * 10  # an ellipse, unrolled
    assert face.area == pytest.approx(2 * np.pi * 10 * 20 - around, rel=5e-3)


def test_a_loop_around_need_not_say_so():
    wrapped = ring(10.0).uv[:-1] % [1.0, 100.0]
    face = trimmed_face(cylinder(), [wrapped, ring(30.0)], tolerance=0.02)
    assert face.area == pytest.approx(2 * np.pi * 10 * 20, rel=5e-3)


def test_one_loop_around_keeps_the_larger_side():
    face = trimmed_face(cylinder(), [ring(10.0)], tolerance=0.02)
    assert face.area == pytest.approx(2 * np.pi * 10 * 30, rel=5e-3)
    assert any("larger side" in note for note in face.notes)


@pytest.mark.parametrize("wrap", [False, True])
def test_the_seam_moves_out_of_a_patch(wrap):
    patch = circle(0.02, 20.0, 0.1, 6.0)
    if wrap:
        patch[:, 0] %= 1.0
    face = trimmed_face(cylinder(), [patch], tolerance=0.02)
    assert face.valid
    assert (face.n_edges, check(face.shape).free_edges) == (1, 1)
    assert any("seam" in note for note in face.notes)
    assert face.area == pytest.approx(true_area(cylinder(), [circle(0.27, 20.0, 0.1, 6.0)]), rel=5e-3)


def test_a_tube_that_closes_in_v_and_a_torus():
    tube = cylinder()
    turned = BSplineSurface((1, 2), tube.knots[::-1], tube.control_points.transpose(1, 0, 2).copy(), tube.weights.T.copy(), (False, True))
    loops = [Loop(loop.uv[:, ::-1], closed=False) for loop in (ring(10.0), ring(30.0))]
    face = trimmed_face(turned, [*loops, circle(20.0, 0.01, 5.0, 0.08)], tolerance=0.02)
    same = trimmed_face(tube, [ring(10.0), ring(30.0), circle(0.01, 20.0, 0.08, 5.0)], tolerance=0.02)
    assert face.valid
    assert (face.n_edges, face.area) == (same.n_edges, pytest.approx(same.area, rel=1e-3))

    section = tube.control_points[:, 0, :2] / 10.0
    points = np.array([[[*((4 + q[0]) * p), q[1]] for q in section] for p in section])
    weights = np.outer(tube.weights[:, 0], tube.weights[:, 0])
    torus = trimmed_face(BSplineSurface((2, 2), (tube.knots[0], tube.knots[0]), points, weights, (True, True)), tolerance=0.01)
    found = check(torus.shape)
    assert (found.valid, found.closed, found.n_edges) == (True, True, 2)
    assert found.volume == pytest.approx(2 * np.pi**2 * 4, rel=1e-5)


def test_a_rolled_surface_is_the_same_surface():
    tube = with_true_seams(cylinder(), [])
    moved = roll(tube, 0, 0.3)
    uv = np.column_stack([np.linspace(0.31, 1.29, 40), np.linspace(0, 40, 40)])
    assert moved.domain[0] == pytest.approx((0.3, 1.3))
    assert np.abs(moved.evaluate(uv) - tube.evaluate(uv % [1.0, 100.0])).max() < 1e-9


def test_a_seam_that_gapes_is_open():
    tube = cylinder()
    tube.control_points[-1] += 0.5
    face = trimmed_face(tube, tolerance=TOLERANCE)
    assert face.n_edges == 4
    assert any("taken for open" in note for note in face.notes)


def test_a_side_that_is_a_point_is_no_edge():
    surface = plate()
    surface.control_points[0] = surface.control_points[0].mean(axis=0)
    face = trimmed_face(surface, tolerance=TOLERANCE)
    assert face.valid
    assert face.n_edges == 3


def test_smooth_edges_that_fail_give_way_to_straight_ones_and_these_to_the_whole_surface(monkeypatch):
    monkeypatch.setattr(face_module, "is_valid", lambda shape: check(shape).n_edges > 1)
    face = trimmed_face(plate(), [circle(0.5, 0.5, 0.3)], tolerance=TOLERANCE)
    assert face.valid
    assert face.n_edges > 10
    assert any("straight ones were tried" in note for note in face.notes)
    assert 0 < face.deviation <= TOLERANCE
    monkeypatch.setattr(face_module, "is_valid", lambda shape: False)
    face = trimmed_face(plate(), [circle(0.5, 0.5, 0.3)], tolerance=TOLERANCE)
    assert face.n_edges == 4
    assert "No outline gave a valid face" in face.notes[-1]


def test_smooth_false_gives_straight_edges():
    face = trimmed_face(plate(), [circle(0.5, 0.5, 0.3)], tolerance=TOLERANCE, smooth=False)
    assert all(edge.pcurve.degree == 1 for edge in face.wires[0])
    assert face.deviation <= TOLERANCE


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf])
def test_a_tolerance_out_of_range_is_refused(tolerance):
    with pytest.raises(ParameterError, match="'tolerance' parameter of trimmed_face"):
        trimmed_face(plate(), tolerance=tolerance)


def test_a_loop_of_another_shape_and_a_surface_without_extent_are_refused():
    with pytest.raises(ParameterError, match=r"\(K, 2\)"):
        trimmed_face(plate(), [np.zeros((4, 3))], tolerance=TOLERANCE)
    surface = plate()
    point = BSplineSurface(surface.degrees, surface.knots, np.zeros_like(surface.control_points), surface.weights)
    with pytest.raises(NoResultError, match="no extent"):
        trimmed_face(point, tolerance=TOLERANCE)


def test_surfaces_survive_the_kernel_and_its_errors_become_ours():
    for surface in (plate(degrees=(2, 4)), cylinder()):
        back = from_surface(to_surface(surface))
        assert back.degrees == surface.degrees
        assert back.closed == surface.closed
        assert np.array_equal(back.knots[0], surface.knots[0])
        assert np.array_equal(back.control_points, surface.control_points)
        assert np.array_equal(back.weights, surface.weights)
    from OCP.gp import gp_Dir

    with pytest.raises(KernelError, match="could not do it"), kernel_errors("do it"):
        gp_Dir(0.0, 0.0, 0.0)
    with pytest.raises(ZeroDivisionError), kernel_errors("do it"):
        divmod(1, 0)
