"""The truth that the benchmarks score against: edges of simple parts, and scores of right and wrong answers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.edges import Reference
from benchmarks.pcednet import scores as pcednet_scores
from benchmarks.scores import score_curves, score_edges, score_faces, score_model
from benchmarks.truth import CONDITIONS, edge_samples, sample, true_part
from examples.parts import WHOLE


@pytest.fixture(scope="module")
def box():
    return sample(true_part(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape()), {"noise": 0.0}, points=4000)


def test_a_box_has_twelve_convex_edges_of_90_degrees():
    edges = edge_samples(true_part(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape()), 0.1)
    assert edges.angle == pytest.approx(90.0)
    assert edges.convex.all()
    assert not edges.border.any()
    assert len(np.unique(np.sort(edges.pair, axis=1), axis=0)) == 12
    assert len(edges.points) == pytest.approx(4 * 12 / 0.1, rel=0.05)


def test_a_seam_is_no_edge_and_a_sheet_ends_at_borders():
    cylinder = edge_samples(true_part(BRepPrimAPI_MakeCylinder(1.0, 3.0).Shape()), 0.1)
    seam = cylinder.pair[:, 0] == cylinder.pair[:, 1]
    assert cylinder.angle[seam] == pytest.approx(0.0, abs=1e-5)
    assert cylinder.angle[~seam] == pytest.approx(90.0)
    sheet = edge_samples(true_part(WHOLE["open_panel"].build()), 1.0)
    assert 0.5 < sheet.border.mean() < 1.0
    assert (sheet.angle[sheet.border] == 180.0).all()


def test_inner_angles_are_concave():
    truth = edge_samples(true_part(WHOLE["bracket"].build()), 0.5)
    inner = (np.abs(truth.points[:, [0, 2]] - 10) < 1e-6).all(axis=1) & (np.abs(truth.points[:, 1]) > 6) & (np.abs(truth.points[:, 1]) < 24)
    assert inner.any()
    assert not truth.convex[inner].any()
    outer = (np.abs(truth.points[:, [0, 2]]) < 1e-6).all(axis=1)
    assert truth.convex[outer].all()


def test_the_right_answer_scores_one_and_a_wrong_one_less(box):
    on_edge = (np.abs(box.scan.clean - [1.5, 2.0, 2.5]) > np.array([1.5, 2.0, 2.5]) - box.h).sum(axis=1) >= 2
    right = score_edges(box, on_edge)
    assert right["t1"]["precision"] > 0.95
    assert right["t2"]["f1"] == pytest.approx(1.0)
    assert score_edges(box, np.ones(len(on_edge), bool))["t2"]["f1"] < 0.6
    assert score_edges(box, np.zeros(len(on_edge), bool))["t2"]["f1"] == 0.0
    same = Reference(box).f1(on_edge.astype(float), np.array([0.5]))[0]
    assert same == pytest.approx([right["t1"]["f1"], right["t2"]["f1"]], abs=0.01)
    assert score_faces(box, box.scan.face)["faces"] == {"iou": 1.0, "f1": 1.0, "true": 6.0, "found": 6.0}
    assert score_faces(box, np.zeros(len(on_edge), int))["faces"]["iou"] < 0.1
    whole = score_model(box, BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape())
    assert whole["closed"] == whole["coverage"] == whole["precision"] == 1.0
    assert score_model(box, BRepPrimAPI_MakeBox(3.0, 4.0, 2.5).Shape())["coverage"] < 0.7


def test_curves_are_scored_by_length(box):
    along = np.linspace(0, 1, 200)[:, None]
    edge, across = along * [3.0, 0, 0], [0, 2.0, 0] + along * [3.0, 0, 0]
    assert score_curves(box, [edge]) == {"precision": 1.0, "recall": pytest.approx(3 / 48, rel=0.5), "curves": 1.0}
    assert score_curves(box, [edge, across])["precision"] == pytest.approx(0.5, abs=0.1)
    assert score_curves(box, [])["recall"] == 0.0


@pytest.mark.parametrize("condition", CONDITIONS)
def test_every_condition_samples_as_it_says(condition):
    truth = sample(true_part(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape()), CONDITIONS[condition], points=6000)
    real = truth.scan.face >= 0
    off = (truth.points - truth.scan.clean)[real]
    assert off.std() == pytest.approx(CONDITIONS[condition]["noise"] * truth.h, rel=0.05)
    assert (~real).mean() == pytest.approx(CONDITIONS[condition].get("outliers", 0.0))


def test_published_marks_are_scored_exactly_and_nearby():
    points = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    truth = np.arange(10) == 5
    assert pcednet_scores(points, truth, np.arange(10) == 6) == (0.0, 1.0)
    assert pcednet_scores(points, truth, truth) == (1.0, 1.0)
    assert pcednet_scores(points, truth, np.arange(10) == 9) == (0.0, 0.0)
