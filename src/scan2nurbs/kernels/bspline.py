"""Tensor-product B-splines at scattered parameters: values, derivatives, normal equations, foot points.

Everything works on a *local* basis: at u only the degree + 1 functions of its knot span differ from zero. A closed direction uses an
unclamped periodic knot vector; function i then belongs to coefficient i mod n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel

MAX_DEGREE = 15
_SIZE = MAX_DEGREE + 1


@kernel
def find_span(knots: NDArray[np.float64], degree: int, u: float) -> int:
    """Return the span s with knots[s] ≤ u < knots[s + 1], the last non-empty one at the end (The NURBS Book, A2.1)."""
    low, high = degree, len(knots) - degree - 1
    while high - low > 1:
        middle = (low + high) // 2
        if u < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def _raise_derivative(knots: NDArray[np.float64], span: int, degree: int, lower: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Turn the values of degree − 1 functions into derivatives of degree functions (The NURBS Book, eq. 2.7), in place or not."""
    left = 0.0
    for a in range(degree + 1):
        i = span - degree + a
        right = 0.0
        if a < degree:
            right = lower[a] / (knots[i + degree + 1] - knots[i + 1])
        out[a] = degree * (left - right)
        left = right


@kernel
def basis(knots: NDArray[np.float64], degree: int, span: int, u: float, order: int, out: NDArray[np.float64]) -> None:
    """Write the functions of a span and their derivatives up to `order` ≤ 2 into out[order, degree + 1] (The NURBS Book, A2.2)."""
    n = out[0]
    for k in range(order + 1):
        out[k, : degree + 1] = 0.0
    n[0] = 1.0
    if order >= 1 and degree == 1:
        out[1, 0] = 1.0
    if order >= 2 and degree == 2:
        out[2, 0] = 1.0
    for j in range(1, degree + 1):
        saved = 0.0
        for r in range(j):
            right = knots[span + r + 1]
            left = knots[span + 1 - j + r]
            ratio = n[r] / (right - left)
            n[r] = saved + (right - u) * ratio
            saved = (u - left) * ratio
        n[j] = saved
        # Functions of lower degree are what derivatives are made of.
        if order >= 1 and j == degree - 1:
            out[1, :degree] = n[:degree]
        if order >= 2 and j == degree - 2:
            out[2, : degree - 1] = n[: degree - 1]
    if order >= 1:
        _raise_derivative(knots, span, degree, out[1], out[1])
    if order >= 2 and degree >= 2:
        _raise_derivative(knots, span, degree - 1, out[2], out[2])
        _raise_derivative(knots, span, degree, out[2], out[2])


@kernel
def basis_range(
    knots: NDArray[np.float64],
    degree: int,
    u: NDArray[np.float64],
    order: int,
    start: int,
    stop: int,
    spans: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    """Write the span (N,) and the local functions (N, order + 1, degree + 1) of parameters."""
    for k in range(start, stop):
        spans[k] = find_span(knots, degree, u[k])
        basis(knots, degree, spans[k], u[k], order, out[k])


@kernel
def _combine(
    control: NDArray[np.float64],
    i0: int,
    j0: int,
    p: int,
    q: int,
    bu: NDArray[np.float64],
    bv: NDArray[np.float64],
    order: int,
    out: NDArray[np.float64],
) -> None:
    """Write S, Su, Sv, Suu, Suv, Svv (as many as `order` has) into out[6, dimension]."""
    n_u, n_v, dimension = control.shape
    for c in range(dimension):
        for k in range(out.shape[0]):
            out[k, c] = 0.0
        for a in range(p + 1):
            i = (i0 + a) % n_u
            s0, s1, s2 = 0.0, 0.0, 0.0
            for b in range(q + 1):
                x = control[i, (j0 + b) % n_v, c]
                s0 += bv[0, b] * x
                if order >= 1:
                    s1 += bv[1, b] * x
                if order >= 2:
                    s2 += bv[2, b] * x
            out[0, c] += bu[0, a] * s0
            if order >= 1:
                out[1, c] += bu[1, a] * s0
                out[2, c] += bu[0, a] * s1
            if order >= 2:
                out[3, c] += bu[2, a] * s0
                out[4, c] += bu[1, a] * s1
                out[5, c] += bu[0, a] * s2


@kernel
def evaluate_range(
    knots_u: NDArray[np.float64],
    knots_v: NDArray[np.float64],
    p: int,
    q: int,
    control: NDArray[np.float64],
    uv: NDArray[np.float64],
    order: int,
    start: int,
    stop: int,
    out: NDArray[np.float64],
) -> None:
    """Write S and its derivatives at uv[start:stop] into out (N, 1 | 3 | 6, dimension)."""
    bu = np.zeros((3, _SIZE))
    bv = np.zeros((3, _SIZE))
    for k in range(start, stop):
        su = find_span(knots_u, p, uv[k, 0])
        sv = find_span(knots_v, q, uv[k, 1])
        basis(knots_u, p, su, uv[k, 0], order, bu)
        basis(knots_v, q, sv, uv[k, 1], order, bv)
        _combine(control, su - p, sv - q, p, q, bu, bv, order, out[k])


@kernel
def normal_equations_range(
    knots_u: NDArray[np.float64],
    knots_v: NDArray[np.float64],
    p: int,
    q: int,
    uv: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    start: int,
    stop: int,
    matrix: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """Add BᵀWB and BᵀWX of points[start:stop] to a banded tensor and a right-hand side.

    ``matrix[i, j, a, q + b]`` couples the coefficients (i, j) and (i + a, j + b); a ≥ 0 only, since the matrix is symmetric.
    """
    n_u, n_v = right.shape[0], right.shape[1]
    bu = np.zeros((1, _SIZE))
    bv = np.zeros((1, _SIZE))
    for k in range(start, stop):
        w = weights[k]
        if w == 0.0:
            continue
        su = find_span(knots_u, p, uv[k, 0])
        sv = find_span(knots_v, q, uv[k, 1])
        basis(knots_u, p, su, uv[k, 0], 0, bu)
        basis(knots_v, q, sv, uv[k, 1], 0, bv)
        for a in range(p + 1):
            i = (su - p + a) % n_u
            for b in range(q + 1):
                j = (sv - q + b) % n_v
                value = w * bu[0, a] * bv[0, b]
                for c in range(3):
                    right[i, j, c] += value * points[k, c]
                for a2 in range(a, p + 1):
                    product = value * bu[0, a2]
                    row = matrix[i, j, a2 - a]
                    for b2 in range(q + 1):
                        row[q + b2 - b] += product * bv[0, b2]


@kernel
def _step(d: NDArray[np.float64], rx: float, ry: float, rz: float, lock_u: bool, lock_v: bool) -> tuple[float, float]:
    """Return the Newton step of half the squared distance; Gauss-Newton where its matrix is not positive definite."""
    gu = rx * d[1, 0] + ry * d[1, 1] + rz * d[1, 2]
    gv = rx * d[2, 0] + ry * d[2, 1] + rz * d[2, 2]
    a = d[1, 0] ** 2 + d[1, 1] ** 2 + d[1, 2] ** 2
    b = d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
    c = d[2, 0] ** 2 + d[2, 1] ** 2 + d[2, 2] ** 2
    fa = a + rx * d[3, 0] + ry * d[3, 1] + rz * d[3, 2]
    fb = b + rx * d[4, 0] + ry * d[4, 1] + rz * d[4, 2]
    fc = c + rx * d[5, 0] + ry * d[5, 1] + rz * d[5, 2]
    # Close to a focal point Newton's matrix loses its sign long before Gauss-Newton's loses its rank.
    if fa > 0.1 * a and fc > 0.1 * c and fa * fc - fb * fb > 0.1 * (a * c - b * b):
        a, b, c = fa, fb, fc
    if lock_u and lock_v:
        return 0.0, 0.0
    if lock_u:
        return 0.0, (-gv / c if c > 0.0 else 0.0)
    if lock_v:
        return (-gu / a if a > 0.0 else 0.0), 0.0
    determinant = a * c - b * b
    if not determinant > 1e-14 * a * c:
        return (-gu / a if a > 0.0 else 0.0), 0.0
    return (b * gv - c * gu) / determinant, (b * gu - a * gv) / determinant


@kernel
def _into(x: float, low: float, high: float, closed: bool) -> float:
    if closed:
        return low + (x - low) % (high - low)
    return min(max(x, low), high)


@kernel
def foot_points_range(
    knots_u: NDArray[np.float64],
    knots_v: NDArray[np.float64],
    p: int,
    q: int,
    closed_u: bool,
    closed_v: bool,
    control: NDArray[np.float64],
    points: NDArray[np.float64],
    steps: int,
    reach: float,
    start: int,
    stop: int,
    uv: NDArray[np.float64],
    residuals: NDArray[np.float64],
) -> None:
    """Move uv[start:stop] to the foot points, and write the signed distances along the normal Su × Sv.

    Damped Newton on the squared distance, within the rectangle of the parameters; no step is longer than `reach` in u or v, none
    that increases the distance is taken. ``residuals[k, 0]`` is the distance along the normal, ``residuals[k, 1]`` the whole one.
    """
    bu = np.zeros((3, _SIZE))
    bv = np.zeros((3, _SIZE))
    d = np.zeros((6, 3))
    low_u, high_u = knots_u[p], knots_u[len(knots_u) - p - 1]
    low_v, high_v = knots_v[q], knots_v[len(knots_v) - q - 1]
    for k in range(start, stop):
        u = _into(uv[k, 0], low_u, high_u, closed_u)
        v = _into(uv[k, 1], low_v, high_v, closed_v)
        best_u, best_v, best = u, v, np.inf
        du, dv, damping = 0.0, 0.0, 1.0
        for _ in range(steps + 1):
            su = find_span(knots_u, p, u)
            sv = find_span(knots_v, q, v)
            basis(knots_u, p, su, u, 2, bu)
            basis(knots_v, q, sv, v, 2, bv)
            _combine(control, su - p, sv - q, p, q, bu, bv, 2, d)
            rx, ry, rz = d[0, 0] - points[k, 0], d[0, 1] - points[k, 1], d[0, 2] - points[k, 2]
            distance = rx * rx + ry * ry + rz * rz
            if distance < best or best == np.inf:
                best_u, best_v, best, damping = u, v, distance, 1.0
                nx = d[1, 1] * d[2, 2] - d[1, 2] * d[2, 1]
                ny = d[1, 2] * d[2, 0] - d[1, 0] * d[2, 2]
                nz = d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0]
                norm = np.sqrt(nx * nx + ny * ny + nz * nz)
                residuals[k, 0] = -(rx * nx + ry * ny + rz * nz) / norm if norm > 0.0 else 0.0
                residuals[k, 1] = np.sqrt(distance)
                du, dv = _step(d, rx, ry, rz, False, False)
                lock_u = not closed_u and ((u <= low_u and du < 0.0) or (u >= high_u and du > 0.0))
                lock_v = not closed_v and ((v <= low_v and dv < 0.0) or (v >= high_v and dv > 0.0))
                if lock_u or lock_v:
                    du, dv = _step(d, rx, ry, rz, lock_u, lock_v)
            else:
                damping *= 0.25
            longest = max(abs(du), abs(dv))
            if longest * damping < 1e-8 * (high_u - low_u + high_v - low_v):
                break
            scale = damping * min(1.0, reach / longest)
            u = _into(best_u + scale * du, low_u, high_u, closed_u)
            v = _into(best_v + scale * dv, low_v, high_v, closed_v)
        uv[k, 0], uv[k, 1] = best_u, best_v
