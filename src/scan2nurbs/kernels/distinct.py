"""Which rows of coordinates are the same: a hash table over their bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel


def distinct_rows(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find equal points.

    Parameters
    ----------
    points : (N, 3) float64
        Finite coordinates without −0.0: points are equal where their bits are.

    Returns
    -------
    first : (D,) int64
        The first row of each distinct point, ascending.
    index : (N,) int64
        For each row which of the distinct points it is.

    Notes
    -----
    O(N) time; 24 bytes a point.
    """
    n = len(points)
    slots = np.full(1 << max(n * 2 - 1, 1).bit_length(), -1, np.int32)
    first, index = np.empty(n, np.int64), np.empty(n, np.int64)
    found = _distinct(np.ascontiguousarray(points).view(np.uint64), slots, first, index)
    return first[:found], index


@kernel
def _distinct(bits, slots, first, index):
    mask = np.uint64(len(slots) - 1)
    found = 0
    for i in range(len(bits)):
        a, b, c = bits[i, 0], bits[i, 1], bits[i, 2]
        # Multiplication moves what differs to the high bits (Fibonacci hashing), from where it is brought down.
        h = (a ^ (b * np.uint64(0xBF58476D1CE4E5B9)) ^ (c * np.uint64(0x94D049BB133111EB))) * np.uint64(0x9E3779B97F4A7C15)
        h = (h ^ (h >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
        slot = (h ^ (h >> np.uint64(32))) & mask
        while slots[slot] >= 0:
            k = first[slots[slot]]
            if bits[k, 0] == a and bits[k, 1] == b and bits[k, 2] == c:
                break
            slot = (slot + np.uint64(1)) & mask
        if slots[slot] < 0:
            slots[slot] = found
            first[found] = i
            found += 1
        index[i] = slots[slot]
    return found
