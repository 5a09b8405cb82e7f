"""LZF, the compression of PCD's ``binary_compressed`` (Marc Lehmann's liblzf)."""

from __future__ import annotations

LARGEST_RATIO = 88
"""Three bytes of LZF unpack to 264 at the most."""


class LzfError(ValueError):
    """The packed bytes are damaged; carries the offset among them."""

    def __init__(self, message: str, offset: int) -> None:
        self.offset = offset
        super().__init__(message)


def unpack_lzf(packed: bytes, size: int) -> bytes:
    """Unpack LZF.

    Parameters
    ----------
    packed : bytes
        The whole packed stream.
    size : int
        How many bytes it must unpack to.

    Raises
    ------
    LzfError
        If it refers to what is not there, ends within a run, or unpacks to more or less than `size`.
    """
    out = bytearray()
    place, end = 0, len(packed)
    while place < end:
        control = packed[place]
        place += 1
        if control < 32:  # a run of bytes as they are
            run = packed[place : place + control + 1]
            if len(run) <= control:
                raise LzfError("the data end within a run", place)
            out += run
            place += control + 1
        else:
            length, start, place = _reference(packed, place, control, len(out))
            piece = out[start : start + length]
            if len(piece) < length:  # the run overlaps what it writes: its beginning repeats
                piece = (piece * (length // len(piece) + 1))[:length]
            out += piece
        if len(out) > size:
            raise LzfError(f"the data unpack to more than {size:,} bytes", place)
    if len(out) < size:
        raise LzfError(f"the data unpack to {len(out):,} bytes instead of {size:,}", place)
    return bytes(out)


def _reference(packed: bytes, place: int, control: int, written: int) -> tuple[int, int, int]:
    """Return the length and start of an earlier run, and where the packed data go on."""
    length = control >> 5
    tail = packed[place : place + 2]
    needed = 2 if length == 7 else 1
    if len(tail) < needed:
        raise LzfError("the data end within a reference", place)
    if length == 7:
        length += tail[0]
    start = written - ((control & 31) << 8) - tail[needed - 1] - 1
    if start < 0:
        raise LzfError("the data refer to what lies before them", place)
    return length + 2, start, place + needed
