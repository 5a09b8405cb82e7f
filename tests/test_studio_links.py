"""Links that somebody put into a project: the studio neither reads nor writes behind them."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from scan2nurbs.errors import InputError, OutputError
from scan2nurbs.studio.lock import FILE as LOCK
from scan2nurbs.studio.lock import lock_project
from scan2nurbs.studio.messages import Export
from scan2nurbs.studio.project import EXPORTS, FILE, Project, create_project, open_project
from scan2nurbs.studio.session import Session

EDIT = {"set": {"stage": "edges", "name": "threshold", "value": 15}}


@pytest.fixture
def project(tmp_path) -> Project:
    scan = tmp_path / "scan.ply"
    scan.write_text("0 0 0\n")
    return create_project(scan, tmp_path / "project")


def test_the_project_is_not_written_through_a_link(project, tmp_path):
    outside = tmp_path / "outside.json"
    (project.folder / FILE).rename(outside)
    (project.folder / FILE).symlink_to(outside)
    before = outside.read_bytes()
    with pytest.raises(OutputError, match=r"project\.json is a link"):
        project.with_edit(EDIT).save()
    assert outside.read_bytes() == before
    assert (project.folder / FILE).is_symlink()


def test_the_project_is_not_read_through_a_link(project, tmp_path):
    (project.folder / FILE).rename(tmp_path / "outside.json")
    (project.folder / FILE).symlink_to(tmp_path / "outside.json")
    for read in (lambda: open_project(project.folder), lambda: create_project(project.scan, project.folder)):
        with pytest.raises(InputError, match=r"project\.json is one"):
            read()
    (project.folder / FILE).unlink()
    (tmp_path / "outside.json").rename(project.folder / FILE)
    assert open_project(project.folder) == project


def test_a_project_may_be_reached_through_a_link(project, tmp_path):
    (tmp_path / "link").symlink_to(project.folder)
    create_project(project.scan, tmp_path / "link").with_edit(EDIT).save()
    assert open_project(tmp_path / "link").edits == (EDIT,)
    assert json.loads((project.folder / FILE).read_text())["edits"] == [EDIT]


@pytest.mark.parametrize("place", [EXPORTS, f"{EXPORTS}/scan.step"])
def test_exports_are_not_written_through_a_link(project, tmp_path, place):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "scan.step").write_text("mine")
    link = project.folder / place
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(outside if place == EXPORTS else outside / "scan.step")
    told = exported(project)
    assert [text for text in told if "is a link" in text]
    assert (outside / "scan.step").read_text() == "mine"
    assert [path.name for path in outside.iterdir()] == ["scan.step"]
    link.unlink()
    assert not [text for text in exported(project) if "is a link" in text]
    assert (project.folder / EXPORTS / "scan.step").read_text() == "model"


def exported(project: Project) -> list[str]:
    """Export a STEP file with a computation that writes where it is told; return what the pages are told of troubles."""

    async def export() -> list[str]:
        session = Session(project)
        page = session.join()

        async def request(_hear, **said):
            if said["do"] == "export":
                Path(said["path"]).write_text("model")

        session.workshop.request = request  # type: ignore[method-assign]
        session.do(Export(kind="step"))
        while session._exports:
            await session._export(session._exports.pop(0))
        said = [json.loads(page.queue.get_nowait()) for _ in range(page.queue.qsize())]
        return [message["text"] for message in said if message["type"] == "Trouble"]

    return asyncio.run(export())


def test_a_project_that_cannot_be_saved_while_it_computes_says_so_and_goes_on(project, tmp_path):
    async def reach() -> list[str]:
        session = Session(project)
        page = session.join()
        (project.folder / FILE).rename(tmp_path / "outside.json")
        (project.folder / FILE).symlink_to(tmp_path / "outside.json")
        for step in ("scan", "edges"):
            result = {
                "step": step,
                "key": session._plan.key(step),
                "seconds": 0.0,
                "figures": [],
                "warnings": [],
                "automatic": {},
                "faces": [],
            }
            await session._hear({"say": "result", "result": result})
        said = [json.loads(page.queue.get_nowait()) for _ in range(page.queue.qsize())]
        assert session.state().reached == "edges"
        return [message["text"] for message in said if message["type"] == "Trouble"]

    assert "is a link" in asyncio.run(reach())[0]


def test_the_lock_is_not_written_through_a_link(project, tmp_path):
    outside = tmp_path / "outside.txt"
    outside.write_text("mine")
    (project.folder / LOCK).symlink_to(outside)
    assert lock_project(project.folder) is None
    assert outside.read_text() == "mine"
