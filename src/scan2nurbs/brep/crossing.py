"""Faces whose borders cross: what no triangles fit, and what the kernel may try for minutes to find any for."""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.brep.occ import kernel_errors
from scan2nurbs.brep.overlay import crossings

Floats = NDArray[np.float64]

_PER_STEP = 4
"""Samples of an edge for a loop of the shortest length that is looked for."""
_FEWEST, _MOST = 8, 800
"""Samples of an edge."""


def borders_cross(face: Any, least: float) -> bool:
    """Tell whether the borders of a face cross in its parameters, other than in a loop shorter than `least` in space.

    In kernel units; see `longest_lobe`. Shorter loops vanish in triangles of such a size, as where edges meet within the tolerance of their
    vertex.
    """
    return longest_lobe(face, least) > least


def longest_lobe(face: Any, step: float) -> float:
    """Return the length of the longest loop between two places where the borders of a face cross in its parameters.

    Parameters
    ----------
    face : TopoDS_Face
    step : float
        In kernel units: loops as short as this are found.

    Returns
    -------
    float
        In space; 0 where no borders cross, endless where two wires do.

    Raises
    ------
    KernelError
        If the kernel cannot evaluate its edges.

    Notes
    -----
    BRepCheck takes edges for meeting rightly that cross within the tolerances of both; the kernel's triangulation takes them as they lie.
    """
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS, TopoDS_Iterator

    loops: list[Floats] = []
    lengths: list[Floats] = []
    with kernel_errors("evaluate the borders of a face"):
        face = TopoDS.Face(face.Oriented(TopAbs_FORWARD))  # else its edges stand in the other order than they are passed
        wires = TopExp_Explorer(face, TopAbs_WIRE)
        while wires.More():
            parts = []
            edges = TopoDS_Iterator(wires.Current())
            while edges.More():
                edge = TopoDS.Edge(edges.Value())
                if not BRep_Tool.Degenerated_s(edge):
                    parts.append(_samples(edge, face, step))
                edges.Next()
            if parts:
                loops.append(np.vstack([uv for uv, _ in parts]))
                lengths.append(np.concatenate([steps for _, steps in parts]))
            wires.Next()
    return max((_lobe(pair, loops, lengths) for pair in crossings(loops)), default=0.0) if loops else 0.0


def _samples(edge: Any, face: Any, step: float) -> tuple[Floats, Floats]:
    """Return points (K, 2) along an edge in the parameters of a face, in its direction, and the length that each of them stands for."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
    from OCP.GCPnts import GCPnts_AbscissaPoint
    from OCP.TopAbs import TopAbs_REVERSED

    curve, flat = BRepAdaptor_Curve(edge), BRepAdaptor_Curve2d(edge, face)
    length = GCPnts_AbscissaPoint.Length_s(curve)
    count = int(np.clip(_PER_STEP * length / step, _FEWEST, _MOST))
    at = np.linspace(flat.FirstParameter(), flat.LastParameter(), count)
    uv = np.array([[point.X(), point.Y()] for point in map(flat.Value, at.tolist())])
    return uv[::-1] if edge.Orientation() == TopAbs_REVERSED else uv, np.full(count, length / count)


def _lobe(pair: tuple[int, int, int, int], loops: list[Floats], lengths: list[Floats]) -> float:
    """Return the length of the shorter part of a loop between two of its segments that cross; endless where two loops do."""
    first, i, second, j = pair
    if first != second:
        return np.inf
    between = float(lengths[first][min(i, j) : max(i, j)].sum())
    return min(between, float(lengths[first].sum()) - between)
