"""A project in the studio: computing, undoing, stopping, being killed, two pages at once, the same file from the command line."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the studio is an extra")
pytest.importorskip("uvicorn", reason="the studio is an extra")
pytest.importorskip("websockets", reason="the studio is an extra")

import studio_server
from scan2nurbs.cli.main import main
from scan2nurbs.studio.frames import unpack
from studio_server import Studio, hear, is_current, say
from studio_taken import read_back, taken_away

READ_ANEW = {"reading the scan", "measuring"}


@pytest.fixture
def scan(tmp_path) -> Path:
    return studio_server.small_part(tmp_path / "step.ply", step=0.4)


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """A studio that nobody asked for anything but the scan, or what another test did."""
    running = Studio(studio_server.small_part(tmp_path_factory.mktemp("running") / "step.ply", step=0.5))
    yield running
    running.stop()


def figures(state: dict, step: str) -> dict[str, str]:
    return {figure["label"]: figure["value"] for figure in result(state, step)["figures"]}


def result(state: dict, step: str) -> dict:
    return next(entry for entry in state["steps"] if entry["step"] == step)["result"]


def edit(page, **content) -> None:
    say(page, "Edit", edit=content)


def test_corrections_survive_a_kill_and_give_the_file_of_the_command_line(scan, capfd):
    studio = Studio(scan)
    with studio.page() as page, studio.page() as other:
        say(page, "Compute", until="faces")
        state = hear(page, "State", is_current("faces"))
        n_faces = int(figures(state, "faces")["Faces"])
        split_and_undo(page, other, n_faces)
        say(page, "Redo")
        hear(page, "State", lambda state: not state["can_redo"] and is_current("faces")(state))
        edit(page, boundary={"drop": {"indices": [1, 2, 3]}})
        edit(page, face={"tolerance": {"face": 0, "value": 0.5}})
        edit(page, set={"stage": "relations", "name": "kinds", "value": ["parallel"]})
        state = hear(page, "State", lambda state: len(state["edits"]) == 4)
        assert state["values"]["relations.kinds"] == ["parallel"]
        assert state["values"]["relations.relations"] is True
        say(page, "Compute", until="model")
        before = hear(page, "State", lambda state: is_current("faces")(state) and state["running"] == "model")
        studio.kill()  # in the middle of a computation

    studio = Studio(scan)
    try:
        with studio.page() as page:
            state, stages = watched(page, "faces")
            assert [entry["done"] for entry in state["edits"]] == [True] * 4
            assert stages <= {*READ_ANEW, "relating surfaces", "finding borders"}  # the last two it may not have reached
            assert result(state, "faces") == result(before, "faces")
            assert state["reached"] in ("faces", "surfaces", "model")
            say(page, "Export", kind="step")
            state = hear(page, "State", lambda state: bool(state["files"]) and state["running"] is None)
            assert (state["files"][0]["name"], state["files"][0]["current"]) == ("step.step", True)
            assert figures(state, "model")["Check"] == "valid"
            tolerances = {face["number"]: face["tolerance"] for face in result(state, "model")["faces"]}
            assert tolerances == dict.fromkeys(range(len(tolerances))) | {0: 0.5}
            status, _, exported = studio.ask("GET", "/files/step.step", Cookie=studio.cookie())
            assert status == 200
            taken = taken_away(studio, page, scan.parent / "taken")
            assert tolerances.keys() == read_back(taken, scan, exported)
            report = taken["report"].read_text()
            assert "Done by hand" in report
            assert "Take from the boundary: 3 points" in report
    finally:
        studio.stop()
    again = scan.parent / "again" / "step.step"
    again.parent.mkdir()
    with pytest.raises(SystemExit) as ended:
        main(["convert", "--project", f"{scan}.s2n", "-o", str(again), "--quiet", "--json"])
    assert not ended.value.code
    assert again.read_bytes() == exported
    record = json.loads(capfd.readouterr().out)
    assert {relation["kind"] for relation in record["relations"]} == {"parallel"}
    assert record["parameters"]["relations"]["kinds"] == ["parallel"]


def split_and_undo(page, other, n_faces: int) -> None:
    """Split a face on one page, and undo it on another."""
    edit(page, face={"split": {"face": 0, "boxes": [{"min": [None, None, None], "max": [56, None, None]}]}})
    split = hear(page, "State", lambda state: len(state["edits"]) == 1 and is_current("faces")(state))
    assert int(figures(split, "faces")["Faces"]) == n_faces + 1
    seen = hear(other, "State", lambda state: len(state["edits"]) == 1 and is_current("faces")(state))
    assert seen["edits"] == split["edits"]
    say(other, "Undo")
    undone = hear(page, "State", lambda state: state["can_redo"] and is_current("faces")(state))
    assert int(figures(undone, "faces")["Faces"]) == n_faces


def test_a_studio_that_starts_again_shows_what_was_computed(scan):
    studio = Studio(scan)
    with studio.page() as page:
        edit(page, face={"type": {"face": 0, "kind": "cylinder"}})
        say(page, "Undo")
        say(page, "Compute", until="model")
        before = hear(page, "State", lambda state: is_current("model")(state) and state["running"] is None)
        studio.kill()
    studio = Studio(scan)
    try:
        with studio.page() as page:
            after, stages = watched(page, "model")
            assert stages <= READ_ANEW  # all else was kept
            assert after["steps"][:5] == [{**entry, "result": kept(entry, after)} for entry in before["steps"][:5]]
            edit(page, set={"stage": "topology", "name": "reach", "value": 2.6})
            changed = hear(page, "State", is_current("surfaces"))
            assert not is_current("model")(changed)
            studio.kill()
        studio = Studio(scan)
        with studio.page() as page:
            again, stages = watched(page, "surfaces")
            assert stages <= READ_ANEW
            assert result(again, "surfaces") == result(changed, "surfaces")
            assert result(again, "model") is None  # it does not follow from these borders, and nobody asked for another
            assert again["steps"][4]["status"] == "outdated"
            edit(page, set={"stage": "edges", "name": "threshold", "value": 17})
            marked = hear(page, "State", lambda state: state["running"] is None and len(state["edits"]) == 2)
            assert [entry["status"] for entry in marked["steps"][:4]] == ["current"] * 4
            say(page, "Undo")
            say(page, "Undo")  # of the model what is seen was kept
            undone = hear(page, "State", is_current("model"))
            assert result(undone, "model") == result(before, "model")
    finally:
        studio.stop()


def kept(entry: dict, after: dict) -> dict:
    """Return a step's result before; the scan was read anew, which took another time."""
    again = entry["step"] == "scan"
    return {**entry["result"], "seconds": result(after, "scan")["seconds"]} if again else entry["result"]


def watched(page, step: str) -> tuple[dict, set[str]]:
    """Wait until a step is done and nothing runs; return the state, and the names of the stages that were computed on the way."""
    stages = set()
    while True:
        message = page.recv(timeout=60)
        content = {"type": ""} if isinstance(message, bytes) else json.loads(message)
        if content["type"] == "Progress":
            stages.add(content["stage"])
        if content["type"] == "State" and is_current(step)(content) and content["running"] is None:
            return content, stages


def test_a_scan_that_cannot_be_read_makes_room_for_another(scan, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    studio = Studio(cwd=home)
    try:
        cookie = studio.cookie()
        said = {"Cookie": cookie, "Origin": studio.origin}
        with studio.page(cookie) as page:
            assert hear(page, "State")["opens"]
            assert studio.ask("POST", "/scan?name=bad.ply", b"no scan\n" * 30, **said)[0] == 200
            state = hear(page, "State", lambda state: state["steps"][0]["status"] == "failed")
            assert state["opens"]
            assert state["steps"][0]["trouble"].startswith("bad.ply: ")  # no path hides what is wrong
            assert studio.ask("POST", "/scan?name=step.ply", scan.read_bytes(), **said)[0] == 200
            state = hear(page, "State", is_current("scan"))
            assert not state["opens"]
            assert [path.name for path in home.iterdir()] == ["step.ply.s2n"]
            assert studio.ask("POST", "/scan?name=more.ply", b"ply", **said)[0] == 409
            say(page, "Compute", until="edges")
            hear(page, "State", is_current("edges"))
            assert (home / "step.ply.s2n" / "results" / "edges.npz").exists()  # not in the folder of the one before
    finally:
        studio.stop()


def test_a_scan_that_was_sent_in_part_leaves_nothing(tmp_path, monkeypatch):
    from scan2nurbs.studio import server
    from scan2nurbs.studio.guard import Access
    from scan2nurbs.studio.session import Session

    testing = pytest.importorskip("starlette.testclient", reason="the test client needs httpx")
    monkeypatch.setattr(server, "LARGEST_SCAN", 10)
    access = Access({"127.0.0.1"}, 1)
    client = testing.TestClient(server.make_app(Session(), access, tmp_path), base_url="http://127.0.0.1:1")
    cookie = access.exchange(access.token)
    assert cookie is not None
    client.headers.update({"Origin": "http://127.0.0.1:1", "Cookie": cookie.split(";")[0]})
    for _ in range(2):
        answer = client.post("/scan?name=big.ply", content=b"x" * 11)
        assert (answer.status_code, "larger" in answer.text) == (400, True)
        assert not list(tmp_path.iterdir())


def test_arrays_say_what_the_messages_say(running):
    with running.page() as page:
        say(page, "Compute", until="edges")
        frames = {}
        while "edges" not in frames:
            message = page.recv(timeout=60)
            if isinstance(message, bytes):
                header, arrays = unpack(message)
                frames[header["name"]] = arrays
        state = hear(page, "State", is_current("edges"))
        n = len(frames["cloud"]["points"])
        assert figures(state, "scan")["Points"] == f"{n:,}"
        assert frames["cloud"]["rows"].tolist() == list(range(1, n + 1))  # the first row of the file is no point
        above = int((frames["edges"]["strength"] > 12).sum())
        assert figures(state, "edges")["Edge points"] == f"{above:,} of {n:,}"
        edit(page, boundary={"add": {"indices": [1, 2]}})
        while True:
            message = page.recv(timeout=60)
            if isinstance(message, bytes):
                break
        assert unpack(message)[1]["corrected"][:2].max() <= 1


def test_a_computation_can_be_stopped_and_troubles_are_sentences(running):
    with running.page() as page:
        hear(page, "State", is_current("scan"))
        say(page, "Compute", until="model")
        hear(page, "Progress", lambda progress: progress["step"] in ("edges", "faces"))
        start = time.monotonic()
        say(page, "Cancel")
        state = hear(page, "State", lambda state: state["running"] is None)
        assert time.monotonic() - start < 5
        assert not is_current("model")(state)
        say(page, "Compute", until="faces")
        hear(page, "State", is_current("faces"))
        edit(page, face={"merge": [0, 777]})
        state = hear(page, "State", lambda state: any(entry["trouble"] for entry in state["steps"]))
        trouble = next(entry for entry in state["steps"] if entry["trouble"])
        assert trouble["step"] == "faces"
        assert "no face 777" in trouble["trouble"]
        say(page, "Undo")
        hear(page, "State", is_current("faces"))
