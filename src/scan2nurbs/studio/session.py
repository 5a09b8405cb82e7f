"""An open project and the pages that look at it: edits come in, computations run, everybody is told."""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass, field, replace
from importlib import metadata
from typing import Any

from scan2nurbs.errors import OutputError, ParameterError
from scan2nurbs.studio.edits import Plan, describe_edit, replay, step_of
from scan2nurbs.studio.forms import form_fields, in_words
from scan2nurbs.studio.frames import name_of
from scan2nurbs.studio.inside import is_linked, refusal
from scan2nurbs.studio.messages import (
    STEPS,
    Cancel,
    Compute,
    Edit,
    EditEntry,
    Export,
    FileEntry,
    FromPage,
    Progress,
    Redo,
    State,
    Status,
    Step,
    StepState,
    Trouble,
    Undo,
    Welcome,
)
from scan2nurbs.studio.project import EXPORTS, Project
from scan2nurbs.studio.store import software
from scan2nurbs.studio.takeaway import export_kinds, export_name
from scan2nurbs.studio.wire import to_text
from scan2nurbs.studio.workshop import Answer, Workshop
from scan2nurbs.surfaces.shape import KINDS

Outgoing = str | bytes
COMPUTED: tuple[Step, ...] = STEPS[:-1]
LOOK_ONLY = (
    "This project can only be looked at: its folder cannot be written to. To change it, copy the folder to where you may write, and "
    "start the studio with the copy: scan2nurbs studio SCAN --project COPY."
)
_WITH_EDGES = ("points", "report")
"""Exports that tell of each point whether it is marked as lying on an edge."""


@dataclass(eq=False)
class Page:
    """A page that looks at the project: what is to be sent to it."""

    queue: asyncio.Queue[Outgoing] = field(default_factory=asyncio.Queue)


class Session:
    """What the server holds while it runs.

    Parameters
    ----------
    project : Project, optional
        None where no scan is open yet.
    look_only : bool
        Whether the project's folder cannot be written to: nothing is changed, then.
    """

    def __init__(self, project: Project | None = None, *, look_only: bool = False) -> None:
        self.project = project
        self.look_only = look_only
        self.workshop = Workshop()
        self.pages: set[Page] = set()
        self.running: Step | None = None
        self._fields = form_fields()
        self._revision = 0
        self._frames: dict[str, bytes] = {}
        self._results: dict[str, dict[str, Any]] = {}
        self._troubles: dict[Step, tuple[str, str]] = {}
        self._until: Step | None = None
        self._stopped = False
        self._exports: list[str] = []
        self._writing: str | None = None
        self._wake = asyncio.Event()
        self._plan = _plan_of(project)
        if project is not None:
            self.compute(project.reached)

    # ---- pages

    def join(self) -> Page:
        """Let a page look: it is told everything that there is."""
        page = Page()
        self.pages.add(page)
        version = metadata.version("scan2nurbs")
        page.queue.put_nowait(to_text(Welcome(version=version, fields=self._fields, kinds=list(KINDS), exports=export_kinds())))
        page.queue.put_nowait(to_text(self.state()))
        for frame in self._frames.values():
            page.queue.put_nowait(frame)
        return page

    def leave(self, page: Page) -> None:
        """Let a page go."""
        self.pages.discard(page)

    def tell(self, message: Any) -> None:
        """Tell all pages something."""
        content = message if isinstance(message, bytes) else to_text(message)
        for page in self.pages:
            page.queue.put_nowait(content)

    # ---- what pages ask for

    def do(self, message: FromPage) -> None:
        """Do what a page asks for.

        Raises
        ------
        Scan2NurbsError
            If it cannot be done; nothing has changed then.
        """
        if self.project is None:
            return
        if self.look_only and isinstance(message, Edit | Undo | Redo | Export):
            raise ParameterError(LOOK_ONLY)
        if isinstance(message, Edit):
            try:
                self._edit(self.project.with_edit(message.edit), step_of(message.edit))
            except ParameterError as error:
                raise ParameterError(in_words(str(error), self._fields, message.edit)) from error
        elif isinstance(message, Undo) and self.project.done > 0:
            self._edit(self.project.moved(-1), step_of(self.project.edits[self.project.done - 1]))
        elif isinstance(message, Redo) and self.project.done < len(self.project.edits):
            self._edit(self.project.moved(1), step_of(self.project.edits[self.project.done]))
        elif isinstance(message, Compute):
            self.compute("model" if message.until == "export" else message.until)
        elif isinstance(message, Cancel):
            self._stop()
        elif isinstance(message, Export):
            export_name(message.kind, self.project.scan)
            self._exports.append(message.kind)
            if self.running is None:
                self.running = "export"
            self._wake.set()
            self._changed()

    @property
    def opens(self) -> bool:
        """Whether a project may be opened: where there is none, or its scan cannot be read, so that nothing can be done with it."""
        return self.project is None or ("scan" in self._troubles and not self._results)

    def open(self, project: Project) -> None:
        """Open a project where `opens` says that it may be."""
        self.project, self._plan, self.look_only = project, project.plan, False  # it was just made
        self._troubles.clear()
        self.compute(project.reached)

    def compute(self, until: Step) -> None:
        """Compute everything up to a step that is not up to date."""
        self._until = until if self._until is None else _later(self._until, until)
        if self.running is None:
            self.running = self._until  # what was stopped may still have to end; this one is waited for
        self._wake.set()
        self._changed()

    def _stop(self) -> None:
        """Stop computing: for the pages at once, though the computation may need a while to end, or be ended."""
        self._until, self._exports = None, []
        if self.running is not None:
            self.running, self._stopped = None, True
            self.workshop.cancel()
            self._changed()

    def _edit(self, project: Project, step: Step) -> None:
        plan = project.plan  # raises where the edit says nothing that can be done
        # What is computed at once, and what the edit brings back; a studio that starts again computes no more than this one did.
        reached = self._current_until(plan) if step not in self._results else _later(step, self._current_until(plan))
        project = replace(project, reached=reached, farthest=_later(project.farthest, self._current_until(self._plan)))
        project.save()
        self.project, self._plan = project, plan
        if self.running is not None:
            running: Step = "model" if self.running == "export" else self.running
            self._until = running if self._until is None else _later(self._until, running)
            if self._writing is not None:  # what was to be written is written of what is done now
                self._exports.insert(0, self._writing)
                self._writing = None
            self.workshop.cancel()
        if step in self._results or self._until is not None:
            self.compute(step)
        self._changed()

    # ---- computing

    async def work(self) -> None:
        """Run what is asked for, one thing after the other, for as long as the server runs."""
        try:
            await self.workshop.start()  # it takes seconds, in which a scan is being chosen
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._until is not None or self._exports:
                    if self._until is not None:
                        until, self._until = self._until, None
                        await self._run(until)
                    else:
                        await self._export(self._exports.pop(0))
        finally:
            await self.workshop.close()

    async def _run(self, until: Step) -> None:
        project, plan = self._opened(), self._plan
        if all(self._is_current(step, plan) for step in COMPUTED[: COMPUTED.index(until) + 1]):
            self._ended()
            return
        self.running = until
        self._changed()
        trouble = await self._ask(do="run", scan=str(project.scan), edits=list(project.done_edits), until=until)
        if trouble is not None:
            stale: list[Step] = [step for step in COMPUTED if not self._is_current(step, plan)]
            failed = stale[0] if stale else until
            self._troubles[failed] = (plan.key(failed), trouble)
        if plan is self._plan:
            self._save_reached()
        self._ended()

    def _ended(self) -> None:
        """Tell that a computation is over, and what is next."""
        self._stopped = False
        self.running = self._until or ("export" if self._exports else None)
        self._changed()

    async def _export(self, kind: str) -> None:
        project, plan = self._opened(), self._plan
        name = export_name(kind, project.scan)
        folder = project.folder / EXPORTS
        path = folder / name
        self.running, self._writing = "export", kind
        self._changed()
        try:
            if is_linked(path):
                raise OutputError(refusal(path, project.folder), path=path)
            folder.mkdir(exist_ok=True)
            asked = {"do": "export", "scan": str(project.scan), "edits": list(project.done_edits), "kind": kind, "path": str(path)}
            trouble = await self._ask(until="model", **asked)
        except OSError as error:
            trouble = f"The file cannot be written: {error.strerror}."
        except OutputError as error:
            trouble = error.message
        self._writing = None
        if trouble is not None:
            self.tell(Trouble(text=trouble))
        elif path.exists() and not self.workshop.cancelled:  # else it is an older one
            opened = self._opened()
            self._save(replace(opened, exports={**opened.exports, name: self._export_keys(kind, plan)[0]}))
        self._ended()

    async def _ask(self, **request: Any) -> str | None:
        project = self._opened()
        return await self.workshop.request(self._hear, project=str(project.folder), sha256=project.sha256, **request)

    async def _hear(self, answer: Answer) -> None:
        if isinstance(answer, bytes):
            self._frames[name_of(answer)] = answer
            self.tell(answer)
        elif answer["say"] == "result":
            result = answer["result"]
            self._results[result["step"]] = result
            self._troubles.pop(result["step"], None)
            if _later(self._current_until(self._plan), self._opened().reached) != self._opened().reached:
                self._save_reached()  # at once: whoever is killed before the end has got so far
            self._changed()
        elif answer["say"] == "progress" and not self._stopped:
            self.tell(Progress(**{name: answer[name] for name in ("step", "stage", "done", "total")}))

    def _opened(self) -> Project:
        assert self.project is not None
        return self.project

    # ---- the state

    def _changed(self) -> None:
        self._revision += 1
        self.tell(self.state())

    def _is_current(self, step: Step, plan: Plan) -> bool:
        return step in self._results and self._results[step]["key"] in plan.keys(step)

    def _current_until(self, plan: Plan) -> Step:
        """Return the last step up to which nothing has to be computed."""
        until: Step = "scan"
        for step in COMPUTED:
            if not self._is_current(step, plan):
                break
            until = step
        return until

    def _save_reached(self) -> None:
        reached = self._current_until(self._plan)
        if reached != self._opened().reached:
            self._save(replace(self._opened(), reached=reached, farthest=_later(self._opened().farthest, reached)))

    def _save(self, project: Project) -> None:
        """Save what came of computing; where that cannot be, pages are told, and computing goes on."""
        self.project = project
        if self.look_only:
            return
        try:
            project.save()
        except OutputError as error:
            self.tell(Trouble(text=error.message))
        except OSError as error:
            self.tell(Trouble(text=" ".join(str(error).split())))

    def state(self) -> State:
        """Return the project as it stands."""
        project, plan = self.project, self._plan
        edits = () if project is None else project.edits
        done = 0 if project is None else project.done
        return State(
            project="" if project is None else str(project.folder),
            scan="" if project is None else project.scan.name,
            opens=self.opens,
            reached="scan" if project is None else project.reached,
            unit=self._unit(plan),
            revision=self._revision,
            edits=[EditEntry(text=describe_edit(edit), step=step_of(edit), done=k < done) for k, edit in enumerate(edits)],
            can_undo=done > 0,
            can_redo=done < len(edits),
            values=plan.values(),
            idle=sorted(plan.idle()),
            steps=self._step_states(plan),
            running=self.running,
            files=self._files(plan),
            notice=LOOK_ONLY if self.look_only else "",
        )

    def _unit(self, plan: Plan) -> str:
        found = self._results.get("scan", {}).get("automatic", {}).get("scan.unit")
        return plan.unit or found or "mm"

    def _step_states(self, plan: Plan) -> list[StepState]:
        states: list[StepState] = []
        busy = self.running
        for step in COMPUTED:
            current = self._is_current(step, plan)
            key, text = self._troubles.get(step, ("", ""))
            failed = key == plan.key(step) and not current
            status: Status = "current" if current else "failed" if failed else "outdated" if self._was_done(step) else "empty"
            if not current and busy is not None and (busy == "export" or STEPS.index(step) <= STEPS.index(busy)):
                status, busy = "running", None
            result: Any = self._results.get(step)
            states.append(StepState(step=step, status=status, result=result, trouble=text if failed else None))
        files = self._files(plan)
        ready: Status = "current" if any(file.current for file in files) else "outdated" if files else "empty"
        ready = "running" if self.running == "export" else ready
        return [*states, StepState(step="export", status=ready, result=None, trouble=None)]

    def _was_done(self, step: Step) -> bool:
        """Tell whether a step was done before, if not since the studio was started; the scan is read anew by each."""
        before = "scan" if self.project is None else self.project.farthest
        return step in self._results or 0 < STEPS.index(step) <= STEPS.index(before)

    def _export_keys(self, kind: str, plan: Plan) -> list[str]:
        """Return what an exported file follows from besides the scan: the first that is known, and what else would give the same."""
        keys = [plan.key("model")] if kind in _WITH_EDGES else list(plan.keys("model"))
        found = self._results.get("model", {}).get("key")
        return [f"{key} {software()}" for key in sorted(keys, key=lambda key: key != found)]

    def _files(self, plan: Plan) -> list[FileEntry]:
        if self.project is None:
            return []
        entries = []
        kinds = {export_name(kind.name, self.project.scan): kind.name for kind in export_kinds() if kind.available}
        for name, key in self.project.exports.items():
            keys = self._export_keys(kinds.get(name, "points"), plan)
            with contextlib.suppress(OSError):
                size = (self.project.folder / EXPORTS / name).stat().st_size
                entries.append(FileEntry(name=name, size=size, current=key in keys))
        return entries


def _later(one: Step, other: Step) -> Step:
    return one if STEPS.index(one) >= STEPS.index(other) else other


def _plan_of(project: Project | None) -> Plan:
    return replay(()) if project is None else project.plan
