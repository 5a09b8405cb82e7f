"""OBJ, Wavefront's format: the vertices (``v``), whatever follows their coordinates. It states no unit."""

from __future__ import annotations

import re

from scan2nurbs.io.lines import read_keyword_rows
from scan2nurbs.io.scan import Scan
from scan2nurbs.io.source import Source

_STATEMENT = re.compile(rb"(v|vn|vt|vp|f|l|p|o|g|s|mtllib|usemtl|cstype|deg)(\s|$)")
_VERTEX = re.compile(rb"^v[ \t]+[-+.\d]", re.MULTILINE)


def is_obj(head: bytes) -> bool:
    """Tell whether the first line that is no comment is a statement of OBJ, or any line a vertex."""
    if _VERTEX.search(head):
        return True
    for line in head.splitlines():
        body = line.split(b"#", 1)[0].strip()
        if body:
            return _STATEMENT.match(body) is not None
    return False


def read_obj(source: Source) -> Scan:
    """Read the vertices of an OBJ file; a fourth number (weight) and colours are passed over.

    Raises
    ------
    InputError
        If there is no vertex or one has fewer than three numbers.
    """
    points = read_keyword_rows(source, b"v")
    if not len(points):
        raise source.fault("The OBJ file holds no vertices.")
    return Scan(points, None, "OBJ")
