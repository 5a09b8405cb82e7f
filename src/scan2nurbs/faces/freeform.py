"""Tell freeform faces from primitives: pieces that primitives cut from a smooth surface are biased along the borders between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.faces.compete import Sheet, grouped
from scan2nurbs.faces.model_shapes import signed_distances, unit_normals
from scan2nurbs.faces.unite import contacts
from scan2nurbs.kernels.primitives import refine

TURN = 15.0
"""Degrees: pieces of one smooth surface turn by less where they meet."""
BAND = 4
"""Rings of neighbours from a border within which its bias is measured."""
BOTH, EITHER = 0.3, 0.6
"""Bias, in standard deviations, of the less and of the more biased side: more of both and the border is none."""
LEAST_INSIDE = 40


@dataclass(frozen=True)
class Contact:
    """The common border of two labels: points on either side of it."""

    pair: tuple[int, int]
    sides: tuple[NDArray[np.int64], NDArray[np.int64]]


def freeform_groups(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]) -> NDArray[np.int32]:
    """Group the models that are pieces of the same freeform face.

    Parameters
    ----------
    sheet : Sheet
    label : (N,) int32
    models : (M, SIZE) float64

    Returns
    -------
    (M,) int32
        The lowest model of each one's group.

    Notes
    -----
    Each model is fitted anew to its points away from smooth borders. A true surface continues without bias up to its border; a primitive
    that was stretched over a part of something else leaves it on both sides.
    """
    meeting = _smooth_contacts(sheet, label, models)
    bands = [tuple(_rings(sheet, label, side, BAND) for side in contact.sides) for contact in meeting]
    near = np.zeros(len(label), bool)
    for pair in bands:
        for band in pair:
            near[band] = True
    inner = _fit_inside(sheet, label, models, near)
    d = np.full(len(label), np.nan)
    order, starts = grouped(label, len(models))
    for i in range(len(models)):
        mine = order[starts[i] : starts[i + 1]]
        d[mine] = signed_distances(inner[i], sheet.points[mine])
    mean = _smoothed(np.clip(d / sheet.sigma, -5.0, 5.0), label, sheet.neighbours)
    noise = _smoothed(np.random.default_rng(0).normal(size=len(label)), label, sheet.neighbours)
    parent = np.arange(len(models), dtype=np.int32)
    for contact, (left, right) in zip(meeting, bands, strict=True):
        low, high = sorted(_bias(mean[band], noise[band]) for band in (left, right))
        if low > BOTH and high > EITHER:
            a, b = sorted((_root(parent, contact.pair[0]), _root(parent, contact.pair[1])))
            parent[b] = a
    return np.array([_root(parent, i) for i in range(len(models))], np.int32)


def _bias(mean: NDArray[np.float64], noise: NDArray[np.float64]) -> float:
    return float(np.sqrt(max(np.mean(mean**2) - np.mean(noise**2), 0.0)))


def _smooth_contacts(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64]) -> list[Contact]:
    pairs, _, _ = contacts(label, sheet.neighbours)
    order, starts = grouped(label, len(models))
    found = []
    for i, j in pairs:
        sides = []
        for own, other in ((i, j), (j, i)):
            mine = order[starts[own] : starts[own + 1]]
            sides.append(mine[(label[sheet.neighbours[mine]] == other).any(axis=1)].astype(np.int64))
        if min(len(s) for s in sides) < 3:
            continue
        place = sheet.points[np.concatenate(sides)]
        dot = np.abs(np.einsum("ij,ij->i", unit_normals(models[i], place), unit_normals(models[j], place)))
        if np.median(dot) > np.cos(np.radians(TURN)):
            found.append(Contact(pair=(int(i), int(j)), sides=(sides[0], sides[1])))
    return found


def _rings(sheet: Sheet, label: NDArray[np.int32], side: NDArray[np.int64], rings: int) -> NDArray[np.int64]:
    """Return the points of the same label within so many rings of a border's side."""
    own = label[side[0]]
    band = side
    for _ in range(rings - 1):
        wider = np.unique(sheet.neighbours[band])
        band = wider[label[wider] == own].astype(np.int64)
    return band


def _fit_inside(sheet: Sheet, label: NDArray[np.int32], models: NDArray[np.float64], near: NDArray[np.bool_]) -> NDArray[np.float64]:
    order, starts = grouped(label, len(models))
    out = models.copy()
    for i in range(len(models)):
        mine = order[starts[i] : starts[i + 1]]
        inside = mine[~near[mine]]
        if len(inside) >= max(LEAST_INSIDE, 0.25 * len(mine)):
            refine(out[i], sheet.points, inside.astype(np.int32), len(inside), sheet.sigma, 6)
    return out


def _smoothed(values: NDArray[np.float64], label: NDArray[np.int32], neighbours: NDArray[np.int32], rounds: int = 2) -> NDArray[np.float64]:
    """Average values over the neighbours of the same label, ring by ring."""
    same = (label[neighbours] == label[:, None]) & (neighbours >= 0)
    for _ in range(rounds):
        values = (values + np.where(same, values[neighbours], 0.0).sum(axis=1)) / (1 + same.sum(axis=1))
    return values


def _root(parent: NDArray[np.int32], i: int) -> int:
    while parent[i] != i:
        i = int(parent[i])
    return i
