"""A tolerance for one face: its surface is as simple as that allows, and no simpler."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scan2nurbs.cli.main import main
from scan2nurbs.errors import NoResultError
from scan2nurbs.faces.corrections import read_face_corrections
from scan2nurbs.io import write_points
from scan2nurbs.part import part_scan
from scan2nurbs.part_faces import corrected
from scan2nurbs.surfaces.explain import lies_within
from scan2nurbs.surfaces.within import fit_within

NOISE = 0.02
WAVE = 0.3


def wavy(n: int = 9000, noise: float = NOISE) -> np.ndarray:
    """Return points on a sheet with waves, and ripples on them that are finer than the noise."""
    rng = np.random.default_rng(11)
    x, y = rng.uniform(0, 16, (2, n))
    z = WAVE * np.sin(0.55 * x) * np.cos(0.4 * y) + 0.4 * NOISE * np.sin(2.4 * x)
    return np.column_stack([x, y, z + rng.normal(0, noise, n)])


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return wavy()


@pytest.fixture(scope="module")
def scan(points, tmp_path_factory) -> Path:
    """A scan of the sheet alone."""
    path = tmp_path_factory.mktemp("wavy") / "wavy.ply"
    write_points(path, points[::3], {}, unit="mm")
    return path


def n_control_points(fit) -> int:
    return fit.shape.surface.weights.size


def test_the_looser_the_simpler(points):
    tight, default, loose = (fit_within(points, noise=NOISE, tolerance=value) for value in (0.1 * NOISE, NOISE, 0.4 * WAVE))
    assert {fit.shape.kind for fit in (tight, default, loose)} == {"bspline"}
    assert n_control_points(tight) > n_control_points(default) > n_control_points(loose)
    assert not any(fit.notes for fit in (tight, default, loose))
    assert fit_within(points, noise=NOISE, tolerance=1.5 * WAVE).shape.kind == "plane"


def test_the_surface_lies_within_its_tolerance(points):
    truth = wavy(noise=0.0)
    for tolerance in (0.5 * NOISE, 0.2 * WAVE, 0.6 * WAVE, 1.5 * WAVE):
        fit = fit_within(points, noise=NOISE, tolerance=tolerance)
        off = np.abs(fit.shape.distance(truth))
        assert np.quantile(off, 0.95) < tolerance + NOISE
        assert fit.tolerance == tolerance


def test_a_primitive_within_its_tolerance_is_taken(points):
    rng = np.random.default_rng(2)
    turn, height = rng.uniform(0, 2.0, 4000), rng.uniform(0, 10, 4000)
    radius = 8.0 + 0.1 * np.sin(2 * height) + rng.normal(0, NOISE, 4000)
    pipe = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    loose = fit_within(pipe, noise=NOISE, tolerance=0.15)
    assert loose.shape.kind == "cylinder"
    assert loose.shape.radius == pytest.approx(8.0, abs=0.05)
    assert fit_within(pipe, noise=NOISE, tolerance=0.03).shape.kind not in ("plane", "cylinder", "cone")


def test_a_type_that_was_asked_for_stays_and_a_miss_is_told(points):
    fit = fit_within(points, noise=NOISE, tolerance=0.5 * NOISE, kind="plane")
    assert fit.shape.kind == "plane"
    assert fit.notes == ("The plane lies farther from the points than its tolerance.",)
    assert fit_within(points, noise=NOISE, tolerance=1.5 * WAVE, kind="bspline").shape.kind == "bspline"
    with pytest.raises(NoResultError):
        fit_within(points[:2], noise=NOISE, tolerance=1.0)


@pytest.mark.parametrize("tolerance", [1e-300, 1e300])
@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize("n", [12, 300])
def test_no_tolerance_and_no_face_is_too_small_or_too_large(n, noise, tolerance):
    fit = fit_within(wavy(n), noise=noise, tolerance=tolerance)
    assert np.isfinite(fit.rms)
    if tolerance > 1:
        assert (fit.shape.kind, fit.notes) == ("plane", ())
    forced = fit_within(wavy(n), noise=noise, tolerance=tolerance, kind="bspline")
    assert (forced.shape.kind, forced.tolerance) == ("bspline", tolerance)
    if noise == 0:
        assert bool(fit.notes) == (tolerance < 1)


def test_lengths_of_any_size_give_the_same(points):
    few = points[::3]
    plain, tiny = (fit_within(few * size, noise=NOISE * size, tolerance=0.1 * size) for size in (1.0, 1e-6))
    assert n_control_points(plain) == n_control_points(tiny)


def test_strays_do_not_decide_and_blocks_do(points):
    rng = np.random.default_rng(1)
    off = rng.normal(0, NOISE, len(points))
    assert lies_within(points, off, NOISE, 0.1 * NOISE)
    few, corner = rng.random(len(points)) < 0.02, (points[:, :2] < 4).all(axis=1)
    assert lies_within(points, off + few, NOISE, 0.1 * NOISE)
    assert not lies_within(points, off + 2.0 * NOISE * corner, NOISE, NOISE)
    assert lies_within(points, off + 2.0 * NOISE * corner, NOISE, 2.0 * NOISE)


def test_it_survives_a_merge_and_shows_in_the_report(scan, tmp_path, capsys):
    """Whatever faces the sheet was parted into: they become one, whose tolerance came first."""
    before = part_scan(scan)
    n_faces = len(before.faces.fits)
    merge = [{"merge": list(range(n_faces))}] if n_faces > 1 else []
    found = {}
    for name, value in (("loose", 0.4 * WAVE), ("tight", 0.1 * NOISE)):
        steps = [{"tolerance": {"face": 0, "value": value}}, *merge]
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(steps), encoding="utf-8")
        (fit,) = corrected(before, read_face_corrections(path)).faces.fits
        assert fit.tolerance == value
        found[name] = n_control_points(fit)
    assert found["loose"] < found["tight"]
    files = [tmp_path / name for name in ("one.step", "two.step")]
    for file in files:
        arguments = ["convert", scan, "-o", file, "--corrections", tmp_path / "loose.json", "--quiet", "--json"]
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        assert not stopped.value.code
        (face,) = json.loads(capsys.readouterr().out)["faces"]
        assert face["tolerance"] == 0.4 * WAVE
        assert face["n_control_points"] == found["loose"]
    assert files[0].read_bytes() == files[1].read_bytes()
