"""Projects of the studio: edits that are done again, files that are never half-written, sliders that need no new pass."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import studio_server
from scan2nurbs.cli.main import main
from scan2nurbs.cloud import as_cloud
from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.errors import InputError, NoResultError, ParameterError
from scan2nurbs.faces.segmentation import Faces
from scan2nurbs.part import part_scan
from scan2nurbs.scale import measure_scale
from scan2nurbs.studio.edits import describe_edit, replay, step_of
from scan2nurbs.studio.live import moved
from scan2nurbs.studio.messages import Edit
from scan2nurbs.studio.project import FILE, Project, create_project, open_project
from scan2nurbs.studio.session import Session
from scan2nurbs.studio.stages import Reached, Stages
from scan2nurbs.studio.worker import Worker
from scan2nurbs.surfaces.relations import RelationParams

EDITS = [
    {"set": {"stage": "edges", "name": "threshold", "value": 15}},
    {"boundary": {"add": {"indices": [5, 6]}}},
    {"boundary": {"drop": {"lassos": [{"view": "xy", "polygon": [[0, 0], [8, 0], [4, 6]]}]}}},
    {"face": {"merge": [0, 1]}},
    {"face": {"type": {"face": 0, "kind": "bspline"}}},
    {"face": {"tolerance": {"face": 0, "value": 0.25}}},
    {"face": [{"delete": 2}, {"delete": 3}]},
    {"set": {"stage": "segment", "name": "keep_types", "value": ["plane", "cylinder"]}},
    {"set": {"stage": "relations", "name": "kinds", "value": ["parallel", "tangent"]}},
    {"set": {"stage": "relations", "name": "angle", "value": 1}},
    {"set": {"stage": "relations", "name": "relations", "value": False}},
    {"set": {"stage": "topology", "name": "fill_holes", "value": True}},
    {"set": {"stage": "scan", "name": "unit", "value": "cm"}},
]


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return studio_server.small_part(tmp_path_factory.mktemp("scans") / "step.ply", step=0.5)


def test_edits_amount_to_parameters():
    plan = replay(EDITS)
    assert plan.unit == "cm"
    assert plan.params.edges.threshold == 15.0
    assert [step.action for step in plan.params.boundary] == ["add", "drop"]
    assert plan.params.corrections is not None
    assert [step.action for step in plan.params.corrections.steps] == ["merge", "type", "tolerance", "delete", "delete"]
    assert plan.params.relation_params == RelationParams(kinds=("parallel", "tangent"), angle=1.0)
    assert not plan.params.relations
    assert plan.params.segment.keep_types == ("plane", "cylinder")
    assert plan.params.topology.fill_holes


def test_only_steps_that_follow_from_an_edit_get_another_key():
    plain = replay([])
    for edit in EDITS[:-1]:
        changed = replay([edit])
        order = ["scan", "edges", "faces", "surfaces", "model"]
        first = order.index(step_of(edit))
        for k, step in enumerate(order):
            assert (changed.key(step) == plain.key(step)) == (k < first), (edit, step)


@pytest.mark.parametrize(
    "edit",
    [
        {"set": {"stage": "edges", "name": "threshold", "value": 91}},
        {"set": {"stage": "edges", "name": "threshold", "value": "high"}},
        {"set": {"stage": "edges", "name": "threshold", "value": float("nan")}},
        {"set": {"stage": "edges", "name": "__class__", "value": 1}},
        {"set": {"stage": "os", "name": "system", "value": 1}},
        {"set": {"stage": "scan", "name": "unit", "value": "furlong"}},
        {"set": {"stage": "relations", "name": "relations", "value": 1}},
        {"set": {"stage": "relations", "name": "kinds", "value": ["friendly"]}},
        {"set": {"stage": "relations", "name": "kinds", "value": [[1]]}},
        {"set": {"stage": "relations", "name": "angle", "value": -1}},
        {"set": {"stage": "relations", "name": "max_rise", "value": float("nan")}},
        {"set": {"stage": "segment", "name": "keep_types", "value": [[1]]}},
        {"boundary": {"keep": {"indices": [1]}}},
        {"boundary": {"add": {"indices": [-1]}}},
        {"face": {"explode": 3}},
        {"face": {"merge": [1]}},
        {"face": []},
        {"face": [{"delete": 1}, {"explode": 2}]},
        {"face": [[{"delete": 1}]]},
        {"face": {"tolerance": {"face": 1, "value": 0}}},
        {"face": {"split": {"face": 0, "lassos": [{"view": "xy", "polygon": [[0, 0]]}]}}},
    ],
)
def test_an_edit_that_says_nothing_is_refused_with_a_sentence(edit):
    with pytest.raises((ParameterError, InputError)) as refused:
        replay([edit])
    assert str(refused.value).endswith(".")
    assert "tmp" not in str(refused.value)


def test_every_edit_is_described():
    said = [describe_edit(edit) for edit in EDITS]
    assert said[0] == "Threshold: 15"
    assert said[1] == "Add to the boundary: 2 points"
    assert said[2] == "Take from the boundary: a lasso"
    assert said[3:7] == ["Merge faces 0, 1", "Face 0 is a bspline", "Tolerance of face 0: 0.25", "Delete faces 2, 3"]
    several = [{"type": {"face": face, "kind": "plane"}} for face in (1, 2)]
    assert describe_edit({"face": several}) == "Face 1 is a plane; Face 2 is a plane"
    assert "Kinds: parallel, tangent" in said


def test_parameters_that_make_no_difference_are_known():
    def idle(**edges):
        edits = [{"set": {"stage": "edges", "name": name, "value": value}} for name, value in edges.items()]
        return {name.removeprefix("edges.") for name in replay(edits).idle()}

    paper = {"small_radius", "large_radius", "exact", "alpha", "beta", "sectors"}
    assert idle() == idle(operator="crease") == paper
    assert idle(operator="one-sided") == {*paper, "reach"}
    assert idle(operator="edn") == {"radius", "reach"}
    assert idle(operator="dn") == {"radius", "reach", "alpha", "beta", "sectors"}
    assert idle(operator="vdn") == {"radius", "reach", "alpha", "beta", "small_radius"}
    assert idle(operator="edn", sequence="vdn*2, dn") == {"radius", "reach", "alpha", "beta", "operator", "repeat"}
    without = replay([{"set": {"stage": "relations", "name": "relations", "value": False}}]).idle() - replay([]).idle()
    assert without == {"relations.kinds", "relations.angle", "relations.length", "relations.max_rise"}


@pytest.mark.parametrize("operator", ["one-sided", "dn", "vdn", "edn"])
def test_what_is_idle_changes_no_edge(scan, operator):
    cloud = as_cloud(scan)
    scale = measure_scale(cloud.points)
    plain = EdgeParams(operator=operator)
    changes = {"radius": 9.0, "reach": 2.0, "small_radius": 2.0, "large_radius": 8.0, "alpha": 0.9, "sectors": 8, "exact": True}
    idle = {name: value for name, value in changes.items() if name in plain.idle()}
    assert idle
    before, after = (detect(cloud.points, scale, params) for params in (plain, EdgeParams(operator=operator, **idle)))
    np.testing.assert_array_equal(before.strength, after.strength)
    for name in changes.keys() - idle.keys() - {"exact"}:
        other = detect(cloud.points, scale, EdgeParams(operator=operator, **{name: changes[name]}))
        assert not np.array_equal(before.strength, other.strength, equal_nan=True), name


def test_several_steps_on_faces_are_done_and_undone_as_one():
    several = {"face": [{"delete": 2}, {"delete": 3}]}
    assert replay([several]) == replay([{"face": {"delete": 2}}, {"face": {"delete": 3}}])
    project = Project(Path(), Path("scan.ply"), "").with_edit(EDITS[0]).with_edit(several)
    assert project.moved(-1).done_edits == (EDITS[0],)
    assert project.moved(-1).moved(1) == project


@given(st.lists(st.sampled_from([*EDITS, "undo", "redo"]), max_size=12))
def test_undo_and_redo_are_inverse(actions):
    project = Project(Path(), Path("scan.ply"), "")
    for action in actions:
        before = project
        project = project.moved(-1) if action == "undo" else project.moved(1) if action == "redo" else project.with_edit(action)
        if action not in ("undo", "redo"):
            assert project.moved(-1).done_edits == before.done_edits
            assert project.moved(-1).moved(1) == project
    assert len(project.edits) >= project.done >= 0


def test_a_project_comes_back_as_it_was_saved(scan, tmp_path):
    project = create_project(scan, tmp_path / "p")
    for edit in EDITS:
        project = project.with_edit(edit)
        project.save()
    project = project.moved(-1).moved(-1)
    project.save()
    assert open_project(tmp_path / "p", check=True) == project
    assert create_project(scan, tmp_path / "p") == project
    assert [path.name for path in (tmp_path / "p").iterdir()] == [FILE]


def test_a_project_that_cannot_be_written_stays_as_it_was(scan, tmp_path, monkeypatch):
    project = create_project(scan, tmp_path / "p")
    before = (tmp_path / "p" / FILE).read_bytes()

    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        project.with_edit(EDITS[0]).save()
    assert (tmp_path / "p" / FILE).read_bytes() == before


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{}",
        '{"schema": "scan2nurbs/project/1"}',
        '{"schema": "scan2nurbs/project/1", "scan": {"path": "x", "sha256": ""}, "edits": [1], "done": 1, "reached": "scan"}',
    ],
)
def test_what_is_no_project_is_refused(content, tmp_path):
    (tmp_path / FILE).write_text(content)
    with pytest.raises(InputError) as refused:
        open_project(tmp_path)
    assert str(refused.value).endswith(".")


def test_a_project_knows_its_scan(scan, tmp_path):
    copy = tmp_path / "scan.ply"
    shutil.copy(scan, copy)
    project = create_project(copy)
    assert json.loads((project.folder / FILE).read_text())["scan"]["path"] == "../scan.ply"
    copy.write_bytes(copy.read_bytes()[:-1] + b"x")
    with pytest.raises(InputError, match="not the one"):
        open_project(project.folder, check=True)
    with pytest.raises(InputError, match="changed since this project was made"):
        create_project(copy)
    with pytest.raises(InputError, match="another scan"):
        create_project(studio_server.small_part(tmp_path / "other.ply", step=1.5), project.folder)


def test_a_project_follows_its_scan_to_another_place(scan, tmp_path):
    copy, elsewhere = tmp_path / "scan.ply", tmp_path / "else where" / "moved.ply"
    shutil.copy(scan, copy)
    project = create_project(copy).with_edit(EDITS[0])
    project.save()
    elsewhere.parent.mkdir()
    copy.rename(elsewhere)
    with pytest.raises(InputError, match=r"is gone\. .*scan2nurbs studio SCAN --project .*scan\.ply\.s2n"):
        open_project(project.folder, check=True)
    moved = create_project(elsewhere, project.folder)
    assert (moved.scan, moved.edits) == (elsewhere.resolve(), project.edits)
    assert open_project(project.folder, check=True) == moved


def test_a_scan_that_was_replaced_is_not_taken_for_the_projects(scan, tmp_path):
    copy = tmp_path / "scan.ply"
    shutil.copy(scan, copy)
    project = create_project(copy)
    said: list[dict] = []
    worker = Worker(io.BytesIO())
    worker.say = lambda **content: said.append(content)  # type: ignore[method-assign]
    asked = {"do": "run", "project": str(project.folder), "scan": str(copy), "sha256": project.sha256, "edits": [], "until": "scan"}
    studio_server.small_part(copy, step=1.5)
    for _ in range(2):  # nothing of it is kept
        worker.answer(asked)
        assert "replaced or changed since" in said[-1]["trouble"]
    assert not [content for content in said if content["say"] == "result"]
    shutil.copy(scan, copy)
    worker.answer(asked)
    assert said[-1] == {"say": "done", "trouble": None}


def test_the_command_line_wants_either_a_scan_or_a_project(scan, tmp_path, capsys):
    create_project(scan, tmp_path / "p")
    for arguments in (
        ["convert"],
        ["convert", scan, "--project", tmp_path / "p"],
        ["convert", "--project", tmp_path / "p", "--unit", "cm"],
        ["studio", tmp_path / "p", "--project", tmp_path / "q", "--no-open"],
        ["studio", "--project", tmp_path / "q", "--no-open"],
    ):
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        assert stopped.value.code == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_sliders_give_what_a_new_pass_would(scan):
    cloud = as_cloud(scan)
    scale = measure_scale(cloud.points)
    for operator in ("crease", "edn"):
        before = EdgeParams(operator=operator)
        found = detect(cloud.points, scale, before)
        for change in ({"threshold": 33.0}, {"threshold": 8.0, "alpha": 0.7}):
            after = EdgeParams(operator=operator, **change)
            by_slider, by_pass = moved(found, before, after), detect(cloud.points, scale, after)
            assert by_slider is not None
            np.testing.assert_array_equal(by_slider.mask, by_pass.mask)
            np.testing.assert_array_equal(by_slider.strength, by_pass.strength)
            assert (by_slider.threshold, by_slider.runs) == (by_pass.threshold, by_pass.runs)
    assert moved(found, EdgeParams(operator="edn"), EdgeParams(operator="edn", large_radius=9.0)) is None
    assert moved(found, EdgeParams(operator="edn"), EdgeParams(operator="edn", repeat=2)) is None


def test_only_what_depends_on_a_change_is_computed_again(scan):
    stages = Stages()
    computed: list[str] = []

    def run(edits, until):
        computed.clear()
        steps = []
        plan = replay(edits)
        stages.begin(until, steps.append)

        def counted(stage, given, compute):
            return stages(stage, given, lambda: (computed.append(stage), compute())[1])

        with contextlib.suppress(Reached):
            part_scan(scan, plan.params, run=counted)
        return list(computed)

    assert run([], "edges") == ["read", "scale", "edges"]
    assert run([], "faces") == ["faces"]
    assert run([{"face": {"delete": 0}}], "faces") == ["corrections"]
    assert run([], "faces") == []
    assert run([{"boundary": {"drop": {"boxes": [{"min": [None, None, None], "max": [None, None, None]}]}}}], "edges") == ["boundary"]
    assert not stages.results["boundary"].mask.any()
    assert run([{"set": {"stage": "edges", "name": "threshold", "value": 40}}], "edges") == []
    assert not stages.results["faces"].by_edges  # planes: so they are those of before, whatever is marked, and are shown again
    assert run([{"boundary": {"add": {"indices": [1, 2]}}}, {"face": {"delete": 0}}], "faces") == ["boundary"]
    assert part_edges(stages)


def part_edges(stages: Stages) -> bool:
    """Tell whether faces that were kept go with the edge points of this run."""
    return stages.results["corrections"].edges is stages.results["edges"] is not stages.results["boundary"]


@pytest.mark.parametrize("by_edges", [False, True])
def test_faces_are_found_again_for_other_edge_points_only_where_these_had_a_say(by_edges):
    stages, computed = Stages(), []
    edges = Edges(*[np.zeros(1)] * 6, threshold=1.0, spacing=1.0, h=1.0, noise=0.0, runs=(("crease", 0),))  # type: ignore[arg-type]
    faces = Faces(np.zeros(1, np.int32), (), frozenset(), by_edges=by_edges)
    given = {"read": ("scan", None), "scale": None, "edges": EdgeParams(), "faces": 1, "relations": 2}
    for threshold in (10.0, 20.0, 10.0):
        stages.begin("surfaces", lambda _step: None)
        for stage, of in (given | {"edges": EdgeParams(threshold=threshold)}).items():
            result = faces if stage == "faces" else edges if stage == "edges" else stage
            stages(stage, of, lambda stage=stage, result=result: (computed.append(stage), result)[1])
    again = ["faces", "relations"] * (2 if by_edges else 1)
    assert [stage for stage in computed if stage in again] == again


def test_the_faces_of_planes_are_the_same_whatever_is_marked(scan):
    everywhere = [{"boundary": {"add": {"boxes": [{"min": [None, None, None], "max": [None, None, None]}]}}}]
    plain, marked = part_scan(scan), part_scan(scan, replay(everywhere).params)
    assert marked.edges.mask.all()
    assert not plain.faces.by_edges
    np.testing.assert_array_equal(plain.faces.label, marked.faces.label)
    stages = Stages()
    for edits in ([], everywhere, []):
        stages.begin("faces", lambda _step: None)
        parted = part_scan(scan, replay([*edits, {"face": {"delete": 0}}]).params, run=stages)
        assert parted.edges.mask.all() == bool(edits)  # faces are kept; what is exported has the points that are marked now


def test_steps_after_the_edges_have_a_key_without_their_marks():
    plain, marked = replay([]), replay(EDITS[:3])
    assert marked.key("edges") != plain.key("edges")
    for step in ("faces", "surfaces", "model"):
        assert len({*plain.keys(step), *marked.keys(step)}) == 3
        assert plain.key(step, by_edges=False) == marked.key(step, by_edges=False)
    runs = {"set": {"stage": "edges", "name": "repeat", "value": 2}}  # the second run's normals follow from what the first one marked
    assert replay([runs]).key("faces", by_edges=False) != replay([runs, EDITS[0]]).key("faces", by_edges=False)


@pytest.mark.parametrize(
    ("stage", "name", "value", "said"),
    [
        ("segment", "tolerance", -1, "Tolerance must be more than 0."),
        ("segment", "max_faces", -5, "Max faces must be a whole number, 1 or more."),
        ("segment", "max_faces", 2.5, "Max faces must be a whole number."),
        ("edges", "threshold", 91, "Threshold must be a number from 0 to 90."),
        ("edges", "small_radius", 12, "Small radius must be smaller than the large radius. Got 12 and 10 instead."),
        ("relations", "angle", -1, "Angle of relations must be 0 or more."),
    ],
)
def test_a_bad_number_is_refused_in_the_words_of_the_form(scan, tmp_path, stage, name, value, said):
    session = Session(create_project(scan, tmp_path / "p"))
    with pytest.raises(ParameterError) as refused:
        session.do(Edit(edit={"set": {"stage": stage, "name": name, "value": value}}))
    assert str(refused.value) == said


def test_when_all_faces_are_deleted_it_is_said_what_to_do(scan):
    deleted = part_scan(scan).numbers.tolist()
    with pytest.raises(NoResultError, match="deleted them all"):
        part_scan(scan, replay([{"face": [{"delete": face} for face in deleted]}]).params)
