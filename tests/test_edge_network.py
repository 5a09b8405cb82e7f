"""Curves along all edges of a part: closed, meeting in corners, near the true edges, written in every format."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import KDTree

from edge_shapes import box, box_edges, drum, wedge
from scan2nurbs.api import measure
from scan2nurbs.brep.cad import _read_exchange
from scan2nurbs.brep.curve_files import CURVES, NamedCurve, clamped, write_curves
from scan2nurbs.cli import outputs
from scan2nurbs.cli.main import main
from scan2nurbs.edges.detect import detect
from scan2nurbs.edges.follow import follow_ends
from scan2nurbs.edges.graph import Chain
from scan2nurbs.edges.meet import meet_ends
from scan2nurbs.edges.network import edge_network
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import ParameterError


@pytest.fixture(scope="module")
def network():
    measured = measure(box(30))
    edges = detect(measured.cloud.points, measured.scale, EdgeParams())
    return measured, edge_network(measured.cloud.points, measured.scale, edges.mask)


def test_a_box_has_curves_along_its_twelve_edges_and_eight_corners(network):
    measured, found = network
    samples = np.concatenate([edge.curve.sample(0.4) for edge in found.curves]) + measured.cloud.origin
    true = box_edges(30, 0.5)
    assert (KDTree(true).query(samples)[0] < 1).mean() > 0.95
    assert (KDTree(samples).query(true)[0] < 2).mean() > 0.9
    corners = np.stack(np.meshgrid([0, 30], [0, 30], [0, 30]), axis=-1).reshape(-1, 3)
    assert (KDTree(found.corners + measured.cloud.origin).query(corners)[0] < 2).sum() >= 6
    assert all(edge.curve.rms < 0.6 for edge in found.curves)


def test_curves_end_exactly_in_their_corners(network):
    _, found = network
    held = 0
    for edge in found.curves:
        for end, at in zip(edge.ends, (0.0, edge.curve.end), strict=True):
            if end >= 0:
                held += 1
                assert np.linalg.norm(edge.curve.spline(at) - found.corners[end]) < 1e-9
    assert held >= 12


def test_the_rims_of_a_drum_are_two_closed_curves():
    measured = measure(drum(16.0, 30.0))
    edges = detect(measured.cloud.points, measured.scale, EdgeParams())
    found = edge_network(measured.cloud.points, measured.scale, edges.mask)
    assert [edge.curve.closed for edge in found.curves] == [True, True]
    assert [edge.curve.length for edge in found.curves] == pytest.approx([2 * np.pi * 16] * 2, rel=0.02)
    assert len(found.corners) == 0


def test_no_edge_points_make_no_curves(network):
    measured, _ = network
    found = edge_network(measured.cloud.points, measured.scale, np.zeros(len(measured.cloud.points), bool))
    assert found.curves == ()


def test_a_crease_is_followed_to_its_end_and_no_farther():
    measured = measure(wedge(60.0, noise=0.1))
    points = measured.cloud.points + measured.cloud.origin
    start = np.array([[0.0, 20.0, 0.0]]) - measured.cloud.origin
    found = follow_ends(start, start, np.array([[0.0, 1.0, 0.0]]), measured.scale) + measured.cloud.origin
    assert np.abs(found[:, [0, 2]]).max() < 1.0
    assert 34 < found[:, 1].max() < 42
    assert len(points) > 0
    flat = np.array([[15.0, 20.0, -15.0 * np.tan(np.radians(30))]]) - measured.cloud.origin
    assert len(follow_ends(flat, flat, np.array([[0.0, 1.0, 0.0]]), measured.scale)) < 6


def test_ends_meet_where_their_tangents_do():
    a = np.column_stack([np.linspace(3, 15, 9), np.zeros(9), np.zeros(9)])
    b = np.column_stack([np.zeros(9), np.linspace(2, 14, 9), np.zeros(9)])
    c = np.column_stack([np.full(9, 40.0), np.linspace(2, 14, 9), np.zeros(9)])
    chains = [Chain(list(range(9)), False), Chain(list(range(9, 18)), False), Chain(list(range(18, 27)), False)]
    found = meet_ends(np.concatenate([a, b, c]), chains, 1.0, 0.0)
    assert found.corners == pytest.approx(np.zeros((1, 3)), abs=0.1)
    assert found.ends == [(0, -1), (0, -1), (-1, -1)]


def test_an_end_that_runs_into_a_curve_stops_there():
    a = np.column_stack([np.linspace(-12, 12, 17), np.zeros(17), np.zeros(17)])
    b = np.column_stack([np.zeros(9), np.linspace(3, 14, 9), np.zeros(9)])
    chains = [Chain(list(range(17)), False), Chain(list(range(17, 26)), False)]
    found = meet_ends(np.concatenate([a, b]), chains, 1.0, 0.0)
    assert found.ends == [(-1, -1), (0, -1)]
    assert np.linalg.norm(found.corners[0]) < 0.8


def _periodic():
    breaks = np.linspace(0.0, 10.0, 6)
    knots = np.r_[breaks[-4:-1] - 10, breaks, breaks[1:4] + 10]
    control = np.random.default_rng(0).random((len(knots) - 7, 3))
    return BSpline(knots, control[np.arange(len(knots) - 4) % len(control)], 3)


def test_clamping_a_periodic_curve_changes_no_point():
    spline = _periodic()
    at = np.linspace(0, 10, 201)
    held = clamped(spline)
    assert held(at) == pytest.approx(spline(at), abs=1e-12)
    assert (held.t[:4] == 0).all()
    assert held.c[0] == pytest.approx(held.c[-1])
    assert clamped(held)(at) == pytest.approx(spline(at), abs=1e-12)


@pytest.mark.parametrize("suffix", CURVES)
def test_curves_are_written_and_read_back(tmp_path, suffix):
    spline = _periodic()
    line = spline(np.linspace(0, 10, 50))
    path = tmp_path / f"curves{suffix}"
    curves = [NamedCurve("edge_1", spline, line), NamedCurve("edge_2", BSpline(spline.t, spline.c + 1, 3), line + 1)]
    write_curves(path, curves, unit="in")
    again = tmp_path / f"again{suffix}"
    write_curves(again, curves, unit="in", name="scan2nurbs")
    assert path.read_bytes() == again.read_bytes()
    if suffix in (".step", ".iges"):
        box_ = _bounds(_read_exchange(path, suffix[1:].upper()))
        expected = np.r_[line.min(axis=0), (line + 1).max(axis=0)] * 25.4
        assert box_ == pytest.approx(expected, abs=0.5)
    if suffix == ".obj":
        rows = path.read_text().splitlines()
        assert sum(row.startswith("v ") for row in rows) == 100
        assert [row for row in rows if row.startswith("l ")][1].split()[1] == "51"


def _bounds(shape):
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    found = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, found, False, False)
    low, high = found.CornerMin(), found.CornerMax()
    return np.array([low.X(), low.Y(), low.Z(), high.X(), high.Y(), high.Z()])


def test_wrong_requests_are_refused(tmp_path):
    curve = [NamedCurve("edge_1", _periodic(), np.zeros((2, 3)))]
    with pytest.raises(ParameterError, match="suffix"):
        write_curves(tmp_path / "c.txt", curve, unit="mm")
    with pytest.raises(ParameterError, match="unit"):
        write_curves(tmp_path / "c.step", curve, unit="furlong")
    with pytest.raises(ParameterError, match="at least one"):
        write_curves(tmp_path / "c.step", [], unit="mm")
    assert set(outputs.CURVES) == set(CURVES)


def _run(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in arguments])
    return stop.value.code


def test_the_command_writes_kinds_and_curves(tmp_path, capsys):
    scan = tmp_path / "scan.npy"
    np.save(scan, box(20))
    assert _run("edges", scan, "-o", tmp_path / "edges.npz", "--curves", tmp_path / "curves.obj", "--json", "--unit", "mm") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["edges"]["kinds"]["convex"] > 100
    assert record["edges"]["curves"]["corners"] >= 4
    assert len(record["edges"]["curves"]["curves"]) >= 6
    columns = np.load(tmp_path / "edges.npz")
    assert {"strength", "edge", "kind", "angle", "angle_error", "confidence"} <= set(columns.files)
    assert columns["kind"].dtype == np.uint8
    assert (tmp_path / "curves.obj").read_text().count("\nl ") == len(record["edges"]["curves"]["curves"])


def test_a_scan_without_edges_writes_no_file_of_curves(tmp_path, capsys):
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(4000, 3))
    scan = tmp_path / "ball.npy"
    np.save(scan, ball / np.linalg.norm(ball, axis=1, keepdims=True))
    assert _run("edges", scan, "--curves", tmp_path / "c.step", "--quiet", "--unit", "mm") == 4
    assert "No edge" in capsys.readouterr().err
    assert not (tmp_path / "c.step").exists()
