"""The wedge of two half-planes that fits the neighbourhood of a point best, and the crease where they meet.

A neighbourhood is split by planes of many directions and three offsets; the split whose two halves lie flattest starts an
alternation: planes are fitted to the halves, their intersection line and the half-planes' directions give the next split.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.cells import Cells, points_in_box, runs_in_box
from scan2nurbs.kernels.runner import kernel, run_ranges
from scan2nurbs.kernels.symmetric3 import plane_of_moments

POINTS_PER_RANGE = 512
# Fewer points than this do not make half a wedge.
LEAST = 6
ALTERNATIONS = 6
# Noise about one plane splits into two layers that are flatter than the plane (variance 1 - 2/pi of it): no wedge is meant.
LAYERS = 3.0
# A neighbourhood whose variance along its normal is less than this, in squared radii, is no knife edge.
THICK = 0.02


class Wedges(NamedTuple):
    """The best wedge at each query point; NaN where there is none.

    Attributes
    ----------
    foot : (M, 3) float64
        The point of the crease nearest to the query point.
    direction : (M, 3) float64
        Unit direction of the crease; the sign carries no meaning.
    angle : (M,) float64
        Angle between the two planes' normals in radians: 0 where the faces run on smoothly.
    wedge_rms : (M,) float64
        Weighted root mean square distance of the neighbourhood from the wedge.
    quadric_rms : (M,) float64
        The same from the best quadric height field.
    n_points : (M,) int32
        Points of the smaller half.
    """

    foot: NDArray[np.float64]
    direction: NDArray[np.float64]
    angle: NDArray[np.float64]
    wedge_rms: NDArray[np.float64]
    quadric_rms: NDArray[np.float64]
    n_points: NDArray[np.int32]


def fit_wedges(cells: Cells, queries: NDArray[np.float64], radius: float, noise: float, *, rounds: int = 1) -> Wedges:
    """Fit two half-planes to the points closer than `radius` to each query point.

    Parameters
    ----------
    cells : Cells
        The whole cloud, sorted.
    queries : (M, 3) float64
        Where to fit.
    radius : float
        In the points' unit.
    noise : float
        Standard deviation of the points across the surface; residuals beyond about 2.5 of it lose weight.
    rounds : int
        How often to fit; each round takes the points about the foot point that the last one found.

    Notes
    -----
    About 50 µs a query at fifty neighbours; no neighbour is kept beyond its query.
    """
    m = len(queries)
    result = Wedges(
        np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.full(m, np.nan), np.full(m, np.nan), np.full(m, np.nan), np.zeros(m, np.int32)
    )
    splits = _split_directions()
    run_ranges(
        lambda start, stop: _fit_wedges(cells, queries, float(radius), float(noise), rounds, splits, start, stop, *result),
        m,
        size=POINTS_PER_RANGE,
    )
    return result


def _split_directions() -> NDArray[np.float64]:
    """Return unit vectors over a half-sphere whose pole is the normal; flat wedges split along the plane, knife edges along the normal."""
    vectors = [(np.cos(a), np.sin(a), 0.0) for a in np.pi * np.arange(12) / 12]
    vectors += [(np.cos(a) * np.sqrt(0.5), np.sin(a) * np.sqrt(0.5), np.sqrt(0.5)) for a in np.pi * np.arange(6) / 3]
    return np.array([*vectors, (0.0, 0.0, 1.0)])


@kernel
def _fit_wedges(cells, queries, radius, noise, rounds, splits, start, stop, foot, direction, angle, wedge_rms, quadric_rms, count):
    low, high = np.empty(3), np.empty(3)
    runs = np.empty((64, 2), np.int64)
    indices = np.empty(1024, np.int64)
    q = np.empty((1024, 3))
    weight = np.empty(1024)
    planes = np.empty((2, 11))
    line = np.empty(13)
    centre = np.empty(3)
    for i in range(start, stop):
        centre[:] = queries[i]
        found, n = 0, 0
        for step in range(rounds):
            for k in range(3):
                low[k], high[k] = centre[k] - radius, centre[k] + radius
            runs, n_runs, room = runs_in_box(cells, low, high, runs)
            if room > len(indices):
                indices, q, weight = np.empty(2 * room, np.int64), np.empty((2 * room, 3)), np.empty(2 * room)
            n = points_in_box(cells.points, runs, n_runs, low, high, indices)
            n = _gather(cells.points, indices, n, centre, radius, q, weight)
            found = 0
            if n >= 2 * LEAST and (step > 0 or _best_split(q, weight, n, splits, planes)):
                found = _alternate(q, weight, n, noise / radius, planes, line)
            if found == 0:
                break
            if step + 1 < rounds:
                # The next round begins with these planes, seen from the foot point.
                for k in range(3):
                    centre[k] += radius * line[k]
                    planes[0, 6 + k] -= line[k]
                    planes[1, 6 + k] -= line[k]
        if found == 0:
            continue
        for k in range(3):
            foot[i, k] = centre[k] + radius * line[k]
            direction[i, k] = line[3 + k]
        angle[i] = line[12]
        count[i] = found
        wedge_rms[i] = radius * _wedge_rms(q, weight, n, planes, line)
        quadric_rms[i] = radius * _quadric_rms(q, weight, n)


@kernel
def _gather(points, indices, n, centre, radius, q, weight):
    """Take the points of the ball, relative to its centre and in units of its radius, with weights that fall to the rim."""
    m = 0
    for j in range(n):
        square = 0.0
        for k in range(3):
            q[m, k] = (points[indices[j], k] - centre[k]) / radius
            square += q[m, k] * q[m, k]
        if square < 1.0:
            weight[m] = 1.0 - square
            m += 1
    return m


@kernel
def _add(sums, w, x, y, z):
    sums[0] += w * x
    sums[1] += w * y
    sums[2] += w * z
    sums[3] += w * x * x
    sums[4] += w * x * y
    sums[5] += w * x * z
    sums[6] += w * y * y
    sums[7] += w * y * z
    sums[8] += w * z * z


@kernel
def _fit(sums, mass, number, plane):
    """Fit a plane to weighted sums scaled to the number of their points; tell whether it could be."""
    if number < LEAST or not mass > 0.0:
        return False
    scaled = sums * (number / mass)
    return plane_of_moments(float(number), scaled, plane)


@kernel
def _best_split(q, weight, n, splits, planes):
    """Find the split of the ball whose two halves lie flattest; fill their planes."""
    sums, whole = np.zeros(9), np.empty(11)
    mass = 0.0
    for j in range(n):
        _add(sums, weight[j], q[j, 0], q[j, 1], q[j, 2])
        mass += weight[j]
    if not _fit(sums, mass, n, whole):
        return False
    across = np.cross(whole[0:3], whole[3:6])
    trial = np.empty((2, 11))
    part, part_mass, part_number = np.zeros((4, 9)), np.zeros(4), np.zeros(4, np.int64)
    side, side_mass, side_number = np.zeros((2, 9)), np.zeros(2), np.zeros(2, np.int64)
    best = np.inf
    for s in range(len(splits)):
        if splits[s, 2] > 0.0 and whole[9] < THICK:
            continue
        m = splits[s, 0] * whole[3:6] + splits[s, 1] * across + splits[s, 2] * whole[0:3]
        part[:], part_mass[:], part_number[:] = 0.0, 0.0, 0
        for j in range(n):
            d = m[0] * q[j, 0] + m[1] * q[j, 1] + m[2] * q[j, 2]
            b = (0 if d < -0.35 else 1) if d < 0.0 else (2 if d < 0.35 else 3)
            _add(part[b], weight[j], q[j, 0], q[j, 1], q[j, 2])
            part_mass[b] += weight[j]
            part_number[b] += 1
        for cut in range(1, 4):
            side[:], side_mass[:], side_number[:] = 0.0, 0.0, 0
            for b in range(4):
                a = 0 if b < cut else 1
                side[a] += part[b]
                side_mass[a] += part_mass[b]
                side_number[a] += part_number[b]
            if _fit(side[0], side_mass[0], side_number[0], trial[0]) and _fit(side[1], side_mass[1], side_number[1], trial[1]):
                residual = (side_mass[0] * trial[0, 9] + side_mass[1] * trial[1, 9]) * (1.0 + LAYERS * splits[s, 2] ** 2)
                if residual < best:
                    best = residual
                    planes[:] = trial
    return best < np.inf


@kernel
def _meet(planes, line):
    """Intersect two planes: foot point nearest to zero, direction, and the two half-planes' directions; False where parallel."""
    n1, n2 = planes[0, 0:3], planes[1, 0:3]
    t = np.cross(n1, n2)
    sine = np.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
    if sine < 1e-3:
        return False
    t /= sine
    d1 = n1[0] * planes[0, 6] + n1[1] * planes[0, 7] + n1[2] * planes[0, 8]
    d2 = n2[0] * planes[1, 6] + n2[1] * planes[1, 7] + n2[2] * planes[1, 8]
    c = n1[0] * n2[0] + n1[1] * n2[1] + n1[2] * n2[2]
    a, b = (d1 - c * d2) / (sine * sine), (d2 - c * d1) / (sine * sine)
    for k in range(3):
        line[k] = a * n1[k] + b * n2[k]
        line[3 + k] = t[k]
    for p in range(2):
        along, size = 0.0, 0.0
        for k in range(3):
            along += (planes[p, 6 + k] - line[k]) * t[k]
        for k in range(3):
            line[6 + 3 * p + k] = planes[p, 6 + k] - line[k] - along * t[k]
            size += line[6 + 3 * p + k] ** 2
        if not size > 0.0:
            return False
        for k in range(3):
            line[6 + 3 * p + k] /= np.sqrt(size)
    # Folding one half-plane onto the other's extension turns by the angle between w1 and −w2.
    cosine = -(line[6] * line[9] + line[7] * line[10] + line[8] * line[11])
    line[12] = np.arccos(min(max(cosine, -1.0), 1.0))
    return True


@kernel
def _side(q, j, line):
    """Return 0 or 1: the half-plane on whose side of the bisecting plane a point lies."""
    d = 0.0
    for k in range(3):
        d += (q[j, k] - line[k]) * (line[6 + k] - line[9 + k])
    return 0 if d > 0.0 else 1


@kernel
def _distance(q, j, plane):
    return (q[j, 0] - plane[6]) * plane[0] + (q[j, 1] - plane[7]) * plane[1] + (q[j, 2] - plane[8]) * plane[2]


@kernel
def _alternate(q, weight, n, noise, planes, line):
    """Alternate between assigning points to half-planes and fitting these; return the points of the smaller half, 0 for failure."""
    side, mass, number = np.empty((2, 9)), np.empty(2), np.empty(2, np.int64)
    if not _meet(planes, line):
        return 0
    for _ in range(ALTERNATIONS):
        total, spread = 0.0, 0.0
        for j in range(n):
            total += weight[j]
            spread += weight[j] * abs(_distance(q, j, planes[_side(q, j, line)]))
        # 1.25 mean deviations are a standard deviation; points of a third face lie beyond a few of them and lose their weight.
        scale = 2.5 * max(noise, 1.25 * spread / total, 1e-9)
        side[:], mass[:], number[:] = 0.0, 0.0, 0
        for j in range(n):
            a = _side(q, j, line)
            ratio = _distance(q, j, planes[a]) / scale
            w = weight[j] / (1.0 + ratio * ratio) ** 2
            _add(side[a], w, q[j, 0], q[j, 1], q[j, 2])
            mass[a] += w
            number[a] += 1
        if not (_fit(side[0], mass[0], number[0], planes[0]) and _fit(side[1], mass[1], number[1], planes[1])):
            return 0
        if not _meet(planes, line):
            return 0
    return min(number[0], number[1])


@kernel
def _wedge_rms(q, weight, n, planes, line):
    total, mass = 0.0, 0.0
    for j in range(n):
        total += weight[j] * _distance(q, j, planes[_side(q, j, line)]) ** 2
        mass += weight[j]
    return np.sqrt(total / mass)


@kernel
def _quadric_rms(q, weight, n):
    """Fit z = a + bx + cy + dxx + exy + fyy in the frame of the ball's plane; return the weighted rms residual."""
    sums, whole = np.zeros(9), np.empty(11)
    mass = 0.0
    for j in range(n):
        _add(sums, weight[j], q[j, 0], q[j, 1], q[j, 2])
        mass += weight[j]
    if not _fit(sums, mass, n, whole):
        return np.nan
    across = np.cross(whole[0:3], whole[3:6])
    # Normal equations of seven columns, the last one z: after elimination its corner holds the residual sum of squares.
    A, row = np.zeros((7, 7)), np.empty(7)
    for j in range(n):
        x = q[j, 0] * whole[3] + q[j, 1] * whole[4] + q[j, 2] * whole[5]
        y = q[j, 0] * across[0] + q[j, 1] * across[1] + q[j, 2] * across[2]
        z = _distance(q, j, whole)
        row[0], row[1], row[2], row[3], row[4], row[5], row[6] = 1.0, x, y, x * x, x * y, y * y, z
        for a in range(7):
            for b in range(a, 7):
                A[a, b] += weight[j] * row[a] * row[b]
    for p in range(6):
        if not A[p, p] > 1e-12 * mass:
            continue
        for a in range(p + 1, 7):
            f = A[p, a] / A[p, p]
            for b in range(a, 7):
                A[a, b] -= f * A[p, b]
    return np.sqrt(max(A[6, 6], 0.0) / mass)
