"""One run of a command: everything around the computation, from the first message to the printed answer."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scan2nurbs.cli.common import Common, answer, messages, say, stdout_kept_clean
from scan2nurbs.cli.progress import Bars, compiling_noticed
from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.report.record import Stopwatch, peak_memory_mb, to_json, versions

if TYPE_CHECKING:
    from collections.abc import Callable

    from scan2nurbs.report.pictures import Picture


@dataclass
class Session:
    """What a command needs while it runs, and what it hands over at the end.

    Attributes
    ----------
    command : str
        Its name.
    common : Common
        The common options.
    progress : callable
        ``progress(stage, done, total)``.
    watch : Stopwatch
        Times the command's own stages.
    text : str
        The answer for a reader, made by `finish`.
    """

    command: str
    common: Common
    progress: Bars
    watch: Stopwatch = field(default_factory=Stopwatch)
    text: str = ""

    def bar(self, stage: str) -> Callable[[int, int], None]:
        """Return a callback ``(done, total)`` that moves the bar of `stage`."""
        return lambda done, total: self.progress(stage, done, total)

    def finish(
        self,
        record: dict[str, Any],
        summary: Sequence[str],
        *,
        verdict: str | None = None,
        outputs: Sequence[Path | None] = (),
        headline: Sequence[tuple[str, str]] = (),
        pictures: Callable[[], list[Picture]] = list,
    ) -> None:
        """Complete the record, write the report, and keep the answer.

        Parameters
        ----------
        record : dict
            What the command found; see docs/commands.md.
        summary : sequence of str
            The answer in lines, for a reader.
        verdict : str, optional
            The answer's last line, after the names of the files.
        outputs : sequence of path or None
            Files that were written.
        headline : sequence of (name, value)
            The figures at the head of the report.
        pictures : callable
            Makes the report's pictures; called only where there is a report.
        """
        written = [path for path in (*outputs, self.common.report) if path is not None]
        record = {"schema": f"scan2nurbs/{self.command}/1", **record}
        record["outputs"] = written
        record["seconds"] = {**record.get("seconds", {}), **self.watch.seconds}
        record["peak_memory_mb"] = peak_memory_mb()
        warnings = record.setdefault("warnings", [])
        if not self.common.quiet:
            for text in warnings:
                say(f"scan2nurbs: warning: {text}")
        record["versions"] = versions()
        if self.common.report is not None:
            write_report(self.common.report, record, pictures(), headline)
        named = [] if self.common.quiet else [f"wrote {path}" for path in written]
        lines = [*summary, *named, *([] if verdict is None else [verdict])]
        self.text = to_json(record) if self.common.json else "".join(f"{line}\n" for line in lines)


@contextmanager
def running(command: str, common: Common, source: Path) -> Iterator[Session]:
    """Set up messages, threads and progress; print the answer when all files are there.

    Parameters
    ----------
    command : str
        Its name.
    common : Common
        The common options.
    source : Path
        The file that a failure is about where the error names none.
    """
    from scan2nurbs.kernels.runner import set_threads  # noqa: PLC0415 - brings Numba

    if common.threads is not None:
        set_threads(common.threads)
        os.environ.setdefault("POLARS_MAX_THREADS", str(common.threads))  # which polars reads when it is imported
    with ExitStack() as stack:
        stack.enter_context(messages(common))
        stack.enter_context(stdout_kept_clean(common.json))
        stack.enter_context(compiling_noticed(not common.quiet))
        session = Session(command, common, stack.enter_context(Bars(common.shows_progress)))
        try:
            yield session
        except (InputError, NoResultError, MemoryError) as error:
            error.add_note(str(source))
            raise
    answer(session.text)


def write_report(path: Path, record: dict[str, Any], pictures: list[Picture], headline: Sequence[tuple[str, str]]) -> None:
    """Write the HTML report, whole or not at all."""
    from scan2nurbs.io.atomic import atomic_path  # noqa: PLC0415
    from scan2nurbs.report.html import render_html  # noqa: PLC0415 - brings Jinja2 and matplotlib

    with atomic_path(path) as temporary:
        temporary.write_text(render_html(record, pictures, headline), encoding="utf-8")
