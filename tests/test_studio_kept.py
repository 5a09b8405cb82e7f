"""Results of the studio that are kept in files: the same to the bit, never half, never from elsewhere, never too many."""

from __future__ import annotations

import dataclasses
import os
import pickle  # noqa: TID251 - to be refused
from pathlib import Path

import numpy as np
import pytest

import studio_server
from scan2nurbs.part import reconstruct
from scan2nurbs.studio import store as store_module
from scan2nurbs.studio.codec import decode, encode
from scan2nurbs.studio.edits import replay
from scan2nurbs.studio.stages import Reached, Stages
from scan2nurbs.studio.store import NAMES, Store
from scan2nurbs.surfaces.bspline import BSplineSurface
from scan2nurbs.surfaces.cone import Cone
from scan2nurbs.surfaces.extrusion import Extrusion
from scan2nurbs.surfaces.profile import PlanarCurve
from scan2nurbs.surfaces.revolution import Revolution
from scan2nurbs.surfaces.spline_shape import SplineShape
from scan2nurbs.surfaces.torus import Torus

STAGES = ["edges", "faces", "corrections", "relations", "topology"]
CORRECTED = [{"face": {"type": {"face": 0, "kind": "bspline"}}}, {"boundary": {"drop": {"indices": [1, 2, 3]}}}]
AXIS = np.array([0.1, 0.2, 0.97])  # no unit vector: whoever makes it one on the way changes it
PROFILE = PlanarCurve(np.array([0.0, 0, 0, 0, 1, 1, 1, 1]), np.arange(8.0).reshape(4, 2) ** 1.1, False)


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return studio_server.small_part(tmp_path_factory.mktemp("scans") / "step.ply", step=0.5)


@pytest.fixture(scope="module")
def results(scan, tmp_path_factory) -> Path:
    """A folder with the results of the corrected part."""
    folder = tmp_path_factory.mktemp("project") / "results"
    computed, _, stages = run(scan, folder)
    assert computed == ["read", "scale", "edges", "boundary", *STAGES[1:], "model"]
    assert not any(stages.notes.values())
    return folder


@pytest.fixture
def own(results, tmp_path) -> Path:
    """A copy of it that a test may spoil."""
    folder = tmp_path / "results"
    folder.mkdir()
    for path in results.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


def run(scan: Path, folder: Path | None, edits=CORRECTED):
    """Compute a model as a studio does that has just been started; return what was computed, the model, and the stages."""
    stages = Stages(None if folder is None else Store(folder))
    computed: list[str] = []
    stages.begin("model", lambda _step: None)

    def counted(stage, given, compute):
        return stages(stage, given, lambda: (computed.append(stage), compute())[1])

    return computed, reconstruct(scan, replay(edits).params, run=counted), stages


def same(one, other) -> bool:
    """Tell whether two values are equal to the bit, down to the arrays in them."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if dataclasses.is_dataclass(one):
        return all(same(getattr(one, field.name), getattr(other, field.name)) for field in dataclasses.fields(one))
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return np.float64(one).tobytes() == np.float64(other).tobytes()
    return bool(one == other)


@pytest.mark.parametrize(
    "value",
    [
        Cone(AXIS, AXIS / 3, 2.0, 0.3),
        Torus(AXIS, AXIS / 3, 4.0, 1.0),
        Extrusion(AXIS, AXIS, PROFILE),
        Revolution(AXIS, AXIS, PROFILE),
        SplineShape(BSplineSurface((1, 1), (np.array([0.0, 0, 1, 1]),) * 2, np.arange(12.0).reshape(2, 2, 3), np.ones((2, 2)))),
        (1, -0.0, float("nan"), float("inf"), True, None, "ä", np.float64(0.1), np.int32(3)),
        {(1, 2): [b"\0\xff"], "x": frozenset({(3, 4), (5, 6)})},
        np.arange(6, dtype=np.uint8).reshape(2, 3)[:, ::2],
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_kept_comes_back_to_the_bit(value):
    arrays: list[np.ndarray] = []
    assert same(decode(encode(value, {}, arrays), {}, arrays), value)


def test_only_known_classes_are_kept_and_made():
    for value in (Path("x"), object(), np.array([object()])):
        with pytest.raises(TypeError):
            encode(value, {}, [])
    for said in ({"Path": {"x": 1}}, {"Cone": {"radius": 1}}, {"__reduce__": {}}):
        with pytest.raises((KeyError, TypeError)):
            decode(said, {}, [])


def test_a_studio_that_starts_again_computes_only_the_solids_and_writes_the_same_file(scan, results, tmp_path):
    computed, again, stages = run(scan, results)
    assert computed == ["read", "scale", "boundary", "model"]
    assert stages.took["faces"] > 0  # when it was computed
    _, plainly, _ = run(scan, None)
    again.write(tmp_path / "again.step")
    plainly.write(tmp_path / "part.step")
    assert (tmp_path / "again.step").read_bytes() == (tmp_path / "part.step").read_bytes()
    assert same(again.faces, plainly.faces)
    assert same(again.topology, plainly.topology)
    assert same(again.edges, plainly.edges)


def test_what_follows_from_something_else_is_computed(scan, own, tmp_path):
    assert run(scan, own, [*CORRECTED, {"set": {"stage": "topology", "name": "reach", "value": 2.4}}])[0][-2:] == ["topology", "model"]
    assert "edges" not in run(scan, own)[0]
    other = studio_server.small_part(tmp_path / "step.ply", step=0.55)
    assert set(STAGES) <= set(run(other, own)[0])


def test_there_are_never_more_files_than_stages(scan, own):
    for reach in (2.3, 2.4, 2.5):
        run(scan, own, [*CORRECTED, {"set": {"stage": "topology", "name": "reach", "value": reach}}])
    assert {path.stem for path in own.iterdir()} <= set(NAMES)


class Harmful:
    """What a pickle could do."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def spoil(path: Path, how: str, mark: Path) -> None:
    content = path.read_bytes()
    if how == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "flipped":
        middle = len(content) // 2
        path.write_bytes(content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :])
    elif how == "foreign":
        path.write_text("{}")
    elif how == "pickle":
        path.write_bytes(pickle.dumps(Harmful(mark)))
    else:
        with np.load(path) as archive:
            members = dict(archive)
        members["0"] = np.array([Harmful(mark)], object)
        np.savez(path, **members)


@pytest.mark.parametrize("how", ["cut", "empty", "flipped", "foreign", "pickle", "objects"])
def test_a_damaged_or_foreign_file_is_told_and_computed_again(scan, own, tmp_path, how):
    spoil(own / "topology.npz", how, tmp_path / "mark")
    computed, _, stages = run(scan, own)
    assert computed[-2:] == ["topology", "model"]
    assert "faces" not in computed
    assert stages.notes["surfaces"] == ["What was kept of this step, results/topology.npz, is damaged; it was computed again."]
    assert not (tmp_path / "mark").exists()
    assert "topology" not in run(scan, own)[0]  # it was mended


def test_results_of_another_version_are_told_and_computed_again(scan, own, monkeypatch):
    monkeypatch.setattr(store_module, "software", lambda: "another")
    computed, _, stages = run(scan, own)
    assert set(STAGES) <= set(computed)
    assert "another version" in stages.notes["faces"][0]


def test_whoever_is_killed_while_writing_leaves_what_was_there(scan, own, monkeypatch):
    before = {path.name: path.read_bytes() for path in own.iterdir()}

    def killed(*_):
        os.close(os.open(own / ".topology-0123456789ab.npz", os.O_CREAT | os.O_WRONLY))  # half a file, under another name
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        run(scan, own, [*CORRECTED, {"set": {"stage": "topology", "name": "reach", "value": 2.4}}])
    monkeypatch.undo()
    assert len(list(own.iterdir())) == len(before) + 1
    assert "topology" not in run(scan, own)[0]
    assert {path.name: path.read_bytes() for path in own.iterdir()} == before


def test_what_cannot_be_kept_is_told_and_computed_all_the_same(scan, tmp_path):
    (tmp_path / "results").write_text("no folder")
    computed, model, stages = run(scan, tmp_path / "results")
    assert computed[-1] == "model"
    assert model.part.valid
    assert stages.notes["faces"][0].startswith("What was computed cannot be kept for the next start: ")


def test_links_out_of_the_project_are_not_followed(scan, own, tmp_path):
    outside = tmp_path / "outside.npz"
    (own / "faces.npz").rename(outside)
    (own / "faces.npz").symlink_to(outside)
    content = outside.read_bytes()
    computed, _, stages = run(scan, own, [{"set": {"stage": "segment", "name": "max_faces", "value": 60}}])
    assert "faces" in computed
    assert outside.read_bytes() == content
    assert "a link that leads elsewhere" in stages.notes["faces"][0]


def test_what_is_seen_of_the_model_needs_no_model(scan, tmp_path):
    made: list[str] = []

    def see(folder: Path) -> None:
        stages = Stages(Store(folder))
        made.clear()

        def show(step):
            stages.scene(step, "key", lambda: (made.append(step), (step, [b"frame"]))[1])

        def seen(step):
            found = stages.has_scene(step, "key")
            if found:
                show(step)
            return found

        stages.begin("model", lambda _step: None, seen)
        try:
            reconstruct(scan, run=stages)
            show("model")
        except Reached:
            made.append("reached")

    see(tmp_path / "results")
    assert made == ["model"]
    see(tmp_path / "results")
    assert made == ["reached"]
