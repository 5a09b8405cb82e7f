"""From points to a trimmed face: the whole of reconstruct_surface on plateaus of known shape."""

from __future__ import annotations

import numpy as np
import pytest

import scan2nurbs as s2n
from scan2nurbs.brep.read import read_back
from scan2nurbs.edges.boundary import BoundaryParams
from scan2nurbs.edges.corrections import Box, Selection
from scan2nurbs.faces.region import RegionParams
from scan2nurbs.pipeline import SurfaceParams, reconstruct_surface
from scan2nurbs.report.record import plain

RADIUS, HOLE = 40.0, 12.0


def top(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the functional surface."""
    return 9.0 * np.cos(x / 35.0) * np.cos(y / 45.0)


def dome(noise: float = 0.25, *, hole: bool = False, n: int = 12_000, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A bent disc with slopes of 50 degrees around it; which points lie on the disc; how far off its rim they lie."""
    rng = np.random.default_rng(seed)
    xy = (rng.random((n, 2)) - 0.5) * np.sqrt(n)
    r = np.hypot(*xy.T)
    beyond = np.maximum(r - RADIUS, HOLE - r if hole else -np.inf)
    points = np.c_[xy, top(*xy.T) - np.where(beyond > 0, 1.2 * beyond, 0.0)]
    return points + noise * rng.normal(size=points.shape), beyond < 0, np.abs(beyond)


@pytest.fixture(scope="module")
def model():
    return reconstruct_surface(dome()[0], unit="mm")


@pytest.mark.parametrize("hole", [False, True])
def test_the_face_is_the_disc(hole, tmp_path):
    points, on_disc, off = dome(0.25, hole=hole)
    model = reconstruct_surface(points, SurfaceParams(region=RegionParams(seed=(25.0, 0.0, 9.0))))
    assert np.mean(model.inside[off > 2] == on_disc[off > 2]) > 0.99
    area = np.pi * (RADIUS**2 - (HOLE**2 if hole else 0.0))
    grid = np.stack(np.meshgrid(*[np.linspace(-40, 40, 161)] * 2), axis=2).reshape(-1, 2)
    r = np.hypot(*grid.T)
    grid = grid[(r < RADIUS) & (r > (HOLE if hole else 0))]
    step = 1e-4
    slope = np.stack([(top(*(grid + d).T) - top(*(grid - d).T)) / (2 * step) for d in np.eye(2) * step])
    assert model.face.area == pytest.approx(area * np.sqrt(1 + (slope**2).sum(axis=0)).mean(), rel=0.02)
    assert model.face.valid
    assert len(model.trim.loops) == 1 + hole
    assert len(model.boundary.curves) >= 1 + hole


def test_the_surface_averages_the_noise_out(model):
    uv = model.fit.uv[model.fit.weights > 0]
    place = model.fit.surface.evaluate(uv) + model.cloud.origin
    inner = np.hypot(place[:, 0], place[:, 1]) < RADIUS - 2
    error = place[inner, 2] - top(place[inner, 0], place[inner, 1])
    assert np.sqrt(np.mean(error**2)) < 0.3 * 0.25
    assert model.fit.rms == pytest.approx(0.25, rel=0.1)


@pytest.mark.parametrize("suffix", [".step", ".brep"])
def test_the_file_holds_the_face_in_the_input_s_coordinates(suffix, tmp_path):
    points = dome()[0] + np.array([4.0e5, 5.0e5, 100.0])
    model = reconstruct_surface(points, unit="mm")
    model.write(tmp_path / f"face{suffix}")
    back = read_back(tmp_path / f"face{suffix}")
    (face,) = back.faces
    middle = face.surface.evaluate(np.mean(face.surface.domain, axis=1)[None])
    expected = model.face.surface.evaluate(np.mean(model.face.surface.domain, axis=1)[None]) + model.cloud.origin
    np.testing.assert_allclose(middle, expected, atol=1e-6)


def test_the_report_is_plain_data_with_every_figure(model):
    report = plain(model.report)
    (face,) = report["faces"]
    assert face["rms"] == model.fit.rms
    assert face["n_control_points"] == np.prod(face["net"]) == model.fit.n_control_points
    assert face["p95"] < face["max"]
    assert report["model"]["valid"] is True
    assert report["inside"]["n_points"] == model.inside.sum()
    assert set(report["seconds"]) == {"read", "scale", "edges", "boundary", "inside", "fit", "trim"}
    assert report["parameters"]["edges"]["operator"] == "one-sided"
    assert report["boundary"]["points"]["detected"] == model.edges.mask.sum()


def test_the_same_points_give_the_same_face_at_any_number_of_threads(tmp_path):
    points = dome(n=5000)[0]
    files = []
    for threads in (1, 2, 5):
        s2n.set_threads(threads)
        reconstruct_surface(points, unit="mm").write(tmp_path / f"{threads}.step")
        files.append((tmp_path / f"{threads}.step").read_bytes())
    s2n.set_threads(None)
    assert files[0] == files[1] == files[2]


def test_order_changes_nothing_that_matters(model):
    points = dome()[0]
    order = np.random.default_rng(0).permutation(len(points))
    again = reconstruct_surface(points[order], unit="mm")
    assert np.mean(again.inside == model.inside[order]) > 0.995
    assert again.face.area == pytest.approx(model.face.area, rel=5e-3)
    assert again.fit.rms == pytest.approx(model.fit.rms, rel=0.02)


def test_the_seed_chooses_the_surface():
    points, on_disc, off = dome(0.1)
    slope = (49.0, 0.0, float(top(np.array(49.0), np.array(0.0))) - 10.8)
    model = reconstruct_surface(points, SurfaceParams(region=RegionParams(seed=slope)))
    assert model.inside[~on_disc & (off > 3) & (points[:, 0] > 45)].mean() > 0.9
    assert not model.inside[on_disc & (off > 2)].any()


def test_algorithm_3_groups_a_disc():
    points, on_disc, off = dome(0.1)
    model = reconstruct_surface(
        points,
        SurfaceParams(
            grouping="algorithm-3",
            boundary=BoundaryParams(keep_only=Selection(boxes=(Box((-44.0, -44.0, -50.0), (44.0, 44.0, 50.0)),))),
        ),
    )
    assert model.region is None
    assert np.mean(model.inside[off > 3] == on_disc[off > 3]) > 0.98


def test_dropped_boundary_points_do_not_bound():
    points, _on_disc, _off = dome(0.1, hole=True)
    hole = Selection(boxes=(Box((-16.0, -16.0, -50.0), (16.0, 16.0, 50.0)),))
    model = reconstruct_surface(points, SurfaceParams(boundary=BoundaryParams(drop=hole), region=RegionParams(seed=(25.0, 0.0, 9.0))))
    near_hole = np.hypot(points[:, 0], points[:, 1]) < HOLE + 2
    assert not model.band.on_edge[near_hole].any()
    assert model.report["boundary"]["points"]["dropped_by_hand"] > 50
    rows = Selection(indices=tuple(np.flatnonzero(near_hole)))
    by_row = reconstruct_surface(points, SurfaceParams(boundary=BoundaryParams(drop=rows), region=RegionParams(seed=(25.0, 0.0, 9.0))))
    assert not by_row.band.on_edge[near_hole].any()


def test_progress_is_told_by_stage():
    seen: dict[str, list[tuple[int, int]]] = {}
    reconstruct_surface(dome(n=3000)[0], progress=lambda stage, done, total: seen.setdefault(stage, []).append((done, total)))
    assert {"measuring", "finding edges", "fitting"} <= set(seen)
    assert all(0 < done <= total for calls in seen.values() for done, total in calls)


def test_a_scan_without_edges_is_one_surface():
    rng = np.random.default_rng(1)
    xy = rng.random((6000, 2)) * [120.0, 50.0]
    points = np.c_[xy, top(xy[:, 0] - 60, xy[:, 1] - 25)] + 0.1 * rng.normal(size=(6000, 3))
    model = reconstruct_surface(points)
    assert model.inside.mean() > 0.99
    assert len(model.trim.loops) == 1
    assert len(model.trim.loops[0].corners) == 4
    slope = 1 + 0.5 * ((9 / 35 * np.sin((xy[:, 0] - 60) / 35)) ** 2 + (9 / 45 * np.sin((xy[:, 1] - 25) / 45)) ** 2).mean()
    assert model.face.area == pytest.approx(6000.0 * slope, rel=0.02)


@pytest.mark.parametrize(
    ("points", "error"),
    [
        (np.c_[np.arange(100.0), np.zeros((100, 2))], s2n.NoResultError),
        (np.eye(3), s2n.NoResultError),
        (np.ones((5, 3)), s2n.InputError),
        ("there is no such file.ply", s2n.InputError),
    ],
)
def test_what_is_no_surface_ends_in_a_clear_error(points, error):
    with pytest.raises(error, match=r"\.$|\.ply"):
        reconstruct_surface(points)


def test_what_cannot_be_unrolled_is_parted_at_its_bends(monkeypatch):
    from scan2nurbs import pipeline
    from test_region import ridge

    sizes: list[int] = []

    def choosy(points, *arguments, **options):
        sizes.append(len(points))
        if len(sizes) == 1:
            raise s2n.NoResultError("Every map tried folds over.")
        return fit_surface(points, *arguments, **options)

    fit_surface = pipeline.fit_surface
    monkeypatch.setattr(pipeline, "fit_surface", choosy)
    model = reconstruct_surface(ridge())
    assert sizes[1] < 0.7 * sizes[0]
    assert pipeline.PARTED in model.report["warnings"]
    sizes.clear()
    with pytest.raises(s2n.NoResultError, match="folds over"):  # nothing to part
        reconstruct_surface(dome(0.1, n=5000)[0])


def test_an_unknown_grouping_is_refused():
    with pytest.raises(s2n.ParameterError, match="grouping"):
        SurfaceParams(grouping="flood")
