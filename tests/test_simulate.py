"""The scan simulator: what it measures is true, what it disturbs has the size that was asked for."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import tessellate
from scan2nurbs.cloud import as_cloud
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.kernels.runner import set_threads
from scan2nurbs.simulate import SimulateParams, simulate_scan, write_scan
from scan2nurbs.simulate.views import view_directions, view_frame

RADIUS = 30.0
ABOVE = {"views": 1, "spread": 0.0}


@functools.cache
def sphere():
    return tessellate(BRepPrimAPI_MakeSphere(gp_Pnt(5, -3, 2), RADIUS).Shape())


def block(x, y, z):
    return BRepPrimAPI_MakeBox(gp_Pnt(x[0], y[0], z[0]), gp_Pnt(x[1], y[1], z[1])).Shape()


@functools.cache
def table():
    """A slab over the middle of a plate, on a thin leg."""
    shape = BRepAlgoAPI_Fuse(block((0, 100), (0, 100), (0, 5)), block((48, 52), (48, 52), (4, 40))).Shape()
    return tessellate(BRepAlgoAPI_Fuse(shape, block((30, 70), (30, 70), (39, 42))).Shape())


def scan(part, **given):
    return simulate_scan(part, SimulateParams(**{"n_points": 4000, **given}))


def from_centre(points):
    return np.linalg.norm(points - [5, -3, 2], axis=1)


@pytest.mark.parametrize("mode", ["scanner", "grid", "random", "uneven"])
def test_measures_exactly_on_the_true_surface(mode):
    made = scan(sphere(), mode=mode, noise=0)
    assert made.points.shape == (4000, 3)
    assert np.array_equal(made.points, made.clean)
    assert np.abs(from_centre(made.clean) - RADIUS).max() < 1e-6 * made.spacing
    assert made.normal == pytest.approx((made.clean - [5, -3, 2]) / RADIUS, abs=1e-9)
    assert (made.view >= 0).all() == (mode == "scanner")


@pytest.mark.parametrize("mode", ["scanner", "grid", "random"])
def test_spreads_its_points_evenly(mode):
    made = scan(sphere(), mode=mode, n_points=20_000)
    assert made.spacing == pytest.approx(np.sqrt(4 * np.pi * RADIUS**2 / 20_000), rel=0.02)
    octant = ((made.clean > [5, -3, 2]) @ [1, 2, 4]).astype(int)
    assert np.bincount(octant) == pytest.approx(20_000 / 8, rel=0.1)
    twelfth = KDTree(made.clean).query(made.clean, k=13)[0][:, 12]
    assert np.median(twelfth) * np.sqrt(np.pi / 12) == pytest.approx(made.spacing, rel=0.05)


def test_density_swings_where_it_is_asked_to_be_uneven():
    twelfth = {}
    for mode in ("random", "uneven"):
        clean = scan(sphere(), mode=mode, n_points=10_000).clean
        low, high = np.percentile(KDTree(clean).query(clean, k=13)[0][:, 12], [5, 95])
        twelfth[mode] = (high / low) ** 2
    assert twelfth["uneven"] > 1.4 * twelfth["random"]


def test_reaches_the_spacing_that_was_asked_for():
    made = scan(sphere(), n_points=None, spacing=1.1, outliers=0.1)
    assert made.spacing == pytest.approx(1.1, rel=0.02)
    assert len(made.points) == pytest.approx(4 * np.pi * RADIUS**2 / 1.1**2 / 0.9, rel=0.03)


def test_a_spacing_that_asks_for_too_many_points_is_refused():
    with pytest.raises(ParameterError, match="points on this part"):
        scan(sphere(), n_points=None, spacing=1e-9)


def test_noise_has_the_size_and_direction_that_was_asked_for():
    made = scan(table(), n_points=20_000, noise=0.4, noise_across=0.15, **ABOVE)
    error = (made.points - made.clean) / made.spacing
    assert error.std(axis=0) == pytest.approx([0.15, 0.15, 0.4], rel=0.03)
    assert error.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.015)
    absolute = scan(table(), n_points=20_000, noise=0.4, noise_unit="length", **ABOVE)
    assert (absolute.points - absolute.clean)[:, 2].std() == pytest.approx(0.4, rel=0.03)
    assert absolute.noise == 0.4


@pytest.mark.parametrize("growth", [0.0, 1.0])
def test_noise_grows_with_the_incidence(growth):
    made = scan(sphere(), n_points=30_000, noise=0.3, noise_growth=growth, **ABOVE)
    along = (made.points - made.clean)[:, 2] / made.noise
    cosine = made.normal[:, 2]
    for low, high in ((0.3, 0.5), (0.5, 0.8), (0.8, 1.0)):
        rows = (cosine > low) & (cosine < high)
        assert (along[rows] * cosine[rows] ** growth).std() == pytest.approx(1.0, rel=0.06)


def test_hidden_faces_give_no_points():
    made = scan(table(), **ABOVE)
    under = (made.clean[:, 2] < 6) & (np.abs(made.clean[:, :2] - 50) < 19.5).all(axis=1)
    assert not under.any()
    assert (made.normal[:, 2] > 0.99).all()
    around = scan(table(), n_points=8000)
    assert ((around.clean[:, 2] < 6) & (np.abs(around.clean[:, :2] - 50) < 19.5).all(axis=1)).any()
    assert len(np.unique(around.face)) == len(table().faces)


def test_a_sheet_is_seen_from_both_sides():
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Dir, gp_Pln

    sheet = tessellate(BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 0, 10, 0, 10).Face())
    for side in (1.0, -1.0):
        made = scan(sheet, views=((0.0, 0.3, side),), noise=0)
        assert len(made.points) == 4000
        assert made.clean[:, 2] == pytest.approx(0)
    with pytest.raises(NoResultError, match="hidden"):
        scan(sheet, views=((1.0, 0.0, 0.0),))


def test_grazed_surfaces_drop_out():
    sharp = scan(sphere(), n_points=20_000, grazing_limit=60, grazing_fade=0, **ABOVE)
    incidence = np.degrees(np.arccos(sharp.normal[:, 2]))
    assert incidence.max() == pytest.approx(60, abs=0.3)
    soft = scan(sphere(), n_points=40_000, grazing_limit=80, grazing_fade=40, **ABOVE)
    z = soft.normal[:, 2]
    # A ray's pixel covers the same area of the disc, so the disc's rings tell the share that came back.
    bands = np.radians([0, 40, 50, 60, 70, 80])
    ring = np.diff(np.sin(bands) ** 2)
    share = np.histogram(np.arccos(z), bands)[0] / ring
    expected = np.array([1.0, 0.875, 0.625, 0.375, 0.125])
    assert share / share[0] == pytest.approx(expected, abs=0.06)


def test_what_the_projector_does_not_light_is_missing():
    def plate(made):
        return (np.abs(made.clean[:, 2] - 5) < 1e-9).sum() / (np.abs(made.clean[:, 2] - 42) < 1e-9).sum()

    alone, lit = scan(table(), n_points=20_000, **ABOVE), scan(table(), n_points=20_000, parallax=30.0, **ABOVE)
    # The slab, 37 above the plate, hides 37 tan 30° = 21.4 of it along one side of 40, besides what lies below it.
    top = 40 * 40
    assert plate(alone) == pytest.approx((100 * 100 - top) / top, rel=0.05)
    assert plate(lit) == pytest.approx((100 * 100 - top - (37 * np.tan(np.radians(30))) * 40) / top, rel=0.05)


def test_overlap_is_kept_or_thinned():
    kept = scan(sphere(), n_points=20_000, overlap="keep", views=6)
    thin = scan(sphere(), n_points=20_000, views=6)
    directions = view_directions(thin.params)
    best = (thin.normal @ directions.T).argmax(axis=1)
    assert (best == thin.view).mean() > 0.97
    assert ((kept.normal @ directions.T).argmax(axis=1) == kept.view).mean() < 0.8


def test_edges_are_measured_no_denser_than_faces():
    made = scan(tessellate(block((0, 100), (0, 80), (0, 60))), n_points=40_000, noise=0)
    h = made.spacing
    assert h == pytest.approx(np.sqrt(2 * (8000 + 6000 + 4800) / 40_000), rel=0.02)
    to_sides = np.minimum(made.clean, [100, 80, 60] - made.clean)
    to_edge = np.sort(to_sides, axis=1)[:, 1]  # the smallest is the distance to the point's own face, zero
    for near, far in ((0, 1), (1, 2)):
        band = 4 * sum(2 * (far - near) * h * side for side in (100, 80, 60))
        assert ((to_edge >= near * h) & (to_edge < far * h)).sum() * h**2 / band == pytest.approx(1.0, abs=0.12)


def test_a_sheet_is_measured_once_from_all_around():
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Dir, gp_Pln

    sheet = tessellate(BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 0, 10, 0, 10).Face())
    assert scan(sheet).spacing == pytest.approx(np.sqrt(100 / 4000), rel=0.03)
    assert scan(sheet, parallax=20.0).spacing == pytest.approx(np.sqrt(100 / 4000), rel=0.03)


def test_holes_are_empty_and_have_their_size():
    made = scan(sphere(), n_points=10_000, holes=3, hole_radius=12.0, noise=0)
    reference = scan(sphere(), n_points=10_000, noise=0).clean
    distance = KDTree(made.clean).query(reference)[0] / made.spacing
    assert 10.5 < distance.max() <= 13.5
    assert len(made.points) == 10_000


def test_outliers_have_their_share_and_no_truth():
    made = scan(table(), n_points=10_000, outliers=0.2)
    lost = made.face < 0
    assert lost.sum() == 2000
    assert np.isnan(made.clean[lost]).all()
    assert np.isnan(made.normal[lost]).all()
    assert (made.view[lost] == -1).all()
    distance = KDTree(made.clean[~lost]).query(made.points[lost])[0] / made.spacing
    assert (distance < 15.1).sum() >= 1000
    low, high = made.points[~lost].min(axis=0), made.points[~lost].max(axis=0)
    assert ((made.points[lost] > low - 15.1 * made.spacing) & (made.points[lost] < high + 15.1 * made.spacing)).all()


def test_is_the_same_for_a_seed_and_any_number_of_threads():
    wish = {"n_points": 5000, "outliers": 0.05, "holes": 2, "parallax": 10.0, "views": 4}
    try:
        set_threads(1)
        first = scan(table(), **wish)
        set_threads(3)
        second = scan(table(), **wish)
    finally:
        set_threads(None)
    for name in ("points", "face", "clean", "normal", "view"):
        assert np.array_equal(getattr(first, name), getattr(second, name), equal_nan=name in ("clean", "normal"))
    assert not np.array_equal(first.points, scan(table(), **wish, seed=2).points)


def test_far_from_the_origin_nothing_is_lost():
    here = scan(tessellate(block((0, 7), (0, 5), (0, 3))), noise=0, shuffle=False)
    far = scan(tessellate(block((4e5, 4e5 + 7), (5e6, 5e6 + 5), (0, 3))), noise=0, shuffle=False)
    assert far.clean - [4e5, 5e6, 0] == pytest.approx(here.clean, abs=1e-8)


def test_scale_does_not_matter():
    small = scan(tessellate(block((0, 7e-2), (0, 5e-2), (0, 3e-2))), shuffle=False)
    large = scan(tessellate(block((0, 7e4), (0, 5e4), (0, 3e4))), shuffle=False)
    assert small.points * 1e6 == pytest.approx(large.points, rel=1e-6, abs=1e-2)


def test_order_is_random_or_by_view():
    ordered = scan(sphere(), shuffle=False, outliers=0.1)
    assert (np.diff(ordered.view[:3600]) >= 0).all()
    assert (ordered.face[3600:] == -1).all()
    assert (np.diff(scan(sphere()).view) < 0).any()


def test_writes_the_scan_and_its_truth(tmp_path):
    made = scan(table(), outliers=0.1)
    write_scan(made, tmp_path / "scan.ply", tmp_path / "truth.npz")
    cloud = as_cloud(tmp_path / "scan.ply")
    assert cloud.points + cloud.origin == pytest.approx(made.points, abs=1e-12)
    with np.load(tmp_path / "truth.npz") as truth:
        assert np.array_equal(truth["label"], made.face)
        assert len(truth["clean"]) == len(truth["normal"]) == 3600
        assert (float(truth["h"]), float(truth["noise"])) == (made.spacing, pytest.approx(0.1))
        assert tuple(truth["types"]) == made.types


@pytest.mark.parametrize("n", [1, 2, 7])
def test_views_fill_the_cap(n):
    params = SimulateParams(views=n, spread=40.0, up=(1.0, 2.0, -2.0))
    directions = view_directions(params)
    tilt = np.degrees(np.arccos(np.clip(directions @ (np.array([1, 2, -2]) / 3), -1, 1)))
    assert tilt[0] == pytest.approx(0, abs=1e-5)
    assert tilt.max() == pytest.approx(40.0 if n > 1 else 0.0, abs=1e-5)
    for direction in directions:
        frame = view_frame(direction)
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)
        assert frame[2] == pytest.approx(direction)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"n_points": 3}, "'n_points' parameter of simulate_scan must be an int"),
        ({"n_points": 100, "spacing": 1.0}, "Only one of"),
        ({"spacing": 0.0}, "'spacing'"),
        ({"spacing": float("nan")}, "'spacing'"),
        ({"mode": "magic"}, "'mode' parameter of simulate_scan must be one of scanner"),
        ({"views": 0}, "'views'"),
        ({"views": ()}, "'views'"),
        ({"views": ((0.0, 0.0, 0.0),)}, "'views'"),
        ({"views": ((0.0, 1.0),)}, "'views'"),
        ({"views": "north"}, "'views'"),
        ({"up": (0.0, 0.0, float("inf"))}, "'up'"),
        ({"spread": 181.0}, "'spread'"),
        ({"overlap": "some"}, "'overlap'"),
        ({"parallax": -1.0}, "'parallax'"),
        ({"grazing_limit": 90.0}, "'grazing_limit'"),
        ({"jitter": 0.6}, "'jitter'"),
        ({"noise": -0.1}, "'noise'"),
        ({"noise": float("inf")}, "'noise'"),
        ({"outliers": 0.95}, "'outliers'"),
        ({"holes": -1}, "'holes'"),
        ({"hole_radius": 0.0}, "'hole_radius'"),
        ({"seed": -1}, "'seed'"),
        ({"seed": 1.5}, "'seed'"),
    ],
)
def test_says_which_parameter_is_wrong(wrong, said):
    with pytest.raises(ParameterError, match=said):
        SimulateParams(**wrong)


def test_refuses_more_rays_than_fit():
    with pytest.raises(ParameterError, match="too fine"):
        scan(tessellate(block((0, 1e6), (0, 1e6), (0, 1.0))), n_points=None, spacing=1.0)


def test_holes_that_leave_nothing_are_an_error():
    with pytest.raises(NoResultError, match="holes"):
        scan(sphere(), n_points=100, holes=500, hole_radius=50.0)
