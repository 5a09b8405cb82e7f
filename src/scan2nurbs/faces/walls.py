"""Narrow strips between two faces once more: perhaps a flat wall, part of a plane nearby, or no face at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from scan2nurbs.faces.compete import Sheet
from scan2nurbs.faces.lost import least_squares_plane
from scan2nurbs.faces.model_shapes import field, signed_distances
from scan2nurbs.kernels.gauss_newton import refine
from scan2nurbs.kernels.growth import DISTANCE_CAP
from scan2nurbs.kernels.primitives import CYLINDER, FREEDOM, PATCH, PLANE, TORUS
from scan2nurbs.kernels.refits import PER_PARAMETER
from scan2nurbs.surfaces.shape import Floats

NARROW = 5
"""Strips have at most so many points for each that lies beside either of the two faces: they are about twice as many h wide."""
RINGS = 3
"""Rings of neighbours from a strip within which points may belong to it."""
LEAST = 12
"""Fewer points are no face."""
CLEAR = 3.0
"""Points farther from both faces than so many standard deviations are the strip's for certain."""
PARALLEL = 0.9
"""Cosine between the normals of faces from which on no ball rolls in a corner of theirs, but between them."""
TURNS = 6
"""Steps of a robust fit."""


@dataclass(frozen=True)
class _Strip:
    """A narrow strip and what lies beside it.

    Attributes
    ----------
    face : int
    pair : (int, int)
        The two faces that it lies between.
    planes : list of int
        Further plane faces near it.
    rows : (N,) int64
        Points of the three, those of the strip and those near it.
    beside : (2, N, 4) float64
        Signed distances of these points from the two faces, and their gradients.
    """

    face: int
    pair: tuple[int, int]
    planes: list[int]
    rows: NDArray[np.int64]
    beside: Floats


def straighten(
    sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], kinds: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give narrow strips a plane of their own, or to a plane nearby, or to the two faces beside them, where that explains more for less.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
    models : (M, SIZE) float64
    kinds : (6,) bool
        Kinds that may be chosen.

    Returns
    -------
    label, models : arrays
        Labels keep gaps.

    Notes
    -----
    Two spacings from a crease, normals and curvatures of points are those of both its sides: along the wall of a shallow pocket, or a
    sharp edge beside it, they ask for a thin tube that takes in some of either side. Distances alone tell the tube from the wall: all
    points about the strip go to the nearest of the two faces and what lies between, and what they leave is compared by the criterion of
    Schwarz.
    """
    label, models = label.copy(), models.copy()
    size = np.bincount(label[label >= 0], minlength=len(models))
    for face in 2 * np.argsort(size, kind="stable").tolist():  # twice: what a strip becomes tells of the strip beside it
        strip = _strip(sheet, label, models, face) if size[face] >= LEAST else None
        if strip is None:
            continue
        into, model = _plainest(sheet, models, strip, kinds)
        if into is not None:
            models[face] = model
            _share_out(sheet, label, models, strip, into)
    return label, models


def _strip(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], face: int) -> _Strip | None:
    """Return what lies about a face if it is a narrow strip between two faces with surfaces of their own."""
    mine = np.flatnonzero(label == face)
    near = label[sheet.neighbours[mine]]
    others = np.unique(near[(near >= 0) & (near != face)])
    beside = sorted((-int((near == other).any(axis=1).sum()), other) for other in others.tolist())[:2]
    if len(beside) < 2 or len(mine) > -NARROW * beside[1][0]:
        return None
    i, j = beside[0][1], beside[1][1]
    if PATCH in models[[i, j, face], 0] or _smooth(sheet.points[mine], models[[face, i, j]]):
        return None
    rows = mine
    for _ in range(RINGS):
        rows = np.union1d(rows, sheet.neighbours[rows])
    planes = [int(k) for k in np.setdiff1d(label[rows], (-1, i, j, face)) if int(models[k, 0]) == PLANE]
    rows = rows[np.isin(label[rows], (i, j, face))]
    return _Strip(face, (i, j), planes, rows, np.stack([field(models[other], sheet.points[rows]) for other in (i, j)]))


def _smooth(points: Floats, models: NDArray[np.float64]) -> bool:
    """Tell whether a strip goes on as a curved face beside it does: as the pieces of a freeform face, which are joined later."""
    own, *others = (field(model, points)[:, 1:] for k, model in enumerate(models) if k == 0 or int(model[0]) != PLANE)
    return any(np.abs(np.einsum("ij,ij->i", own, other)).mean() > PARALLEL for other in others)


def _plainest(
    sheet: Sheet, models: NDArray[np.float64], strip: _Strip, kinds: NDArray[np.bool_]
) -> tuple[tuple[int, ...] | None, NDArray[np.float64]]:
    """Return the faces that explain a strip and the points beside it best, and the strip's model; no faces if all stays as it is."""
    points, sigma = sheet.points[strip.rows], sheet.sigma
    own, nearer = models[strip.face], np.abs(strip.beside[..., 0]).min(axis=0)
    clear = np.flatnonzero(nearer > CLEAR * sigma)
    trials = [(strip.pair, own[:0])] + [((*strip.pair, other), models[other]) for other in strip.planes]
    if len(clear) >= LEAST and kinds[PLANE] and int(own[0]) != PLANE:
        trials.append(((*strip.pair, strip.face), _wall(points[clear], sigma)))
    best, chosen, value = None, own, _left(own, strip, points, sigma) + _price(own, strip)
    for faces, model in trials:
        criterion = _left(model, strip, points, sigma) + (_price(model, strip) if strip.face in faces else 0.0)
        if criterion < value:
            best, chosen, value = faces, model if strip.face in faces else own, criterion
    return best, chosen


def _left(model: NDArray[np.float64], strip: _Strip, points: Floats, sigma: float) -> float:
    """Return what a model and the two faces leave of the points about a strip, had these not chosen the nearest by their noise.

    Of two surfaces a gap of g standard deviations apart, the nearer leaves g φ(g / 2) − g² (1 − Φ(g / 2)) / 2 less than a point's own.
    """
    fields = np.concatenate([strip.beside, field(model, points)[None]]) if len(model) else strip.beside
    order = np.argsort(np.abs(fields[..., 0]), axis=0, kind="stable")
    nearest, second = (np.take_along_axis(fields, order[k][None, :, None], axis=0)[0] for k in (0, 1))
    alike = np.einsum("ij,ij->i", nearest[:, 1:], second[:, 1:])
    gap = np.abs(nearest[:, 0] - np.sign(alike) * second[:, 0]) / sigma
    chosen = gap * np.exp(-0.125 * gap**2) / np.sqrt(2.0 * np.pi) - 0.5 * gap**2 * ndtr(-0.5 * gap)
    return float((np.minimum(0.5 * (nearest[:, 0] / sigma) ** 2, DISTANCE_CAP) + np.abs(alike) * chosen).sum())


def _wall(points: Floats, sigma: float) -> NDArray[np.float64]:
    """Return the plane through points that belong to neither of the two faces.

    Those nearer to it than to both faces would turn it: it has points of one face on one side at one end, and of the other at the other.
    """
    wall = least_squares_plane(points)
    refine(wall, points, np.arange(len(points), dtype=np.int32), len(points), sigma, TURNS)
    return wall


def _share_out(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], strip: _Strip, faces: tuple[int, ...]) -> None:
    """Give the points about a strip to the nearest of the faces, in place."""
    d = np.abs([signed_distances(models[face], sheet.points[strip.rows]) for face in faces])
    label[strip.rows] = np.array(faces, np.int32)[np.argmin(d, axis=0)]


def _price(model: NDArray[np.float64], strip: _Strip) -> float:
    """Return what a model's parameters cost; a tube in the corner of two faces has one, its radius, since it touches both."""
    n, kind = len(strip.rows), int(model[0])
    parallel = np.abs(np.einsum("ij,ij->i", strip.beside[0, :, 1:], strip.beside[1, :, 1:])).mean() > PARALLEL
    free = 1 if kind in (CYLINDER, TORUS) and not parallel else FREEDOM[kind]
    return free * (0.5 * np.log(n) + PER_PARAMETER)
