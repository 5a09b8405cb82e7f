"""What goes wrong, as exit codes and sentences; and signals that let everything be cleaned up."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from scan2nurbs.errors import InputError, ParameterError, Scan2NurbsError

DONE, USAGE, INPUT, NO_RESULT, INTERRUPTED = 0, 2, 3, 4, 130
BUG = 1


class Interrupted(BaseException):
    """The user or the system asked to stop; not an `Exception`, so that nothing takes it for a failure of its own.

    Parameters
    ----------
    code : int
        The exit code: 128 + the signal's number.
    """

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__("Interrupted; no file was left half-written.")


@contextmanager
def interruptible() -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into `Interrupted` while the block runs, so that temporary files go as for any exception."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    caught: list[int] = []

    def stop(number: int, _frame: FrameType | None) -> None:
        caught.append(number)
        # A second Ctrl-C ends a computation that does not look up, at the price of what it would have cleaned.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        raise Interrupted(128 + number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    except Exception as error:
        # A library that was stopped in the middle of its import says that the import failed.
        if caught:
            raise Interrupted(128 + caught[0]) from error
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def exit_code(error: BaseException) -> int:
    """Return the exit code that tells a script what kind of failure this was."""
    if isinstance(error, Interrupted):
        return error.code
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED
    if isinstance(error, ParameterError):
        return USAGE
    if isinstance(error, InputError):
        return INPUT
    if isinstance(error, Scan2NurbsError | MemoryError | OSError):
        return NO_RESULT
    return BUG


def sentence(error: BaseException) -> str:
    """Say on one line what went wrong, and with which file."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        text = f"There is not enough memory: {text or 'an array does not fit'}. Thin the scan out first, or use a larger machine."
    elif isinstance(error, OSError) and error.strerror:
        where = f"{os.fspath(error.filename)}: " if isinstance(error.filename, str | os.PathLike) else ""
        text = f"{where}{error.strerror}."
    elif not isinstance(error, Scan2NurbsError | Interrupted):
        text = f"Internal error, please report it with the output of --debug: {type(error).__name__}: {text}"
    about = getattr(error, "__notes__", [])
    return text if not about or about[0] in text else f"{about[0]}: {text}"
