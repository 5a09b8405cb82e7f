"""Progress bars with the time left, on stderr; and a word when kernels are compiled."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn


@cache
def console() -> Console:
    """Return the one console on stderr, which keeps messages and bars apart."""
    return Console(stderr=True)


class Bars:
    """One bar a stage, drawn while it runs and gone afterwards.

    Called as ``bars(stage, done, total)``; does nothing when not shown.
    """

    def __init__(self, shown: bool) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(elapsed_when_finished=True))
        self._progress = Progress(*columns, console=console(), transient=True, disable=not shown)
        self._tasks: dict[str, TaskID] = {}
        self._current = ""

    def __enter__(self) -> Bars:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._progress.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Move the bar of `stage` to `done` of `total`."""
        if stage not in self._tasks:
            self._tasks[stage] = self._progress.add_task(stage, total=total)
        elif done < self._progress.tasks[self._tasks[stage]].completed:
            self._progress.reset(self._tasks[stage])  # another pass of the same stage
        if stage != self._current:
            self._current = stage
            for name, task in self._tasks.items():
                self._progress.update(task, visible=name == stage)
        self._progress.update(self._tasks[stage], completed=done, total=total)


@contextmanager
def compiling_noticed(wanted: bool) -> Iterator[None]:
    """Say it once when a kernel is compiled, since the first run then takes its time for no visible reason."""
    if not wanted:
        yield
        return
    from numba.core import event  # noqa: PLC0415 - numba only when a command runs

    from scan2nurbs.cli.common import say  # noqa: PLC0415

    class Notice(event.Listener):
        said = False

        def on_start(self, event: Any) -> None:
            if not Notice.said:
                Notice.said = True
                say("scan2nurbs: Compiling kernels (first run only)…")

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Notice()):
        yield
