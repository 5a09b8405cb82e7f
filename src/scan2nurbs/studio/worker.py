"""The process that computes: it keeps the stages' results, and says what comes out, while the server goes on talking to the page.

Requests come in on stdin and answers go out on stdout, each a length (8 bytes, little-endian), a letter and its content: J for JSON,
B for a binary frame. When stdin ends the server is gone, and the process ends too.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import struct
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from scan2nurbs.errors import InputError, Scan2NurbsError
from scan2nurbs.part import Model, reconstruct
from scan2nurbs.report.record import plain
from scan2nurbs.studio.edits import AFTER_EDGES, Json, Plan, replay
from scan2nurbs.studio.messages import Step
from scan2nurbs.studio.scenes import Scenes
from scan2nurbs.studio.stages import STEP_OF, Cancelled, Reached, Stages
from scan2nurbs.studio.store import FOLDER, Store
from scan2nurbs.studio.takeaway import take_away

Result = TypeVar("Result")

HEAD = struct.Struct("<Qc")
_REPLACED = (
    "The scan's file was replaced or changed since this project was made. Put the file back that was there; for the new one start another "
    "studio with another folder: scan2nurbs studio SCAN --project DIR."
)
_EVERY = 0.05
"""Seconds between messages of progress."""


class Worker:
    """Answers requests one after the other.

    Parameters
    ----------
    out : binary stream
        Where answers go.
    """

    def __init__(self, out: BinaryIO) -> None:
        self.out = out
        self.stages = Stages()
        self.scenes = Scenes(self.stages)
        self.sent: dict[Step, str] = {}
        self.sha256 = ""
        self.told = 0.0

    def say(self, **content: Any) -> None:
        """Send a JSON answer."""
        self._send(b"J", json.dumps(plain(content), allow_nan=False).encode())

    def answer(self, request: dict[str, Any]) -> None:
        """Do what is asked for, and say that it is done or why it is not."""
        try:
            self._keep_in(Path(request["project"]) / FOLDER)
            self.sha256 = request["sha256"]
            if request["do"] == "run":
                self.run(Path(request["scan"]), replay(request["edits"]), request["until"])
            else:
                self.export(Path(request["scan"]), request["edits"], request["kind"], Path(request["path"]))
            self.say(say="done", trouble=None)
        except Cancelled:
            self.say(say="cancelled")
        except (Scan2NurbsError, MemoryError, OSError) as error:
            # The scan's folder is known; a long path would hide what is wrong.
            self.say(say="done", trouble=_sentence(error).replace(request["scan"], Path(request["scan"]).name))
        except Exception as error:  # a process that died of its own fault would look to the page as if it still computed
            self.say(say="done", trouble=f"Internal error, please report it: {type(error).__name__}: {error}")

    def run(self, scan: Path, plan: Plan, until: Step) -> None:
        """Compute up to a step, and send what is seen of every step that is not as it was sent last."""
        self.stages.begin(until, lambda step: self._show(step, plan), lambda step: self._show_again(step, plan))
        with contextlib.suppress(Reached):
            self._show("model", plan, self._model(scan, plan))

    def export(self, scan: Path, edits: list[Json], kind: str, path: Path) -> None:
        """Write the model in a format."""
        plan = replay(edits)
        self.stages.begin("model", lambda step: self._show(step, plan))
        model = self._model(scan, plan)
        self._show("model", plan, model)
        self.say(say="progress", step="export", stage="writing", done=0, total=1)
        take_away(model, plan.params, kind, path, edits)

    def _model(self, scan: Path, plan: Plan) -> Model:
        model = reconstruct(scan, plan.params, unit=plan.unit, progress=self._progress, run=self._stage)
        # Reading what was kept takes no time to speak of; the report tells what computing it took.
        return replace(model, report={**model.report, "seconds": model.report["seconds"] | self.stages.took})

    def _stage(self, stage: str, given: object, compute: Callable[[], Result]) -> Result:
        def told() -> Result:
            if stage in _CALLED:
                self._progress(_CALLED[stage], 0, 0)
            result: Any = compute()
            if stage == "read" and result.sha256 != self.sha256:
                raise InputError(_REPLACED)
            return result

        return self.stages(stage, given, told)

    def _keep_in(self, folder: Path) -> None:
        """Keep results in a folder; another folder is another project."""
        if self.stages.store is None or self.stages.store.folder != folder:
            stop = self.stages.stop
            self.stages = Stages(Store(folder))
            self.stages.stop = stop  # another thread has it already
            self.scenes = Scenes(self.stages)
            self.sent.clear()

    def _key(self, step: Step, plan: Plan) -> str:
        return plan.key(step, by_edges=step not in AFTER_EDGES or self.stages.results["faces"].by_edges)

    def _show(self, step: Step, plan: Plan, model: Model | None = None) -> None:
        key = self._key(step, plan)
        if self.sent.get(step) == key or (step == "model" and model is None):
            return
        self._send_scene(step, key, model)

    def _show_again(self, step: Step, plan: Plan) -> bool:
        """Send what was seen of a step before; tell whether there is such."""
        key = self._key(step, plan)
        if self.sent.get(step) != key and self.stages.has_scene(step, key):
            self._send_scene(step, key, None)
        return self.sent.get(step) == key

    def _send_scene(self, step: Step, key: str, model: Model | None) -> None:
        if step == "edges" and not self.stages.has_scene(step, key):
            self._progress("drawing curves", 0, 0)
        result, frames = self.scenes.scene(step, key, model)
        for frame in frames:
            self._send(b"B", frame)
        self.say(say="result", result=result)
        self.sent[step] = key

    def _progress(self, stage: str, done: int, total: int) -> None:
        self.stages.check()
        now = time.monotonic()
        if now < self.told + _EVERY and 0 < done < total:
            return
        self.told = now
        self.say(say="progress", step=_STEP_OF_STAGE.get(stage, "scan"), stage=stage, done=done, total=total)

    def _send(self, letter: bytes, content: bytes) -> None:
        self.out.write(HEAD.pack(len(content), letter) + content)
        self.out.flush()


_CALLED = {
    "read": "reading the scan",
    "scale": "measuring",
    "edges": "finding edges",
    "faces": "finding faces",
    "corrections": "correcting faces",
    "relations": "relating surfaces",
    "topology": "finding borders",
    "model": "building the model",
}
"""What stages are called while they are at work; some of them do not say how far they are, or not at once."""
_STEP_OF_STAGE = {name: STEP_OF[stage] for stage, name in _CALLED.items()} | {"drawing curves": STEP_OF["edges"]}


def _sentence(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "There is not enough memory for this scan; thin it out first."
    return " ".join(str(error).split())


def main() -> None:
    """Serve until stdin ends."""
    # What libraries print must not get between the answers.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    worker = Worker(out)
    requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()

    def listen() -> None:
        stream = sys.stdin.buffer
        while head := stream.read(HEAD.size):
            length, _ = HEAD.unpack(head)
            request = json.loads(stream.read(length))
            if request["do"] == "cancel":
                worker.stages.stop.set()
            else:
                worker.stages.stop.clear()
                requests.put(request)
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        worker.answer(requests.get())


if __name__ == "__main__":
    main()
