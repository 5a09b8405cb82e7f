"""Small runs that compile the kernels of a part: those of its edges, and those of its faces."""

from __future__ import annotations

import numpy as np

from scan2nurbs.edges.detect import Edges, detect
from scan2nurbs.edges.params import EdgeParams
from scan2nurbs.faces.segmentation import SegmentParams, segment_points
from scan2nurbs.faces.topology import find_topology
from scan2nurbs.scale import measure_scale


def _scanned_box() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    points, normals = rng.uniform(0.0, 20.0, (2400, 3)), np.zeros((2400, 3))
    for side in range(6):
        rows, axis = slice(400 * side, 400 * side + 400), side % 3
        points[rows, axis], normals[rows, axis] = 20.0 * (side // 3), 1.0
    return points + rng.normal(0.0, 0.2, points.shape), normals


def compile_edges() -> None:
    """Find the edges of a box."""
    points, _ = _scanned_box()
    detect(points, measure_scale(points), EdgeParams())


def compile_faces() -> None:
    """Find the faces and borders of a box whose edges need no looking for."""
    points, normals = _scanned_box()
    scale, n = measure_scale(points), len(points)
    edges = Edges(np.zeros(n), np.zeros(n, bool), normals, None, None, None, 10.0, scale.h, scale.h, scale.noise)
    faces = segment_points(points, scale, edges, SegmentParams())
    find_topology(points, faces.label, faces.fits, scale)


HALVES = {"gw0": compile_edges, "gw1": compile_faces}
