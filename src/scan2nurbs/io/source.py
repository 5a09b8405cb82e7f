"""The bytes of a scan file, mapped or unpacked, as every reader gets them."""

from __future__ import annotations

import gzip
import io
import mmap
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from scan2nurbs.errors import InputError

Buffer: TypeAlias = "bytes | mmap.mmap"

UNPACKED_ALWAYS_ALLOWED = 1 << 28
"""Bytes that a packed file may always unpack to."""

UNPACKED_RATIO = 100
"""Beyond that, how many times its packed size a file may unpack to; scans reach 2 to 20."""

_CHUNK = 1 << 22


@dataclass(frozen=True)
class Source:
    """A file's content and its name.

    Attributes
    ----------
    path : Path
        The file, for messages and for libraries that open files themselves.
    data : bytes or mmap
        The content, unpacked.
    packed : bool
        Whether the file holds the content packed by gzip.
    """

    path: Path
    data: Buffer
    packed: bool = False

    @property
    def suffix(self) -> str:
        """The suffix in lower case; of a packed file the one before ".gz"."""
        path = self.path.with_suffix("") if self.packed and self.path.suffix.lower() in {".gz", ".gzip"} else self.path
        return path.suffix.lower()

    def forget(self, stop: int) -> None:
        """Let the system have back the memory under the first `stop` bytes of a mapped file; they can be read again all the same."""
        advice = getattr(mmap, "MADV_DONTNEED", None)  # not on every system
        pages = stop - stop % mmap.PAGESIZE
        if isinstance(self.data, mmap.mmap) and advice is not None and pages:
            self.data.madvise(advice, 0, pages)

    def fault(self, message: str, offset: int | None = None) -> InputError:
        """Make the error that says what is wrong with this file, for the caller to raise."""
        return InputError(message, path=self.path, offset=offset)


@contextmanager
def open_source(path: Path) -> Iterator[Source]:
    """Open a file for reading, unpacked where gzip packed it.

    Raises
    ------
    InputError
        If there is no such file, it is empty, a folder or a device, may not be read, or is a broken gzip file.
    """
    try:
        if path.is_dir():
            raise InputError("This is a folder, not a file.", path=path)
        if path.exists() and not path.is_file():
            raise InputError("This is a device or a pipe, not a regular file.", path=path)
        with path.open("rb") as stream:
            if os.fstat(stream.fileno()).st_size == 0:
                raise InputError("The file is empty.", path=path)
            mapped = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError:
        raise InputError("There is no such file.", path=path) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise InputError(f"The file cannot be read: {error}.", path=path) from error
    try:
        if mapped[:2] == b"\x1f\x8b":
            yield Source(path, _unpack(mapped, path), packed=True)
        else:
            yield Source(path, mapped)
    finally:
        # The traceback of an error may still hold an array over the mapping; it is then closed when that goes.
        with suppress(BufferError):
            mapped.close()


def unpacked_limit(packed: int) -> int:
    """Return how many bytes a packed file of the given size may unpack to, before it is taken for an attack."""
    return max(UNPACKED_ALWAYS_ALLOWED, UNPACKED_RATIO * packed)


def _unpack(mapped: mmap.mmap, path: Path) -> bytes:
    limit = unpacked_limit(len(mapped))
    unpacked = io.BytesIO()
    try:
        with gzip.GzipFile(fileobj=mapped, mode="rb") as stream:
            while chunk := stream.read(_CHUNK):
                unpacked.write(chunk)
                if unpacked.tell() > limit:
                    raise InputError(f"The gzip file unpacks to more than {limit:,} bytes, {UNPACKED_RATIO} times its size.", path=path)
    except EOFError:
        raise InputError(f"The gzip file is truncated: it ends after {unpacked.tell():,} unpacked bytes.", path=path) from None
    except (OSError, zlib.error) as error:
        raise InputError(f"The gzip file is damaged: {error}.", path=path) from error
    if unpacked.tell() == 0:
        raise InputError("The gzip file holds nothing.", path=path)
    return unpacked.getvalue()
