"""The CAD kernel behind one door: silencing, the lock, its errors, and conversions between its objects and arrays.

Nothing here imports OCP when the module is imported: the kernel takes a second to load, and most commands never need it.

Notes
-----
Three habits of the kernel are dealt with here. It prints on standard output (`silence`). Its translators keep their settings in
process-wide statics (`EXPORT_LOCK`). Its exceptions have no common base class in Python (`kernel_errors`).
"""

# The kernel's modules are filled when they are imported; a type checker sees them empty.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.errors import NoResultError
from scan2nurbs.surfaces.bspline import BSplineSurface

CONFUSION = 1e-7
"""The length below which the kernel takes two points for one, in the numbers it is given (Precision::Confusion)."""

EXPORT_LOCK = threading.RLock()
"""Held while a CAD file is read or written: ``Interface_Static`` is global to the process and not safe in threads."""


class KernelError(NoResultError):
    """The CAD kernel refused an operation (exit code 4)."""


def silence() -> None:
    """Stop the kernel from printing on standard output, for the life of the process. May be called any number of times."""
    from OCP.Message import Message

    printers = Message.DefaultMessenger_s().ChangePrinters()
    if list(printers):
        printers.Clear()


@contextmanager
def kernel_errors(what: str) -> Iterator[None]:
    """Turn any exception of the kernel into a `KernelError` that says what was tried.

    Parameters
    ----------
    what : str
        The operation, to complete "The CAD kernel could not ...".
    """
    try:
        yield
    except Exception as error:
        # The kernel's exceptions derive from Exception one by one, without a base of their own; only their module tells.
        if type(error).__module__.split(".")[0] != "OCP":
            raise
        raise KernelError(f"The CAD kernel could not {what}: {error or type(error).__name__}.") from error


def to_points(points: NDArray[np.float64]) -> Any:
    """Return (N, 3) or (N, 2) points as the kernel's array of points, counted from one."""
    from OCP.collections import Array1_gp_Pnt, Array1_gp_Pnt2d
    from OCP.gp import gp_Pnt, gp_Pnt2d

    kind, make = (Array1_gp_Pnt, gp_Pnt) if points.shape[1] == 3 else (Array1_gp_Pnt2d, gp_Pnt2d)
    array = kind(1, len(points))
    for i, row in enumerate(points.tolist(), start=1):
        array.SetValue(i, make(*row))
    return array


def to_reals(values: NDArray[np.float64]) -> Any:
    """Return (N,) numbers as the kernel's array of reals, counted from one."""
    from OCP.collections import Array1_double

    array = Array1_double(1, len(values))
    for i, value in enumerate(np.asarray(values, np.float64).tolist(), start=1):
        array.SetValue(i, value)
    return array


def to_knots(knots: NDArray[np.float64]) -> tuple[Any, Any]:
    """Return a full knot vector as the kernel's pair of distinct knots and their multiplicities."""
    from OCP.collections import Array1_int

    distinct, counts = np.unique(knots, return_counts=True)
    multiplicities = Array1_int(1, len(counts))
    for i, count in enumerate(counts.tolist(), start=1):
        multiplicities.SetValue(i, count)
    return to_reals(distinct), multiplicities


def to_surface(surface: BSplineSurface, *, scale: float = 1.0, offset: NDArray[np.float64] | None = None) -> Any:
    """Return the surface as a ``Geom_BSplineSurface``, its control points times `scale` plus `offset`.

    Raises
    ------
    KernelError
        If the kernel does not accept the surface: a knot vector that is not clamped, a degree above 25, weights that are not positive.
    """
    from OCP.collections import Array2_double, Array2_gp_Pnt
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt

    points = surface.control_points * scale + (0.0 if offset is None else offset)
    n_u, n_v = points.shape[:2]
    poles, weights = Array2_gp_Pnt(1, n_u, 1, n_v), Array2_double(1, n_u, 1, n_v)
    for i, (row, row_weights) in enumerate(zip(points.tolist(), surface.weights.tolist(), strict=True), start=1):
        for j, (point, weight) in enumerate(zip(row, row_weights, strict=True), start=1):
            poles.SetValue(i, j, gp_Pnt(*point))
            weights.SetValue(i, j, weight)
    (u_knots, u_mults), (v_knots, v_mults) = (to_knots(knots) for knots in surface.knots)
    rational = () if np.all(surface.weights == surface.weights.flat[0]) else (weights,)
    with kernel_errors("make a B-spline surface"):
        return Geom_BSplineSurface(poles, *rational, u_knots, v_knots, u_mults, v_mults, *surface.degrees)


def from_surface(surface: Any) -> BSplineSurface:
    """Return a ``Geom_BSplineSurface`` as arrays; a periodic one is cut open at its seam first."""
    if surface.IsUPeriodic() or surface.IsVPeriodic():
        surface = surface.Copy()
        # Unlike SetUNotPeriodic, this leaves clamped knots.
        surface.Segment(*surface.Bounds())
    n_u, n_v = surface.NbUPoles(), surface.NbVPoles()
    points, weights = np.empty((n_u, n_v, 3)), np.ones((n_u, n_v))
    for i in range(n_u):
        for j in range(n_v):
            pole = surface.Pole(i + 1, j + 1)
            points[i, j] = pole.X(), pole.Y(), pole.Z()
            weights[i, j] = surface.Weight(i + 1, j + 1)
    gaps = np.abs(points[0] - points[-1]).max(), np.abs(points[:, 0] - points[:, -1]).max()
    extent = np.ptp(points.reshape(-1, 3), axis=0).max()
    return BSplineSurface(
        degrees=(surface.UDegree(), surface.VDegree()),
        knots=(np.array(list(surface.UKnotSequence())), np.array(list(surface.VKnotSequence()))),
        control_points=points,
        weights=weights,
        closed=(bool(gaps[0] <= 1e-9 * extent), bool(gaps[1] <= 1e-9 * extent)),
    )
