"""The stages of `reconstruct` with their results kept: only what depends on a change is computed again, and it can be stopped."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, TypeVar

from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.studio.live import moved
from scan2nurbs.studio.messages import STEPS, Step

Result = TypeVar("Result")
Chain = tuple[Any, ...]

STEP_OF: dict[str, Step] = {
    "read": "scan",
    "scale": "scan",
    "edges": "edges",
    "boundary": "edges",
    "faces": "faces",
    "corrections": "faces",
    "relations": "surfaces",
    "topology": "surfaces",
    "model": "model",
}
_KEPT = 3


class Cancelled(Exception):  # noqa: N818 - no error: it was asked for
    """The computation was stopped on request."""


class Reached(Exception):  # noqa: N818 - no error: there is no more to do
    """All wanted stages are done."""


class Stages:
    """Runs stages for `reconstruct`, see `scan2nurbs.part.StageRunner`.

    A stage's result follows from what it is given and from the results before it, so the list of all that was given so far names it.
    The last few results of each stage are kept.

    Attributes
    ----------
    stop : threading.Event
        Set by another thread to stop the run.
    """

    def __init__(self) -> None:
        self.stop = threading.Event()
        self._kept: dict[str, OrderedDict[Chain, tuple[Any, float]]] = {}
        self._chain: list[Any] = []
        self._until: Step = "model"
        self._on_step: Callable[[Step], None] = lambda _step: None
        self._step: Step | None = None
        self._sliders: tuple[list[Any], EdgeParams, Any] | None = None
        self.results: dict[str, Any] = {}
        self.seconds: dict[Step, float] = {}

    def begin(self, until: Step, on_step: Callable[[Step], None]) -> None:
        """Begin a run that ends after the step `until`; `on_step` is called after each step that is done."""
        self._chain, self._until, self._on_step, self._step = [], until, on_step, None
        self.results, self.seconds = {}, {}

    def finish(self) -> None:
        """Tell of the last step."""
        if self._step is not None:
            self._on_step(self._step)

    def __call__(self, stage: str, given: object, compute: Callable[[], Result]) -> Result:
        """Return the stage's result, kept or computed."""
        step = STEP_OF[stage]
        if self._step not in (None, step):
            self.finish()
            if STEPS.index(step) > STEPS.index(self._until):
                self._step = None
                raise Reached
        self._step = step
        self.check()
        if isinstance(given, EdgeParams):
            result = self.keep(stage, given, lambda: self._moved(given) or compute())
            self._sliders = (self._chain[:-1], given, result)
        else:
            result = self.keep(stage, given, compute)
        self.results[stage] = result
        return result

    def keep(self, name: str, given: object, compute: Callable[[], Result]) -> Result:
        """Return what a stage gave before of the same, else compute it."""
        self._chain += [name, given]
        return self._kept_or(name, compute)

    def aside(self, name: str, compute: Callable[[], Result]) -> Result:
        """Return what was made before of the results so far, else compute it; no stage follows from it."""
        return self._kept_or(name, compute)

    def _kept_or(self, name: str, compute: Callable[[], Result]) -> Result:
        chain = tuple(self._chain)
        kept = self._kept.setdefault(name, OrderedDict())
        if chain not in kept:
            start = time.perf_counter()
            result = compute()
            kept[chain] = (result, time.perf_counter() - start)
            if len(kept) > _KEPT:
                kept.popitem(last=False)
        kept.move_to_end(chain)
        step = self._step or "scan"
        self.seconds[step] = self.seconds.get(step, 0.0) + kept[chain][1]
        return kept[chain][0]

    def _moved(self, params: EdgeParams) -> Any:
        """Return the edges as sliders moved them; None where the cloud has to be passed again."""
        if self._sliders is None or self._sliders[0] != self._chain[:-1]:
            return None
        _, before, edges = self._sliders
        return moved(edges, before, params)

    def check(self) -> None:
        """Stop here if that was asked for.

        Raises
        ------
        Cancelled
        """
        if self.stop.is_set():
            raise Cancelled
