"""Cholesky's method for banded systems, on one thread.

LAPACK's banded solver calls BLAS for every small block; threads of BLAS that wait for each other on a busy machine make it up to
fifty times slower, and its last bits depend on how many there are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel

PADDING = 3
"""Zeros that each row of the band must hold behind its last entry."""


@kernel
def factor_band(band: NDArray[np.float64]) -> int:
    """Factor A = L Lᵀ in place; ``band[k, d]`` holds A[k + d, k], padded by `PADDING` zeros.

    Returns 0, or k + 1 where the k-th pivot is not positive.
    """
    n, width = band.shape[0], band.shape[1] - PADDING - 1
    for k in range(n):
        column = band[k]
        j = max(0, k - width)
        # Four columns at once: the sums stay in the registers, and the padding stands for what the shorter columns lack.
        while j + 4 <= k:
            o = k - j
            a, b, c, d = band[j, o:], band[j + 1, o - 1 :], band[j + 2, o - 2 :], band[j + 3, o - 3 :]
            a0, b0, c0, d0 = a[0], b[0], c[0], d[0]
            for i in range(width - o + 1 + PADDING):
                column[i] -= a0 * a[i] + b0 * b[i] + c0 * c[i] + d0 * d[i]
            j += 4
        while j < k:
            o = k - j
            a = band[j, o:]
            a0 = a[0]
            for i in range(width - o + 1):
                column[i] -= a0 * a[i]
            j += 1
        pivot = column[0]
        if not pivot > 0.0:
            return k + 1
        root = np.sqrt(pivot)
        column[0] = root
        for i in range(1, width + 1):
            column[i] /= root
    return 0


@kernel
def solve_band(factor: NDArray[np.float64], x: NDArray[np.float64]) -> None:
    """Solve L Lᵀ x = b in place, b given in x (n, m), by the factor of `factor_band`."""
    n, width = factor.shape[0], factor.shape[1] - PADDING - 1
    for k in range(n):
        for c in range(x.shape[1]):
            x[k, c] /= factor[k, 0]
        for d in range(1, min(width, n - 1 - k) + 1):
            for c in range(x.shape[1]):
                x[k + d, c] -= factor[k, d] * x[k, c]
    for k in range(n - 1, -1, -1):
        for d in range(1, min(width, n - 1 - k) + 1):
            for c in range(x.shape[1]):
                x[k, c] -= factor[k, d] * x[k + d, c]
        for c in range(x.shape[1]):
            x[k, c] /= factor[k, 0]
