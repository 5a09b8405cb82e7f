"""The gallery of the paper's experiments, on small scans: the truth it judges by, its scores, its pictures and its page."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

from examples.paper import experiments as ex  # noqa: E402
from examples.paper import gallery, pictures, procedure, statements, truth  # noqa: E402
from examples.paper.clouds import Model, with_truth  # noqa: E402
from examples.paper.page import write_page  # noqa: E402

from scan2nurbs.brep.cad import tessellate  # noqa: E402
from scan2nurbs.simulate import SimulateParams, simulate_scan  # noqa: E402


@pytest.fixture(scope="module")
def box() -> truth.StandIn:
    """A box, 20 by 20 by 10, scanned from all around; its top is the functional surface."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    part = tessellate(BRepPrimAPI_MakeBox(20.0, 20.0, 10.0).Shape())
    scan = simulate_scan(part, SimulateParams(n_points=8000, mode="grid", noise=0.1))
    return with_truth("A box: for tests.", scan, part, part.nearest_face((10.0, 10.0, 10.0)))


@pytest.fixture(scope="module")
def step() -> truth.StandIn:
    return Model("shallow_step").scan(n_points=6000)


def test_the_edges_of_a_box_are_its_twelve(box):
    part = tessellate(_box_shape())
    edges = truth.edges_between_faces(part)
    assert edges.angle == pytest.approx(np.full(len(edges.angle), 90.0))
    assert np.linalg.norm(edges.ends[:, 1] - edges.ends[:, 0], axis=1).sum() == pytest.approx(4 * (20 + 20 + 10))
    samples, row = edges.sample(0.5)
    assert np.bincount(row).min() >= 20
    assert len(samples) == pytest.approx(400, abs=12)


def _box_shape():
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    return BRepPrimAPI_MakeBox(20.0, 20.0, 10.0).Shape()


def test_the_border_of_the_top_is_its_four_edges(box):
    assert np.allclose(box.border[:, 2], 10.0)
    on_side = np.isclose(box.border[:, :2], 0.0) | np.isclose(box.border[:, :2], 20.0)
    assert on_side.any(axis=1).all()
    assert box.inside.mean() == pytest.approx(400 / 1600, abs=0.02)
    assert (box.inside == (box.side > 0)).all()


def test_edges_nobody_scanned_are_not_asked_for():
    part = tessellate(_box_shape())
    scan = simulate_scan(part, SimulateParams(n_points=3000, views=1, spread=0.0))
    cloud = with_truth("Its top alone.", scan, part, part.nearest_face((10.0, 10.0, 10.0)))
    assert len(cloud.edges) == 0


def test_the_scores_of_perfect_and_of_wrong_marks(box):
    perfect = truth.score_edges(box, box.near)
    assert perfect.precision == 1.0
    assert perfect.recall == 1.0
    wrong = truth.score_edges(box, ~box.near)
    assert wrong.precision == 0.0
    assert truth.score_edges(box, np.zeros(len(box), bool)).f1 == 0.0
    assert truth.score_inside(box, box.inside) == truth.InsideScore(1.0, 1.0)
    assert truth.score_inside(box, ~box.inside) == truth.InsideScore(0.0, 0.0)
    line = truth.score_line(box, box.border)
    assert (line.distance, line.stray, line.covered) == (0.0, 0.0, 1.0)
    assert truth.score_line(box, box.border[:0]).covered == 0.0


def test_the_step_lies_between_inside_and_outside(step):
    assert len(step) == 6000
    assert step.near.mean() < 0.5
    assert not step.inside[~step.judged].all()
    upper, lower = step.clean[step.judged & step.inside], step.clean[step.judged & ~step.inside]
    assert np.abs(upper[:, :2]).max() < np.abs(lower[:, :2]).max()
    # The border runs around the inside: about as far from the middle everywhere.
    distance = np.linalg.norm(step.border[:, :2], axis=1)
    assert distance.min() > 20


def test_the_default_beats_the_papers_operators_on_the_step(step):
    runs = ex.at_noise(step)
    assert set(runs) >= {ex.ROBUST, ex.SEQUENCE, ex.BEST, *(ex.edn_name(alpha) for alpha in ex.FIG9_ALPHAS)}
    assert runs[ex.ROBUST].score.f1 > 0.9
    assert runs[ex.ROBUST].score.f1 > max(run.score.f1 for name, run in runs.items() if name != ex.ROBUST) - 1e-9
    assert runs[ex.edn_name(0.4)].no_sector > 0.5
    assert runs[ex.BEST].score.f1 >= runs[ex.edn_name(0.4)].score.f1


def test_the_procedure_from_perfect_marks_finds_the_top(box, tmp_path):
    distance = truth.KDTree(box.border).query(box.clean)[0]
    run = procedure.as_in_the_paper(box, distance < 2 * box.h)
    assert len(run.thinned) == 3
    assert run.lines[0].covered > 0.9
    assert run.inside.iou > 0.6
    assert run.score is not None
    # Nearest borders of the sides are the top's, too: some of them are taken in.
    assert run.score.rms < 2.0
    pictures.procedure_sheet(tmp_path / "sheet.png", box, "perfect", run, {"Default": None})
    with Image.open(tmp_path / "sheet.png") as image:
        assert image.size[0] > image.size[1] > 300


def test_the_page_says_what_the_run_gave(step, tmp_path, monkeypatch):
    """One small scan in the place of all others, and one outline; verdicts and tables must come out of it."""

    class Small:
        def __init__(self, name: str) -> None:
            from examples.parts import PARTS

            self.part = PARTS["shallow_step"]

        def scan(self, **changes: object) -> truth.StandIn:
            return step

    monkeypatch.setattr(gallery, "Model", Small)
    monkeypatch.setattr(gallery, "OUTLINES", ("shallow_step",))
    monkeypatch.setattr(gallery, "by_default", lambda *_: None)
    monkeypatch.setattr(ex, "NOISES", (0.1, 0.25))
    monkeypatch.setattr(pictures, "WIDE", 60)
    monkeypatch.setattr(pictures, "NARROW", 60)
    results = gallery.run(tmp_path / "images", say=lambda line: None)
    page = write_page(results, "images")
    said = statements.judge(results)
    assert len(said) == 12
    assert {item.verdict for item in said} <= {statements.HOLDS, statements.PARTLY, statements.NOT, statements.TOO_SMALL, statements.FASTER}
    for item in said:
        assert item.evidence in page
    for picture in (tmp_path / "images").iterdir():
        assert f"(images/{picture.name})" in page
    assert "nan" not in page.replace("nan ", "")


def test_the_pictures_of_the_docs_are_small():
    sizes = [picture.stat().st_size for picture in (ROOT / "docs" / "images" / "paper").glob("*.png")]
    assert len(sizes) >= 7
    assert max(sizes) < 300_000
    assert sum(sizes) < 3_000_000


def test_lists_of_noises_read_well():
    assert statements.listed([]) == "at no noise"
    assert statements.listed([0.1]) == "at noise 0.1 h"
    assert statements.listed([0.0, 0.1, 0.25]) == "at noise 0, 0.1 and 0.25 h"
    assert statements.verdict(0, 3) == statements.NOT
    assert statements.verdict(3, 3) == statements.HOLDS
