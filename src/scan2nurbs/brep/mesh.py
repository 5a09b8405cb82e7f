"""Mesh files for a look: binary STL, binary PLY, OBJ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.header import system

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Parts = Sequence[tuple[str, Floats, Ints]]

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PLY_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_stl(path: Path, parts: Parts) -> None:
    """Write named parts, each (name, points (N, 3), triangles (M, 3)), as one binary STL. It has neither unit nor names."""
    corners = np.concatenate([points[triangles] for _, points, triangles in parts])
    facets = np.zeros(len(corners), _STL_FACET)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    facets["corners"] = corners
    header = f"{system()} binary mesh".encode("ascii").ljust(80)
    path.write_bytes(header + np.uint32(len(facets)).astype("<u4").tobytes() + facets.tobytes())


def write_ply(path: Path, parts: Parts) -> None:
    """Write the parts as one binary PLY with coordinates in double precision."""
    points, triangles = _joined(parts)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {system()}\nelement vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), _PLY_FACE)
    faces["count"], faces["corners"] = 3, triangles
    path.write_bytes(header.encode("ascii") + points.astype("<f8").tobytes() + faces.tobytes())


def write_obj(path: Path, parts: Parts) -> None:
    """Write the parts as the objects of one OBJ."""
    lines = [f"# {system()}"]
    first = 1
    for name, points, triangles in parts:
        lines.append(f"o {name.replace(' ', '_')}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (triangles + first).tolist()]
        first += len(points)
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _joined(parts: Parts) -> tuple[Floats, Ints]:
    counts = np.cumsum([0] + [len(points) for _, points, _ in parts])
    points = np.concatenate([points for _, points, _ in parts])
    return points, np.concatenate([triangles + first for (_, _, triangles), first in zip(parts, counts, strict=False)])
