"""How wide a bend is: sharp creases against roundings, borders against holes, and the kernels under them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scan2nurbs as s2n
from scan2nurbs.edges.chains import chains_of
from scan2nurbs.edges.normals import normals_at
from scan2nurbs.kernels.alongside import mean_along, nearest_piece
from scan2nurbs.kernels.bend_widths import fit_bends
from scan2nurbs.kernels.cells import build_cells
from scan2nurbs.kernels.one_sided import one_sided_planes
from scan2nurbs.kernels.sides import Meetings, meeting_sides
from scan2nurbs.scale import estimate_noise


def bend(turn: float, radius: float, noise: float, seed: int = 0, length: int = 80, leg: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Two faces that meet through a rounding of some radius, a jittered grid of spacing 1; and the distance along them from its middle."""
    rng = np.random.default_rng(seed)
    s, y = np.meshgrid(np.arange(-leg, leg) + 0.5, np.arange(length) + 0.5)
    s, y = (a.ravel() + 0.5 * (rng.random(a.size) - 0.5) for a in (s, y))
    half = np.radians(turn) / 2
    angle = np.clip(s / radius, -half, half) if radius > 0 else np.sign(s) * half
    flat = s - radius * angle
    x = radius * np.sin(angle) + flat * np.cos(angle)
    z = radius * (np.cos(angle) - 1) - flat * np.sin(angle)
    points = np.c_[x, y, z]
    return points + noise * rng.normal(size=points.shape), s


@pytest.mark.parametrize(("turn", "noise"), [(90.0, 0.0), (90.0, 0.25), (90.0, 0.5), (40.0, 0.25)])
def test_a_crease_is_an_edge(turn, noise):
    points, s = bend(turn, 0.0, noise)
    edges = s2n.detect_edges(points)
    inner = (np.abs(points[:, 1] - 40) < 34) & (np.abs(s) < 24)
    # What lies within reach of the crease where noise put it.
    distance = np.hypot(points[:, 0], points[:, 2])
    assert edges.mask[inner & (distance < 0.5)].mean() > 0.9
    assert edges.mask[inner & (distance > 2.0)].mean() < 0.01
    assert np.median(edges.strength[inner & edges.mask]) == pytest.approx(turn, rel=0.15)


@pytest.mark.parametrize(("radius", "noise"), [(3.0, 0.0), (3.0, 0.25), (6.0, 0.25), (6.0, 0.5), (12.0, 0.5)])
def test_a_rounding_is_no_edge(radius, noise):
    points, s = bend(90.0, radius, noise)
    inner = (np.abs(points[:, 1] - 40) < 34) & (np.abs(s) < 24)
    assert s2n.detect_edges(points).mask[inner].mean() < 0.01


def plate(noise: float = 0.0, hole: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(1)
    xy = np.stack(np.meshgrid(np.arange(80.0), np.arange(80.0)), axis=-1).reshape(-1, 2) + 0.5 * rng.random((6400, 2))
    xy = xy[np.linalg.norm(xy - 40, axis=1) > hole]
    return np.c_[xy, np.zeros(len(xy))] + noise * rng.normal(size=(len(xy), 3))


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_the_border_of_a_scan_is_an_edge_and_a_hole_in_it_is_not(noise):
    points = plate(noise, hole=7.0)
    mask = s2n.detect_edges(points).mask
    to_border = np.minimum(points[:, :2], 80.25 - points[:, :2]).min(axis=1)
    assert mask[to_border < 0.5].mean() > 0.8
    assert not mask[to_border > 4.0].any()


def test_a_hole_as_wide_as_a_face_is_an_edge():
    points = plate(hole=20.0)
    mask = s2n.detect_edges(points).mask
    assert mask[np.linalg.norm(points[:, :2] - 40, axis=1) < 20.7].mean() > 0.9


def test_chains_reach_as_far_as_their_points_follow_each_other():
    line = np.c_[np.arange(10.0), np.zeros(10), np.zeros(10)]
    points = np.concatenate([line, line + np.array([20.0, 0.0, 0.0]), [(50.0, 0.0, 0.0)]])
    chains = chains_of(points, 1.5)
    np.testing.assert_allclose(chains.extent, [9.0] * 20 + [0.0])
    np.testing.assert_allclose(chains.mean(np.arange(21.0)), [4.5] * 10 + [14.5] * 10 + [20.0])
    assert chains_of(np.zeros((1, 3)), 1.0).extent.tolist() == [0.0]
    assert len(chains_of(np.zeros((0, 3)), 1.0).mean(np.zeros(0))) == 0


@pytest.mark.parametrize("turn", [20.0, 60.0, 90.0, 120.0])
def test_sides_meet_where_the_planes_do(turn):
    points, s = bend(turn, 0.0, 0.0)
    cells = build_cells(points, 5.0)
    balls = normals_at(cells, 3.0).balls
    chosen = one_sided_planes(cells, balls, 3.0, 0.0)
    places = np.flatnonzero((np.abs(s[cells.order]) < 1.0) & (np.abs(cells.points[:, 1] - 40) < 30))
    meetings = meeting_sides(cells, balls, chosen, places, 3.0)
    # Beside creases sharper than a right angle some planes are those of balls across it: this is where the fit starts only.
    assert np.median(np.degrees(meetings.turn)) == pytest.approx(turn, abs=2.0 if turn <= 90.0 else 8.0)
    assert np.median(np.abs(meetings.direction[:, 1])) > 0.999
    assert np.median(np.hypot(meetings.foot[:, 0], meetings.foot[:, 2])) < (0.1 if turn <= 90.0 else 0.5)


@given(offset=st.floats(-0.5, 0.5), lean=st.floats(-0.1, 0.1), turn=st.floats(40.0, 100.0))
def test_the_crease_is_refined(offset, lean, turn):
    points, s = bend(turn, 0.0, 0.0)
    cells = build_cells(points, 5.0)
    place = np.flatnonzero((np.abs(s[cells.order]) < 1.0) & (np.abs(cells.points[:, 1] - 40) < 2))[:1]
    direction = np.array([[lean, 1.0, 0.0]]) / np.hypot(1.0, lean)
    across = np.array([[1.0, -lean, 0.0]]) / np.hypot(1.0, lean)
    foot = np.array([[offset, cells.points[place[0], 1], 0.0]])
    meetings = Meetings(foot, direction, across, np.array([np.radians(turn)]))
    bends = fit_bends(cells, place, meetings, across=4.0, along=6.0, noise=0.1, spacing=1.0, widths=np.array([0.0, 2.0]))
    assert np.hypot(bends.foot[0, 0], bends.foot[0, 2]) < 0.35
    assert np.degrees(bends.turn[0]) == pytest.approx(turn, rel=0.15)
    assert bends.misfit[0, 0] < bends.misfit[0, 1] < bends.misfit[0, 2]


def test_means_along_creases_leave_other_creases_out():
    line = np.c_[np.zeros(40), np.arange(40) * 0.5, np.zeros(40)]
    feet = build_cells(np.concatenate([line, line + np.array([1.0, 0.0, 0.0])]), 4.0)
    which = (feet.order >= 40).astype(float)
    direction = np.where(which[:, None] > 0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    up = np.tile((0.0, 0.0, 1.0), (80, 1))
    np.testing.assert_allclose(mean_along(feet, direction, up, which[:, None], 4.0, 1.0)[:, 0], which, atol=1e-12)


def test_the_nearest_piece_is_that_of_a_search_over_all():
    rng = np.random.default_rng(5)
    points, middles = rng.random((400, 3)) * 10, rng.random((60, 3)) * 10
    direction = rng.normal(size=(60, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    cells, feet = build_cells(points, 2.0), build_cells(middles, 2.0)
    found = nearest_piece(cells, feet, np.ascontiguousarray(direction[feet.order]), 1.0, 1.5)
    step = cells.points[:, None] - feet.points
    along = np.clip((step * direction[feet.order]).sum(-1), -1.0, 1.0)
    distance = np.linalg.norm(step - along[..., None] * direction[feet.order], axis=-1)
    np.testing.assert_array_equal(found, np.where(distance.min(axis=1) < 1.5, distance.argmin(axis=1), -1))


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_fine_features_are_not_taken_for_noise(noise):
    """A corrugated plate, a wave every 10 spacings: hardly a place is smooth over 40 neighbours."""
    rng = np.random.default_rng(3)
    xy = np.stack(np.meshgrid(np.arange(90.0), np.arange(90.0)), axis=-1).reshape(-1, 2) + 0.5 * rng.random((8100, 2))
    points = np.c_[xy, 1.5 * np.abs((xy[:, 0] % 10) - 5.0)] + noise * rng.normal(size=(8100, 3))
    cells = build_cells(points, 5.0)
    assert estimate_noise(cells, 1.0) == pytest.approx(noise, abs=0.08)
