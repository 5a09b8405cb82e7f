"""The stages of `reconstruct` with their results kept: only what depends on a change is computed again, and it can be stopped."""

from __future__ import annotations

import hashlib
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar, cast

from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.part_faces import Parted
from scan2nurbs.studio.live import moved, normals_of
from scan2nurbs.studio.messages import STEPS, Step
from scan2nurbs.studio.store import NAMES, Name, Store

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


def without_marks(chain: list[Any]) -> list[Any]:
    """Return what was given without what only says which points are marked as edges: the sliders, and corrections by hand."""
    pairs = [(name, given) for name, given in zip(chain[::2], chain[1::2], strict=True) if name != "boundary"]
    return [part for name, given in pairs for part in (name, normals_of(given) if isinstance(given, EdgeParams) else given)]


class Stages:
    """Runs stages for `reconstruct`, see `scan2nurbs.part.StageRunner`.

    A stage's result follows from what it is given and from the results before it, so the list of all that was given so far names it.
    The last few results of each stage are kept in memory, the very last in files, where there is a place for them.

    Parameters
    ----------
    store : Store, optional
        The files.

    Attributes
    ----------
    stop : threading.Event
        Set by another thread to stop the run.
    results : dict of str to object
        By stage, of this run.
    seconds, took : dict of str to float
        By step, and by stage, what computing the results took, now or when they were kept.
    notes : dict of str to list of str
        By step, what the files were no use for.
    """

    def __init__(self, store: Store | None = None) -> None:
        self.store = store
        self.stop = threading.Event()
        self._kept: dict[str, OrderedDict[Chain, tuple[Any, float]]] = {}
        self._chain: list[Any] = []
        self._until: Step = "model"
        self._seen: Callable[[Step], bool] = lambda _step: False
        self._on_step: Callable[[Step], None] = lambda _step: None
        self._step: Step | None = None
        self._sliders: tuple[list[Any], EdgeParams, Any] | None = None
        self.results: dict[str, Any] = {}
        self.seconds: dict[Step, float] = {}
        self.took: dict[str, float] = {}
        self.notes: dict[Step, list[str]] = {}

    def begin(self, until: Step, on_step: Callable[[Step], None], seen: Callable[[Step], bool] = lambda _step: False) -> None:
        """Begin a run that ends after the step `until`, or the last one after it of which nothing has to be computed.

        Parameters
        ----------
        until : str
        on_step : callable
            Called after each step that is done.
        seen : callable, optional
            Asked before the last step whether all that is seen of it is there already, so that the run may end.
        """
        self._chain, self._until, self._on_step, self._step, self._seen = [], until, on_step, None, seen
        self.results, self.seconds, self.took, self.notes = {}, {}, {}, {}

    def finish(self) -> None:
        """Tell of the last step."""
        if self._step is not None:
            self._on_step(self._step)

    def __call__(self, stage: str, given: object, compute: Callable[[], Result]) -> Result:
        """Return the stage's result, kept or computed."""
        step = STEP_OF[stage]
        if self._step not in (None, step):
            self.finish()
        self._step = step
        self.check()
        beyond = STEPS.index(step) > STEPS.index(self._until)
        if stage == "model" and (beyond or not self._in_memory(stage, given)) and self._is_seen(stage, given):
            raise Reached
        if beyond and not self._is_kept(stage, given):
            self._step = None
            raise Reached
        if isinstance(given, EdgeParams):
            result = self.keep(stage, given, lambda: self._moved(given) or compute())
            self._sliders = (self._chain[:-1], given, result)
        else:
            result = self.keep(stage, given, compute)
        self.results[stage] = result
        self._chain = self._chain_of(stage, result)
        return result

    def keep(self, name: str, given: object, compute: Callable[[], Result]) -> Result:
        """Return what a stage gave before of the same, else compute it."""
        self._chain += [name, given]
        return self._kept_or(name, compute)

    def scene(self, step: Step, key: str, make: Callable[[], Result]) -> Result:
        """Return what was made before to be seen of a step, else make it; no stage follows from it.

        Parameters
        ----------
        step : str
        key : str
            What it follows from besides the results so far.
        make : callable
        """
        self._chain += ["key", key]
        try:
            return self._kept_or(f"seen-{step}", make)
        finally:
            del self._chain[-2:]

    def has_scene(self, step: Step, key: str) -> bool:
        """Tell whether there is something to be seen of a step without the step's result; `scene` returns it then."""
        self._chain += ["key", key]
        try:
            return self._found(f"seen-{step}") is not None
        finally:
            del self._chain[-2:]

    def _is_kept(self, stage: str, given: object) -> bool:
        """Tell whether a stage's result need not be computed."""
        self._chain += [stage, given]
        try:
            return self._found(stage) is not None
        finally:
            del self._chain[-2:]

    def _in_memory(self, stage: str, given: object) -> bool:
        return (*self._chain, stage, given) in self._kept.get(stage, ())

    def _is_seen(self, stage: str, given: object) -> bool:
        self._chain += [stage, given]
        try:
            return self._seen(STEP_OF[stage])
        finally:
            del self._chain[-2:]

    def _kept_or(self, name: str, compute: Callable[[], Result]) -> Result:
        found = self._found(name)
        if found is None:
            start = time.perf_counter()
            result = compute()
            found = self._remember(name, self._chain_of(name, result), (result, time.perf_counter() - start))
        if self.store is not None and name in NAMES:
            self._note(self.store.put(cast(Name, name), self._digest(self._chain_of(name, found[0])), *found, self.results))
        step = self._step or "scan"
        if name in STEP_OF:
            self.took[name] = found[1]
        self.seconds[step] = self.seconds.get(step, 0.0) + found[1]
        return found[0]

    def _found(self, name: str) -> tuple[Any, float] | None:
        """Return what was kept in memory, else in a file."""
        kept = self._kept.get(name, OrderedDict())
        # Faces of other edge points are the same where those had no say.
        chains = [self._chain, without_marks(self._chain)] if name == "faces" else [self._chain]
        for chain in map(tuple, chains):
            if chain in kept:
                kept.move_to_end(chain)
                result, seconds = kept[chain]
                # What a file says of a result names the results in it, which are those of this run.
                return (replace(result, edges=self.results["edges"]) if isinstance(result, Parted) else result), seconds
        for chain in chains if self.store is not None and name in NAMES else ():
            assert self.store is not None
            found, why = self.store.get(cast(Name, name), self._digest(chain), self.results)
            self._note(why)
            if found is not None:
                return self._remember(name, chain, found)
        return None

    def _remember(self, name: str, chain: list[Any], found: tuple[Any, float]) -> tuple[Any, float]:
        kept = self._kept.setdefault(name, OrderedDict())
        kept[tuple(chain)] = found
        if len(kept) > _KEPT:
            kept.popitem(last=False)
        return found

    def _chain_of(self, name: str, result: Any) -> list[Any]:
        """Return what a result that was just computed follows from."""
        return without_marks(self._chain) if name == "faces" and not result.by_edges else self._chain

    def _digest(self, chain: list[Any]) -> str:
        """Return what a result follows from, as a short text that holds in another process too."""
        # Of the scan its bytes count, not where they lie; everything else that is given is made of numbers, words and tuples.
        _, (_, unit), *rest = chain
        return hashlib.sha256(repr((self.results["read"].sha256, unit, *rest)).encode()).hexdigest()

    def _note(self, why: str | None) -> None:
        notes = self.notes.setdefault(self._step or "scan", [])
        if why is not None and why not in notes:
            notes.append(why)

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
