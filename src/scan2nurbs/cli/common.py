"""The options that every command has, and what they switch: threads, messages, progress bars, where the answer goes."""

from __future__ import annotations

import dataclasses
import inspect
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, get_type_hints

import typer

PANEL = "Common options"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Common:
    """What was said of the options that every command has."""

    unit: Annotated[
        str | None,
        typer.Option(help="Unit of the coordinates: mm, cm, m, um, in or ft; overrides what the file says.", rich_help_panel=PANEL),
    ] = None
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.", rich_help_panel=PANEL)] = (
        False
    )
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write a report with pictures into one HTML file.", rich_help_panel=PANEL)
    ] = None
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Read parameters from a file; the command line beats it.", rich_help_panel=PANEL),
    ] = None
    threads: Annotated[
        int | None, typer.Option(metavar="N", help="Threads to use; the result is the same for any number.", rich_help_panel=PANEL)
    ] = None
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress, no warnings; only the answer and errors.", rich_help_panel=PANEL)
    ] = False
    debug: Annotated[bool, typer.Option("--debug", help="Say what is done, and show the traceback of an error.", rich_help_panel=PANEL)] = (
        False
    )

    @property
    def shows_progress(self) -> bool:
        """Whether there is somebody to look at a progress bar."""
        return not (self.quiet or self.json) and sys.stderr.isatty()


def common_parameters() -> list[inspect.Parameter]:
    """Return the common options as parameters of a command."""
    hints = get_type_hints(Common, include_extras=True)
    return [
        inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name])
        for field in dataclasses.fields(Common)
    ]


class _Messages(logging.Handler):
    """Log records as lines on stderr, above a progress bar where there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        word = "" if record.levelno < logging.WARNING else f"{record.levelname.lower()}: "
        say(f"scan2nurbs: {word}{self.format(record)}")


def say(text: str) -> None:
    """Write a line on stderr, whatever is drawn there."""
    from scan2nurbs.cli.progress import console  # noqa: PLC0415 - rich only when something is said

    console().print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def messages(common: Common) -> Iterator[None]:
    """Send the library's log and Python's warnings to stderr while the block runs."""
    level = logging.DEBUG if common.debug else logging.ERROR if common.quiet else logging.WARNING
    handler = _Messages()
    ours, warned = logging.getLogger("scan2nurbs"), logging.getLogger("py.warnings")
    before = ours.level
    ours.setLevel(level)
    # For those who develop, not for those who scan: warnings of Python, and where matplotlib would rather keep its fonts.
    for logger in (warned, logging.getLogger("matplotlib")):
        logger.setLevel(logging.DEBUG if common.debug else logging.CRITICAL)
    for logger in (ours, warned):
        logger.addHandler(handler)
    logging.captureWarnings(True)
    try:
        yield
    finally:
        logging.captureWarnings(False)
        ours.setLevel(before)
        for logger in (ours, warned):
            logger.removeHandler(handler)


@contextmanager
def stdout_kept_clean(wanted: bool) -> Iterator[None]:
    """Send what libraries, compiled ones too, print on stdout to stderr while the block runs."""
    if not wanted:
        yield
        return
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def answer(text: str) -> None:
    """Write the answer on stdout; a reader that has gone away (``| head``) is no failure, since all files are written by now."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes stdout once more at exit, and would complain then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
