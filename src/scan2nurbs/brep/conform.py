"""Surfaces that do not reach the borders of their faces, bent so that they do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix, diags, eye, kron
from scipy.sparse.linalg import splu

from scan2nurbs.brep.borders import BorderCurve, lay_borders, without_faces
from scan2nurbs.brep.charts import Chart, SplineChart, chart_of
from scan2nurbs.brep.known import Known
from scan2nurbs.brep.layout import unrolled
from scan2nurbs.brep.overlay import winding
from scan2nurbs.brep.wide import WideSpline, widened
from scan2nurbs.errors import InputError, NoResultError
from scan2nurbs.faces.topology import Topology
from scan2nurbs.surfaces.bspline import bicubic
from scan2nurbs.surfaces.shape import Shape
from scan2nurbs.surfaces.shape_fit import fit_shape

Floats = NDArray[np.float64]

_ROUNDS = 6
_STEP = 0.7
"""Distance of nodes, in h, where a surface is bent."""
_AROUND = 2.5
"""How far beyond such places nodes are dense, in h."""
_STILL = 0.05
"""Distances from a border, in h, for which no surface is bent."""
_NODES = 160
_TURN = 48
_FARTHEST = 5.0
"""A surface farther than this from its border, in h, is another one."""
_HOLD, _STAY, _SMOOTH = 0.05, 0.3, 0.15
_MESH_NOISE = 0.05


def yielding(
    shapes: Sequence[Shape],
    topology: Topology,
    h: float,
    caution: Sequence[int],
    widest: float,
    first: Sequence[int],
    known: Known,
) -> tuple[list[int], list[BorderCurve]]:
    """Choose faces to be bent until the surfaces of all others meet in their borders.

    Parameters
    ----------
    shapes : sequence of Shape
        Of each face.
    topology : Topology
    h : float
        Spacing of the cloud.
    caution : sequence of int
        As in `lay_borders`.
    widest : float
        Largest distance of a border to its surfaces, in h.
    first : sequence of int
        Faces that are bent in any case.
    known : Known
        Curves that were laid before.

    Returns
    -------
    faces : list of int
        Rising. Of two surfaces that do not meet, that of the smaller face is bent.
    curves : list of BorderCurve
        The borders as the other faces have them.
    """
    area = topology.areas
    bent, curves = set(first), list[BorderCurve]()
    for _ in range(_ROUNDS):
        borders = [without_faces(b, bent, known) for b in topology.borders]
        curves, _ = lay_borders(borders, topology.vertices, shapes, h, caution, known, topology.held)
        wide = sorted((-c.gap, k) for k, c in enumerate(curves) if min(c.faces) >= 0 and c.gap > widest * h)
        moved: set[int] = set()
        for _, k in wide:
            # What a bent face leaves behind moves the vertices: what else is wide there is seen in the next round.
            if not moved & set(curves[k].vertices) - {-1}:
                bent.add(min(curves[k].faces, key=lambda f: (area[f], f)))
                moved |= set(curves[k].vertices)
        if not wide:
            break
    return sorted(bent), curves


def mesh_surface(topology: Topology, f: int, h: float) -> Shape:
    """Fit a B-spline surface to a face's part of the mesh: what its own surface cannot do where it holds a pole of that.

    Returns
    -------
    SplineShape
        Its normals on the side of those of the face's own surface, as the topology has it.

    Raises
    ------
    NoResultError
        If no surface fits.
    """
    mesh = topology.mesh
    triangles = mesh.triangles[mesh.face == f]
    try:
        shape: Any = fit_shape("bspline", mesh.vertices[np.unique(triangles)], noise=_MESH_NOISE * h).shape
    except InputError as error:
        raise NoResultError(str(error)) from error
    a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
    agree = np.einsum("nk,nk->n", np.cross(b - a, c - a), shape.normal((a + b + c) / 3.0))
    side = float(np.nansum(agree)) * topology.outward[f]
    return shape if side > 0.0 else replace(shape, surface=shape.surface.turned_over())


def conformed(shape: Shape, loops: Sequence[Floats], h: float, towards: Floats | None = None) -> WideSpline:
    """Bend a surface so that it passes through the borders of its face.

    Parameters
    ----------
    shape : Shape
    loops : sequence of (K, 3) float64
        Points along every loop of the face.
    h : float
        Spacing of the cloud.
    towards : (3,) float64, optional
        For a sphere, the direction of its axis.

    Raises
    ------
    NoResultError
        If the face holds a pole, goes around as a whole, lies far from its borders, or would fold.

    Notes
    -----
    The surface is offset along its normals by a bicubic spline in its own parameters, the distance of the borders at the borders and
    nothing soon away from them: a least-squares fit that is held to zero and kept from wrinkles.
    """
    wide: Any = widened(shape, np.vstack(loops), h)
    chart = chart_of(wide, 1.0, towards=towards)
    if isinstance(chart, SplineChart):
        chart = chart.guided(loops, h)
    paths, around = unrolled(chart, [chart.uv(loop) for loop in loops])
    if around[1] or (around[0] and any(pole is not None for pole in chart.poles) and len(paths) < 2):
        raise NoResultError("A surface that goes around both ways, or has a pole, cannot be bent.")
    uv, points = np.vstack(paths), np.vstack(loops)
    feet = chart.point(uv)
    off = np.einsum("nk,nk->n", points - feet, wide.normal(feet))
    if np.abs(off).max() > _FARTHEST * h:
        raise NoResultError("Its borders lie far from the surface.")
    axes = [_nodes(chart, uv, np.abs(off) > _STILL * h, axis, around[axis], h) for axis in (0, 1)]
    if around[0]:
        period = chart.period[0] or 0.0
        uv = np.vstack([uv + np.array([turn * period, 0.0]) for turn in (0, -1, 1)])
        inside = (uv[:, 0] >= axes[0][0]) & (uv[:, 0] <= axes[0][-1])
        uv, off = uv[inside], np.tile(off, 3)[inside]
    u, v = np.meshgrid(*axes, indexing="ij")
    grid = chart.point(np.column_stack([u.ravel(), v.ravel()]))
    offset = _offset(axes, uv, off)
    if around[0]:
        offset[[0, -1]] = 0.5 * (offset[0] + offset[-1])
    moved = (grid + offset.reshape(-1, 1) * wide.normal(grid)).reshape(*u.shape, 3)
    if around[0]:
        moved[-1] = moved[0]
    if _folds_within(moved, axes, paths, around[0]):
        raise NoResultError("A surface bent so far would fold.")
    return WideSpline(bicubic((axes[0], axes[1]), moved, (around[0], False)))


def _folds_within(grid: Floats, axes: Sequence[Floats], paths: Sequence[Floats], tube: bool) -> bool:
    """Tell whether a surface through a grid (U, V, 3) folds within the loops of its face: nobody sees the rest.

    A cell is folded that is turned by more than a right angle against the next one.
    """
    normal = np.cross(np.diff(grid, axis=0)[:, :-1], np.diff(grid, axis=1)[:-1])
    folded = np.zeros(normal.shape[:2], np.bool_)
    folded[:-1] |= np.einsum("uvk,uvk->uv", normal[1:], normal[:-1]) < 0.0
    folded[:, :-1] |= np.einsum("uvk,uvk->uv", normal[:, 1:], normal[:, :-1]) < 0.0
    cells = np.argwhere(folded)
    middles = np.column_stack([0.5 * (x[cells[:, k]] + x[cells[:, k] + 1]) for k, x in enumerate(axes)])
    if tube and len(paths) < 2:  # it ends where its loop does not tell
        return len(cells) > 0
    if tube:
        low, high = _heights(axes[0], paths)
        return bool(np.any((middles[:, 1] >= low[cells[:, 0]]) & (middles[:, 1] <= high[cells[:, 0]])))
    turns = np.stack([np.abs(winding(path, middles)) for path in paths])
    return bool(np.any(turns.sum(axis=0) % 2 == 1))


def _heights(nodes: Floats, paths: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Return the lowest and highest parameter of the loops of a tube over each of its columns of cells, and those beside it."""
    uv = np.vstack(paths)
    column = np.searchsorted(nodes, nodes[0] + (uv[:, 0] - nodes[0]) % (nodes[-1] - nodes[0]), side="right") - 1
    column = np.clip(column, 0, len(nodes) - 2)
    low, high = np.full((2, len(nodes) - 1), [[np.inf], [-np.inf]])
    np.minimum.at(low, column, uv[:, 1])
    np.maximum.at(high, column, uv[:, 1])
    beside = (-1, 0, 1)
    low = np.min([np.roll(low, turn) for turn in beside], axis=0)
    high = np.max([np.roll(high, turn) for turn in beside], axis=0)
    return np.where(np.isfinite(low), low, uv[:, 1].min()), np.where(np.isfinite(high), high, uv[:, 1].max())


def _nodes(chart: Chart, uv: Floats, moved: NDArray[np.bool_], axis: int, around: bool, h: float) -> Floats:
    """Return the parameters between which the surface is a cubic: close to each other where it is bent."""
    aside = np.zeros(2)
    aside[axis] = 1e-4 * max(float(np.ptp(uv[:, axis])), 1e-9)
    slope = float(np.median(np.linalg.norm(chart.point(uv + aside) - chart.point(uv), axis=1))) / aside[axis]
    step = _STEP * h / max(slope, 1e-300)
    low, high = float(uv[:, axis].min()), float(uv[:, axis].max())
    if around:
        low = low if chart.period[axis] is None else chart.start[axis]
        high = low + (chart.period[axis] or 0.0)
    else:
        low, high = low - 3.0 * step, high + 3.0 * step
    period = chart.period[axis]
    surface = getattr(chart, "surface", None)
    if surface is not None:
        knots = np.unique(surface.knots[axis])
        coarse = np.unique(np.r_[low, np.interp(np.arange(4 * len(knots) - 3) / 4, np.arange(len(knots)), knots), high])
        coarse = coarse[(coarse >= low) & (coarse <= high)]
    else:
        coarse = np.linspace(low, high, max(9, int(np.ceil(_TURN * (high - low) / period)) + 1 if period else 9))
    at = uv[moved, axis]
    fine = np.linspace(low, high, int(np.clip(np.ceil((high - low) / step), 1, _NODES)) + 1)
    if len(at):
        at = np.sort(at)
        k = np.clip(np.searchsorted(at, fine), 1, len(at) - 1) if len(at) > 1 else np.zeros(len(fine), int)
        near = np.minimum(np.abs(fine - at[k - 1]), np.abs(fine - at[k]))
        fine = fine[near <= max(_AROUND * step / _STEP, fine[1] - fine[0])]
    else:
        fine = fine[:0]
    nodes = np.unique(np.concatenate([coarse, fine]))
    # Nodes much closer than their neighbours would make the spline wave.
    least = 0.3 * min(step, float(np.diff(coarse).min()))
    kept = [nodes[0]]
    for x in nodes[1:-1]:
        if x - kept[-1] >= least and nodes[-1] - x >= least:
            kept.append(x)
    return np.array([*kept, nodes[-1]])


def _offset(axes: Sequence[Floats], uv: Floats, off: Floats) -> Floats:
    """Return a bicubic spline fit to offsets at parameters (K, 2), at all pairs of nodes."""
    knots = [np.r_[[x[0]] * 3, x, [x[-1]] * 3] for x in axes]
    data = [BSpline.design_matrix(np.clip(uv[:, a], axes[a][0], axes[a][-1]), knots[a], 3).tocsr() for a in (0, 1)]
    n = [len(k) - 4 for k in knots]
    row, rank = np.repeat(np.arange(len(uv)), 16), data[0].data.reshape(-1, 4)
    columns = (data[0].indices.reshape(-1, 4)[:, :, None] * n[1] + data[1].indices.reshape(-1, 4)[:, None, :]).ravel()
    values = (rank[:, :, None] * data[1].data.reshape(-1, 4)[:, None, :]).ravel()
    rows = csr_matrix((values, (row, columns)), shape=(len(uv), n[0] * n[1]))
    bend = [csr_matrix(np.diff(np.eye(m), 2, axis=0)) for m in n]
    along = kron(bend[0].T @ bend[0], eye(n[1])) + kron(eye(n[0]), bend[1].T @ bend[1])
    normal = (rows.T @ rows).tocsc()
    hold = np.where(normal.diagonal() > 1e-3, _HOLD, _STAY)
    normal = normal + _SMOOTH**2 * along + diags(hold**2)
    solver = splu(normal.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    c = solver.solve(rows.T @ off).reshape(n)
    at = [BSpline.design_matrix(x, k, 3) for x, k in zip(axes, knots, strict=True)]
    return np.asarray(at[0] @ c @ at[1].T.toarray())
