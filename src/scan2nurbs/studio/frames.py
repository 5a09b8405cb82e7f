"""Arrays on the wire: a binary frame is a length, a JSON header and the arrays' bytes, little-endian.

The first four bytes are the length of the header, which is padded with blanks so that the arrays begin at a multiple of eight bytes;
so does each array. A page can look at them where they lie, without copying.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.report.record import plain
from scan2nurbs.studio.messages import ArrayInfo, FrameHeader

Dtype = Literal["float32", "int32", "uint32", "uint8"]
_DTYPES: dict[str, Dtype] = {"float32": "float32", "int32": "int32", "uint32": "uint32", "uint8": "uint8"}


def pack(name: str, key: str, arrays: Mapping[str, NDArray[Any]], numbers: Mapping[str, float] | None = None) -> bytes:
    """Make a frame.

    Parameters
    ----------
    name, key : str
        What it holds, and of which edits it follows.
    arrays : mapping of str to array
        Of float32, int32, uint32 or uint8.
    numbers : mapping of str to float, optional
        Single values that belong to them.
    """
    infos, parts, offset = [], [], 0
    for title, array in arrays.items():
        little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        data = little.tobytes()
        padded = data + bytes(-len(data) % 8)
        infos.append(ArrayInfo(name=title, dtype=_DTYPES[array.dtype.name], shape=list(array.shape), offset=offset))
        parts.append(padded)
        offset += len(padded)
    header = json.dumps(plain(FrameHeader(name=name, key=key, arrays=infos, numbers=dict(numbers or {})))).encode()
    header += b" " * (-(len(header) + 4) % 8)
    return b"".join([struct.pack("<I", len(header)), header, *parts])


def unpack(frame: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the header and the arrays of a frame."""
    (length,) = struct.unpack_from("<I", frame)
    header = json.loads(frame[4 : 4 + length])
    arrays = {}
    for info in header["arrays"]:
        count = int(np.prod(info["shape"]))
        dtype = np.dtype(info["dtype"]).newbyteorder("<")
        arrays[info["name"]] = np.frombuffer(frame, dtype, count, 4 + length + info["offset"]).reshape(info["shape"])
    return header, arrays


def name_of(frame: bytes) -> str:
    """Return what a frame holds, without looking at the arrays."""
    (length,) = struct.unpack_from("<I", frame)
    return str(json.loads(frame[4 : 4 + length])["name"])
