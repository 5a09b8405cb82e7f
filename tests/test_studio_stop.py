"""Stopping: at once for the page, however long the computation takes to end, and even where its process has to be replaced."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the studio is an extra")

import studio_server
from scan2nurbs.studio import workshop as workshop_module
from scan2nurbs.studio.messages import Cancel, Compute, Export
from scan2nurbs.studio.project import EXPORTS, Project, create_project
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
