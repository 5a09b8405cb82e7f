"""Stopping: at once for the page, however long the computation takes to end, and even where its process has to be replaced."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the studio is an extra")

import studio_server
from scan2nurbs.errors import ParameterError
from scan2nurbs.studio import workshop as workshop_module
from scan2nurbs.studio.messages import Cancel, Compute, Edit, Export, Undo
from scan2nurbs.studio.project import EXPORTS, FILE, Project, create_project, open_project
from scan2nurbs.studio.session import Page, Session


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return studio_server.small_part(tmp_path_factory.mktemp("scans") / "step.ply", step=0.8)


@pytest.fixture
def project(scan, tmp_path) -> Project:
    return create_project(scan, tmp_path / "project")


async def told(page: Page, name: str, when: Callable[[dict], bool] = lambda _message: True) -> dict:
    """Wait for a message to a page."""
    while True:
        content = await asyncio.wait_for(page.queue.get(), 120)
        if isinstance(content, str) and (message := json.loads(content))["type"] == name and when(message):
            return message


def is_current(step: str) -> Callable[[dict], bool]:
    return lambda state: next(entry for entry in state["steps"] if entry["step"] == step)["status"] == "current"


def test_pages_are_told_at_once_and_what_is_asked_for_next_waits_its_turn(project):
    async def stop() -> None:
        session = Session(project)
        asked: list[dict] = []
        may_end = asyncio.Event()

        async def request(hear, **said):
            asked.append(said)
            await hear({"say": "progress", "step": "edges", "stage": "drawing curves", "done": 0, "total": 0})
            await may_end.wait()
            await hear({"say": "progress", "step": "edges", "stage": "still at it", "done": 0, "total": 0})

        async def nothing() -> None: ...

        session.workshop.request, session.workshop.start = request, nothing  # type: ignore[method-assign]
        page = session.join()
        working = asyncio.create_task(session.work())
        await told(page, "Progress")
        session.do(Cancel())
        assert session.state().running is None
        assert {entry.status for entry in session.state().steps} == {"empty"}
        session.do(Compute(until="faces"))
        assert session.state().running == "faces"  # the page need not ask twice
        session.do(Cancel())
        session.do(Compute(until="edges"))
        assert session.state().running == "edges"
        assert len(asked) == 1  # the first one has not ended
        may_end.set()
        progress = await told(page, "Progress")
        assert (progress["stage"], [said["until"] for said in asked]) == ("drawing curves", ["scan", "edges"])
        await told(page, "State", lambda state: state["running"] is None)
        working.cancel()

    asyncio.run(stop())


def test_a_process_that_does_not_look_up_is_replaced_and_goes_on(project, monkeypatch):
    """Whatever it is at: the next one goes on from what was kept."""
    monkeypatch.setattr(workshop_module, "GRACE", 0.0)
    project = project.with_edit({"face": {"type": {"face": 0, "kind": "bspline"}}})

    async def stop() -> None:
        session = Session(project)
        page = session.join()
        working = asyncio.create_task(session.work())
        await told(page, "State", is_current("scan"))
        processes = []
        session.do(Compute(until="faces"))
        for stage in ("drawing curves", "finding faces", "correcting faces"):
            await told(page, "Progress", lambda progress, stage=stage: progress["stage"] == stage)
            processes.append(session.workshop._process)
            session.do(Cancel())
            state = session.state()
            assert state.running is None
            assert not [entry.trouble for entry in state.steps if entry.trouble]
            session.do(Compute(until="faces"))
            assert session.state().running == "faces"
        await told(page, "State", is_current("faces"))
        await told(page, "State", lambda state: state["running"] is None)
        assert len({id(process) for process in [*processes, session.workshop._process]}) == 4
        assert not [entry.trouble for entry in session.state().steps if entry.trouble]
        working.cancel()
        await asyncio.wait({working})

    asyncio.run(stop())


def test_an_export_that_was_stopped_leaves_the_older_file_for_an_older_one(project):
    (project.folder / EXPORTS).mkdir()
    (project.folder / EXPORTS / "step.step").write_text("older")

    async def stop() -> None:
        session = Session(project)

        async def request(_hear, **_said):
            session.do(Cancel())

        session.workshop.request = request  # type: ignore[method-assign]
        session.do(Export(kind="step"))
        await session._export(session._exports.pop(0))
        assert session.state().files == []

    asyncio.run(stop())


EDIT = {"set": {"stage": "model", "name": "widest", "value": 4.0}}


def result(step: str, key: str) -> dict:
    return {"step": step, "key": key, "seconds": 0.0, "figures": [], "warnings": [], "automatic": {}, "faces": []}


def test_what_is_changed_while_a_file_is_written_is_in_the_file(project):
    """An edit ends the export; the file is written of what is done then."""

    async def export() -> None:
        session = Session(project)
        asked: list[tuple[str, int]] = []

        async def request(_hear, **said):
            asked.append((said["do"], len(said["edits"])))
            if asked == [("export", 0)]:
                session.do(Edit(edit=EDIT))
                session.do(Undo())
                session.do(Edit(edit=EDIT))
            elif said["do"] == "export":
                Path(said["path"]).write_text("model")

        session.workshop.request = request  # type: ignore[method-assign]
        session._until = None
        session.do(Export(kind="step"))
        await session._export(session._exports.pop(0))
        assert session._exports == ["step"]
        assert session.state().files == []
        session.workshop._cancelled.clear()  # as a request does
        await session._export(session._exports.pop(0))
        assert [(file.name, file.current) for file in session.state().files] == [("step.step", True)]
        assert asked == [("export", 0), ("export", 1)]
        assert session._exports == []
        assert session.state().steps[-1].status == "current"
        session.do(Undo())
        assert session.state().steps[-1].status == "outdated"

    asyncio.run(export())


def test_a_project_that_cannot_be_written_to_can_be_looked_at(project):
    async def look() -> None:
        session = Session(project, look_only=True)
        page = session.join()
        before = (project.folder / FILE).read_bytes()
        for message in (Edit(edit=EDIT), Export(kind="step")):
            with pytest.raises(ParameterError, match="only be looked at") as refused:
                session.do(message)
            assert str(refused.value) == session.state().notice
            assert str(project.folder) not in str(refused.value)
        await session._hear({"say": "result", "result": result("scan", session._plan.key("scan"))})
        await session._hear({"say": "result", "result": result("edges", session._plan.key("edges"))})
        assert session.state().reached == "edges"
        assert (project.folder / FILE).read_bytes() == before
        said = [json.loads(page.queue.get_nowait())["type"] for _ in range(page.queue.qsize())]
        assert "Trouble" not in said

    asyncio.run(look())


def test_what_was_done_before_a_start_has_to_be_done_again(project):
    async def start() -> None:
        session = Session(project)
        for step in ("scan", "edges", "faces"):
            await session._hear({"say": "result", "result": result(step, session._plan.key(step))})
        session.do(Edit(edit={"set": {"stage": "edges", "name": "reach", "value": 0.7}}))
        assert session.state().reached == "edges"
        again = Session(open_project(project.folder))
        assert [entry.status for entry in again.state().steps][2:5] == ["outdated", "empty", "empty"]

    asyncio.run(start())
