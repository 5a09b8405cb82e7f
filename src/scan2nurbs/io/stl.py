"""STL, binary and as text: the corners of its triangles. It states no unit.

Each triangle brings its own three corners, so every vertex of the mesh appears about six times; the point cloud merges them.
"""

from __future__ import annotations

import re

import numpy as np

from scan2nurbs.io.lines import read_keyword_rows
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Buffer, Source

_HEADER = 84
_TRIANGLE = np.dtype({"names": ["corners"], "formats": [("<f4", (3, 3))], "offsets": [12], "itemsize": 50})
_TEXT = re.compile(rb"\s*solid\b[^\r\n]*[\r\n]\s*(facet|endsolid)\b", re.IGNORECASE)
_CORNERS = "Each STL triangle brings its own three corners; those that coincide count as duplicates."


def is_stl(head: bytes, size: int) -> bool:
    """Tell whether a file of `size` bytes is STL: text by its first words, binary by the number of triangles that fits its size."""
    return is_stl_text(head) or (size > _HEADER and size == _HEADER + 50 * _declared(head))


def is_stl_text(head: bytes) -> bool:
    """Tell whether a file begins like STL as text; many binary ones begin with "solid" too, but not with a facet after it."""
    return _TEXT.match(head) is not None


def read_stl(source: Source) -> Scan:
    """Read the corners of the triangles of an STL file.

    Raises
    ------
    InputError
        If there is no triangle, or fewer than declared.
    """
    size = len(source.data)
    exact = size >= _HEADER and size == _HEADER + 50 * _declared(source.data)
    if not exact and is_stl_text(source.data[: 1 << 16]):
        return _read_text(source)
    return _read_binary(source)


def _declared(data: Buffer) -> int:
    return int.from_bytes(data[80:84], "little") if len(data) >= _HEADER else 0


def _read_text(source: Source) -> Scan:
    points = read_keyword_rows(source, b"vertex")
    if not len(points):
        raise source.fault("The STL file holds no triangles.")
    tail = source.data[max(0, len(source.data) - (1 << 16)) :].lower()
    if b"endsolid" not in tail or len(points) % 3:
        raise source.fault(f"The STL file is truncated: it ends after {len(points):,} corners without 'endsolid'.", len(source.data))
    return Scan(points, None, "STL (ascii)", (_CORNERS,))


def _read_binary(source: Source) -> Scan:
    size = len(source.data)
    if size < _HEADER:
        raise source.fault(f"A binary STL file has a header of {_HEADER} bytes, this file {size:,} bytes in all.", size)
    declared, held = _declared(source.data), (size - _HEADER) // 50
    if declared > held:
        raise source.fault(f"The header declares {declared:,} triangles, the payload ends after {held:,}.", size)
    if declared == 0:
        raise source.fault("The STL header declares 0 triangles.", 80)
    triangles = np.frombuffer(source.data, _TRIANGLE, declared, _HEADER)
    points = triangles["corners"].astype(np.float64).reshape(-1, 3)
    rest = size - _HEADER - 50 * declared
    notes = (_CORNERS,) if not rest else (_CORNERS, f"The {rest:,} bytes behind the declared triangles were left out.")
    return Scan(points, None, "STL (binary)", notes)
