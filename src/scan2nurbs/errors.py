"""What can go wrong, as exceptions that carry what a caller needs to react.

The command line turns each into one sentence and an exit code; the Python API raises them as they are.
"""

from __future__ import annotations

from pathlib import Path


class Scan2NurbsError(Exception):
    """Base of every error that scan2nurbs raises on purpose."""


class ParameterError(Scan2NurbsError, ValueError):
    """A parameter lies outside its documented range (exit code 2)."""


class InputError(Scan2NurbsError):
    """The input cannot be read or used (exit code 3).

    Parameters
    ----------
    message : str
        What is wrong, as a sentence without the file's name.
    path : Path or str, optional
        The file it is about.
    offset : int, optional
        Byte offset (binary formats) or line number (text formats) of the fault.
    """

    def __init__(self, message: str, *, path: Path | str | None = None, offset: int | None = None) -> None:
        self.message = message
        self.path = None if path is None else Path(path)
        self.offset = offset
        super().__init__(message if path is None else f"{path}: {message}")


class MissingExtraError(InputError):
    """A format needs an optional dependency that is not installed (exit code 3)."""

    def __init__(self, what: str, extra: str, *, path: Path | str | None = None) -> None:
        self.extra = extra
        super().__init__(f"{what} needs an optional dependency: pip install 'scan2nurbs[{extra}]'", path=path)


class OutputError(Scan2NurbsError):
    """A result cannot be written where it was asked for (exit code 4).

    Parameters
    ----------
    message : str
        What is wrong, as a sentence without the file's name.
    path : Path or str
        The file that was to be written.
    """

    def __init__(self, message: str, *, path: Path | str) -> None:
        self.message = message
        self.path = Path(path)
        super().__init__(f"{path}: {message}")


class NoResultError(Scan2NurbsError):
    """The input is fine, but no result could be made from it (exit code 4)."""
