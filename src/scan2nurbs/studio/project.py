"""A project: a folder that holds which scan it is about and what was done to it.

``project.json`` is the whole of it; it is replaced as one on every change, so that it is never half-written::

    {
      "schema": "scan2nurbs/project/1",
      "scan": {"path": "../part.ply", "sha256": "…"},
      "edits": […],          in their order, see `edits`
      "done": 3,             so many of them are done, the others were undone
      "reached": "model",    the last step up to which everything is computed
      "farthest": "model",   the last step that was ever computed
      "exports": {…},        files that were written, each with what it follows from
      "parameters": {…}      what the edits amount to, for reading; it is not read back
    }

Exported files lie in ``exports``.
"""

from __future__ import annotations

import hashlib
import json
import os
import shlex
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from scan2nurbs.errors import InputError, OutputError, ParameterError
from scan2nurbs.io.atomic import atomic_path
from scan2nurbs.report.record import to_json
from scan2nurbs.studio.edits import STAGES, Json, Plan, replay
from scan2nurbs.studio.inside import is_linked, refusal
from scan2nurbs.studio.messages import STEPS, Step

SCHEMA = "scan2nurbs/project/1"
FILE = "project.json"
EXPORTS = "exports"
SUFFIX = ".s2n"


@dataclass(frozen=True)
class Project:
    """A project as it stands in its folder.

    Attributes
    ----------
    folder : Path
    scan : Path
        The scan's file.
    sha256 : str
        Of the scan's bytes.
    edits : tuple of dict
        Everything that was done, in its order, what was undone included.
    done : int
        So many edits are done.
    reached : str
        The last step up to which everything is computed.
    farthest : str
        The last step that was ever computed, if not of what is done now.
    exports : dict of str to str
        For each exported file the key of the model in it.
    """

    folder: Path
    scan: Path
    sha256: str
    edits: tuple[Json, ...] = ()
    done: int = 0
    reached: Step = "scan"
    exports: dict[str, str] = field(default_factory=dict)
    farthest: Step = "scan"

    @property
    def done_edits(self) -> tuple[Json, ...]:
        """The edits that are done."""
        return self.edits[: self.done]

    @property
    def plan(self) -> Plan:
        """What the edits that are done amount to."""
        return replay(self.done_edits)

    def with_edit(self, edit: Json) -> Project:
        """Return the project after one more edit; what was undone is forgotten."""
        edits = (*self.edits[: self.done], edit)
        return replace(self, edits=edits, done=len(edits))

    def moved(self, by: int) -> Project:
        """Return the project after undoing (−1) or redoing (+1) one edit, as far as there is one."""
        return replace(self, done=min(max(self.done + by, 0), len(self.edits)))

    def save(self) -> None:
        """Write ``project.json``, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written, or a link stands in its place.
        """
        path, plan = self.folder / FILE, self.plan
        if is_linked(path):
            raise OutputError(refusal(path, self.folder), path=self.folder)
        content = {
            "schema": SCHEMA,
            "scan": {"path": _relative(self.scan, self.folder), "sha256": self.sha256},
            "edits": self.edits,
            "done": self.done,
            "reached": self.reached,
            "farthest": self.farthest,
            "exports": self.exports,
            "parameters": _parameters(plan),
        }
        with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as stream:
            stream.write(to_json(content))
            stream.flush()
            os.fsync(stream.fileno())


def create_project(scan: Path, folder: Path | None = None) -> Project:
    """Make a project for a scan, beside it unless a folder is given; one that is there already is opened.

    Raises
    ------
    InputError
        If the scan cannot be read, or the folder holds a project of another scan. Of the same scan in another place, the project has
        that place from then on.
    OutputError
        If the folder cannot be made.
    """
    folder = folder or scan.with_name(scan.name + SUFFIX)
    if (folder / FILE).exists():
        return _with_scan(open_project(folder), scan)
    sha256 = file_hash(scan)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"The project's folder cannot be made: {error.strerror}. Name another with --project.", path=folder) from error
    project = Project(folder.resolve(), scan.resolve(), sha256)
    project.save()
    return project


def _with_scan(project: Project, scan: Path) -> Project:
    """Return a project with its scan where it lies now."""
    there = project.scan.exists() and scan.exists() and project.scan.samefile(scan)
    if project.sha256 != file_hash(scan):
        raise InputError(
            "The scan was changed since this project was made: its bytes differ. Put the file back as it was, or name another folder for "
            "the new one with --project."
            if there
            else f"This project is about another scan, {project.scan}; name another folder with --project.",
            path=project.folder,
        )
    if there:
        return project
    moved = replace(project, scan=scan.resolve())
    moved.save()
    return moved


def open_project(folder: Path, *, check: bool = False) -> Project:
    """Read a project.

    Parameters
    ----------
    folder : Path
    check : bool
        Whether the scan is compared with its hash.

    Raises
    ------
    InputError
        If there is none, it cannot be read or is a link, or (where checked) its scan is missing or has changed.
    """
    path = folder / FILE
    if path.is_symlink():
        raise InputError(f"Nothing is read through links: {FILE} is one; put a file in its place.", path=folder)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"There is no project in this folder: {error.strerror}.", path=folder) from error
    except (ValueError, RecursionError) as error:
        raise InputError("The project is no valid JSON.", path=path) from error
    project = _parsed(content, folder.resolve(), path)
    if check and not project.scan.exists():
        said = f"scan2nurbs studio SCAN --project {shlex.quote(str(folder))}"
        raise InputError(f"The scan of this project, {project.scan}, is gone. If it was moved, say once where it is: {said}", path=folder)
    if check and file_hash(project.scan) != project.sha256:
        raise InputError(f"The scan {project.scan} is not the one that this project was made for: its bytes differ.", path=path)
    return project


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"The scan cannot be read: {error.strerror}.", path=path) from error


def _parsed(content: Any, folder: Path, path: Path) -> Project:
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"This is no project of this version; its schema must be {SCHEMA!r}.", path=path)
    scan, edits, done, reached = (content.get(key) for key in ("scan", "edits", "done", "reached"))
    good = isinstance(scan, dict) and isinstance(scan.get("path"), str) and isinstance(scan.get("sha256"), str)
    if not good or not isinstance(edits, list) or not isinstance(done, int) or not 0 <= done <= len(edits) or reached not in STEPS:
        raise InputError("The project does not say which scan it is about, and what was done to it.", path=path)
    try:
        replay(edits)
    except (ParameterError, InputError) as error:
        raise InputError(f"An edit of the project cannot be done: {error}", path=path) from error
    assert isinstance(scan, dict)
    place = folder / scan["path"]
    exports = content.get("exports")
    exports = {str(name): str(key) for name, key in exports.items()} if isinstance(exports, dict) else {}
    farthest = content.get("farthest")
    farthest = farthest if farthest in STEPS else reached
    return Project(folder, Path(os.path.normpath(place)), scan["sha256"], tuple(edits), done, reached, exports, farthest)


def _parameters(plan: Plan) -> dict[str, Any]:
    stages = {stage: plan.of(stage) for stage, (params, _) in STAGES.items() if params is not None}
    return {"unit": plan.unit, "part": {"relations": plan.params.relations}, **stages}


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive
        return str(path)
