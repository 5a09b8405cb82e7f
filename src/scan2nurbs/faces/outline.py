"""The outline of a face: closed loops around its points in the parameter plane, drawn onto the creases, corners kept."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.edges.polyline import resample
from scan2nurbs.errors import NoResultError, ParameterError
from scan2nurbs.faces.contours import Contour, FaceRaster, trace_contours
from scan2nurbs.faces.crossings import crossing_loops, cut_small_loops
from scan2nurbs.faces.snapping import Creases, snap_contour
from scan2nurbs.ranges import require_float

Array = NDArray[np.float64]

# A bay in the contour drawn far outwards folds; a stiffer contour has no such bay.
_STIFFNESS = (1.0, 2.0, 4.0)
_LEAST_ROWS = 12
# Rows of the longest knot that is cut out of a loop.
_KNOT = 24


@dataclass(frozen=True, kw_only=True)
class OutlineParams:
    """How an outline is drawn; lengths in units of the spacing h.

    Attributes
    ----------
    reach : float, >= 0
        Crease points up to this far outside the points' contour draw the outline onto them.
    corner_angle : float, in (0, 180)
        Turns of at least so many degrees at a point are corners, which stay sharp.
    """

    reach: float = 4.0
    corner_angle: float = 38.0

    def __post_init__(self) -> None:
        require_float(self.reach, "reach", "find_outline", 0.0, closed="low")
        require_float(self.corner_angle, "corner_angle", "find_outline", 0.0, 180.0)


@dataclass(frozen=True)
class OutlineLoop:
    """One loop of an outline, with the face on its left: around the outside counter-clockwise, around a hole clockwise.

    Attributes
    ----------
    points : (K, 2) float64
        In order, about half a spacing apart; the first is not repeated at the end.
    corners : (C,) int64
        Rows of `points` that are sharp corners, where a CAD writer ends one edge and begins the next.
    on_crease : (K,) bool
        Rows that were drawn onto crease points; the others run along the border of the points.
    shift : (2,) float64
        From the first point to the end of the loop: zero, or plus or minus one period for a loop once around a tube.
    """

    points: Array
    corners: NDArray[np.int64]
    on_crease: NDArray[np.bool_]
    shift: Array = field(default_factory=lambda: np.zeros(2))

    @property
    def area(self) -> float:
        """Signed area: positive for an outer loop, negative for a hole, zero for a loop around a tube."""
        return Contour(self.points, self.shift).area


@dataclass(frozen=True)
class Outline:
    """The outline of a face.

    Attributes
    ----------
    loops : tuple of OutlineLoop
        The outer loop first, then the holes by falling size. On a tube the loops around it come first.
    margin : float
        How far outside the points' contour the border was found to lie on average, in local spacings.
    n_points : int
        Points within the outline's component.
    n_left_out : tuple of int
        Points of the separate components that were left out, the largest first.
    n_rough : int
        Loops left as rough contours, because drawn smoothly they would have crossed.
    """

    loops: tuple[OutlineLoop, ...]
    margin: float
    n_points: int
    n_left_out: tuple[int, ...]
    n_rough: int


def find_outline(
    points_uv: Array,
    *,
    spacing: float,
    boundary_uv: Array | None = None,
    period: float | None = None,
    params: OutlineParams | None = None,
) -> Outline:
    """Find the outline of the face that points in a parameter plane sample.

    Parameters
    ----------
    points_uv : (N, 2) float64
        Parameters of the points inside, scaled to lengths on the surface.
    spacing : float
        The noise-stable spacing h, in the same unit.
    boundary_uv : (M, 2) float64, optional
        Points on creases (thinned boundary points) in the same parameters. The outline runs along them where they lie near the
        contour of the points; elsewhere just outside the outermost points.
    period : float, optional
        The period of u on a closed tube.
    params : OutlineParams, optional

    Raises
    ------
    ParameterError
        If an array is not (N, 2) and finite, or spacing or period is out of range.
    NoResultError
        If the points cover no area.

    Notes
    -----
    Gaps narrower than 4 h are no holes, nor are wider ones that random sampling leaves by chance. O(N) on a raster of half a
    spacing, coarser for faces whose bounding box has more than 2^23 such cells. Deterministic, the same for every order of the
    points to rounding; the raster follows the points' principal axes, so that a rigid motion carries the outline along.
    """
    params = params or OutlineParams()
    require_float(float(spacing), "spacing", "find_outline", 0.0)
    points = _checked(points_uv, "points_uv")
    crease = _checked(np.empty((0, 2)) if boundary_uv is None else boundary_uv, "boundary_uv")
    if period is not None:
        require_float(float(period), "period", "find_outline", 8.0 * float(spacing))
    if len(points) < 3:
        raise NoResultError(f"An outline needs at least 3 points. Got {len(points)} instead.")
    frame, origin = _frame(points, period)
    points, crease = (points - origin) @ frame, (crease - origin) @ frame
    if period is not None:
        points, crease = _wrapped(points, crease, period, params.reach * spacing)
    face = trace_contours(points, float(spacing), period)
    if not face.contours:
        raise NoResultError("The points cover no area that an outline could go around.")
    loops, n_rough = _draw_loops(face, crease, float(spacing), period, params)
    back = tuple(OutlineLoop(loop.points @ frame.T + origin, loop.corners, loop.on_crease, loop.shift @ frame.T) for loop in loops)
    return Outline(back, face.margin, face.n_points, face.n_left_out, n_rough)


def _checked(points: Array, name: str) -> Array:
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ParameterError(f"The '{name}' parameter of find_outline must be a finite (N, 2) array. Got the shape {points.shape} instead.")
    return points


def _frame(points: Array, period: float | None) -> tuple[Array, Array]:
    """Return a rotation whose columns are the points' principal axes, and the mean; a periodic u must stay the first axis."""
    if period is not None:
        return np.eye(2), np.zeros(2)
    mean = points.mean(axis=0)
    relative = points - mean
    axis = np.linalg.eigh(relative.T @ relative)[1][:, 1]
    if ((relative @ axis) ** 3).sum() < 0.0:
        axis = -axis
    return np.array([[axis[0], -axis[1]], [axis[1], axis[0]]]), mean


def _wrapped(points: Array, crease: Array, period: float, reach: float) -> tuple[Array, Array]:
    """Bring u into [0, period); crease points near the seam count on both sides of it."""
    points, crease = points.copy(), crease.copy()
    points[:, 0] %= period
    points[points[:, 0] >= period, 0] = 0.0
    crease[:, 0] %= period
    turns = [crease + np.array([turn * period, 0.0]) for turn in (-1, 0, 1, 2)]
    return points, np.concatenate(turns)


def _draw_loops(face: FaceRaster, crease: Array, h: float, period: float | None, params: OutlineParams) -> tuple[list[OutlineLoop], int]:
    """Draw all loops, more stiffly where they cross, and as rough contours where they still do: those of a raster never cross."""
    attempt = np.zeros(len(face.contours), np.int64)
    loops = [_draw_loop(contour, face, crease, h, params, _STIFFNESS[0]) for contour in face.contours]
    while True:
        closed = [np.concatenate([loop.points, loop.points[:1] + loop.shift]) for loop in loops]
        worse = np.flatnonzero(crossing_loops(closed, period) & (attempt < len(_STIFFNESS)))
        if len(worse) == 0:
            return loops, int(np.count_nonzero(attempt == len(_STIFFNESS)))
        attempt[worse] += 1
        for i in worse:
            contour = face.contours[i]
            if attempt[i] < len(_STIFFNESS):
                loops[i] = _draw_loop(contour, face, crease, h, params, _STIFFNESS[attempt[i]])
            else:
                loops[i] = _rough_loop(contour, contour.points)


def _draw_loop(contour: Contour, face: FaceRaster, crease: Array, h: float, params: OutlineParams, stiffness: float) -> OutlineLoop:
    rough = resample(contour.points, 0.5 * h, closed=True, shift=contour.shift)
    if len(rough) < _LEAST_ROWS:
        return _rough_loop(contour, rough)
    points, corners, covered = snap_contour(
        rough,
        contour.shift,
        h=h,
        margin=face.margin * face.spacing_at(rough),
        creases=Creases(crease, params.reach * h),
        corner_angle=params.corner_angle,
        stiffness=stiffness,
    )
    # Sides drawn past each other at a blunt corner tie small knots.
    points, corners, covered = cut_small_loops(points, corners, covered, contour.shift, longest=_KNOT)
    return OutlineLoop(points, corners, covered, contour.shift)


def _rough_loop(contour: Contour, points: Array) -> OutlineLoop:
    return OutlineLoop(points, np.empty(0, np.int64), np.zeros(len(points), np.bool_), contour.shift)
