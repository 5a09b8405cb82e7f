"""One studio at a time on a project: a file that the system keeps locked for as long as its process lives, however it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import BinaryIO

from scan2nurbs.errors import InputError

FILE = ".studio.lock"
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # nothing outside of the project is written to
_PLACE = 1 << 20  # Windows locks bytes against reading too: lock one behind the text


def lock_project(folder: Path) -> BinaryIO | None:
    """Lock a project until the file that is returned is closed or the process ends; None where the folder cannot be written to.

    Raises
    ------
    InputError
        If another process has it.
    """
    try:
        stream = os.fdopen(os.open(folder / FILE, os.O_RDWR | os.O_CREAT | _NO_LINK, 0o644), "r+b", buffering=0)
    except OSError:
        return None
    try:
        _lock(stream)
    except OSError:
        stream.seek(0)
        other = stream.read(20).decode("ascii", "replace").strip() or "unknown"
        stream.close()
        raise InputError(f"Another studio (process {other}) has this project open; stop it first, or use its page.", path=folder) from None
    stream.seek(0)
    stream.truncate()
    stream.write(f"{os.getpid()}\n".encode())
    return stream


def _lock(stream: BinaryIO) -> None:
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415

        stream.seek(_PLACE)
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl  # noqa: PLC0415

        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
