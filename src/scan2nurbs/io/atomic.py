"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scan2nurbs.errors import OutputError

_DISK_TROUBLE = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block ends well, and vanishes when it does not.

    The temporary file has the same suffix, because CAD writers look at it, and the mode that the umask gives. A symbolic link stays
    one: what it points to is replaced.

    Parameters
    ----------
    path : path
        The file to write. Its folder must exist.

    Yields
    ------
    Path
        An empty file in the folder of `path`, for the block to write.

    Raises
    ------
    OutputError
        If the folder is missing or not writable, `path` is a folder or a device, the disk is full, or the block wrote nothing.
    """
    target = Path(os.path.realpath(path))
    _check_target(target, path)
    temporary = _create_beside(target, path)
    try:
        yield temporary
        if not temporary.exists() or temporary.stat().st_size == 0:
            raise OutputError("Nothing was written.", path=os.fspath(path))
        os.replace(temporary, target)
    except OSError as error:
        if error.errno in _DISK_TROUBLE:
            raise OutputError(f"The file could not be written: {error.strerror}.", path=os.fspath(path)) from error
        raise
    finally:
        # After the replacement there is nothing left to remove; after a failure, Ctrl-C included, there is.
        temporary.unlink(missing_ok=True)


def _check_target(target: Path, path: str | os.PathLike[str]) -> None:
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        if not target.parent.is_dir():
            raise OutputError(f"The folder {target.parent} does not exist.", path=os.fspath(path)) from None
        return
    except OSError as error:
        raise OutputError(f"The file cannot be written: {error.strerror}.", path=os.fspath(path)) from error
    if stat.S_ISDIR(mode):
        raise OutputError("This is a folder, not a file.", path=os.fspath(path))
    if not stat.S_ISREG(mode):
        # Replacing /dev/null by a file would break the machine of whoever runs this as root.
        raise OutputError("This is a device or a pipe, not a regular file.", path=os.fspath(path))


def _create_beside(target: Path, path: str | os.PathLike[str]) -> Path:
    # The name is cut so that it stays a legal file name where the target's is as long as one may be.
    temporary = target.with_name(f".{target.stem[:40]}-{secrets.token_hex(6)}{target.suffix}")
    try:
        # Unlike tempfile's 0600, mode 0666 lets the umask decide.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OutputError(f"The folder {target.parent} cannot be written to: {error.strerror}.", path=os.fspath(path)) from error
    return temporary
