"""Which rows of coordinates are the same: hash tables over their bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import inlined, kernel, run_ranges

_PARTS = 4


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
    O(N) time. A table of bits finds the few rows that may have an equal; only these are compared.
    """
    n = len(points)
    bits = np.ascontiguousarray(points).view(np.uint64)
    crowded = np.empty(n, np.bool_)
    run_ranges(lambda start, _: _crowded(bits, start, crowded), _PARTS, size=1)
    rows = np.flatnonzero(crowded)
    slots = np.full(1 << max(len(rows) * 2 - 1, 1).bit_length(), -1, np.int32)
    same = _first_rows(bits, rows, slots)
    again = rows != same
    if not again.any():
        return np.arange(n), np.arange(n)
    new = np.ones(n, np.bool_)
    new[rows[again]] = False
    index = np.cumsum(new) - 1
    index[rows[again]] = index[same[again]]
    return np.flatnonzero(new), index


@inlined
def _hash(a, b, c):
    # Multiplication moves what differs to the high bits (Fibonacci hashing), from where it is brought down.
    h = (a ^ (b * np.uint64(0xBF58476D1CE4E5B9)) ^ (c * np.uint64(0x94D049BB133111EB))) * np.uint64(0x9E3779B97F4A7C15)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    return h ^ (h >> np.uint64(32))


@kernel
def _crowded(bits, part, crowded):
    """Mark the rows of one part of the hashes whose 1 of 16 N bits another row sets too: all that have an equal, and few others."""
    size = np.uint64(64)
    while size * np.uint64(_PARTS) < np.uint64(16 * len(bits)):
        size *= np.uint64(2)
    six, low, one = np.uint64(6), np.uint64(63), np.uint64(1)
    once, twice = np.zeros(np.int64(size >> six), np.uint64), np.zeros(np.int64(size >> six), np.uint64)
    for repeat in range(2):
        for i in range(len(bits)):
            h = _hash(bits[i, 0], bits[i, 1], bits[i, 2])
            if h & np.uint64(_PARTS - 1) != np.uint64(part):
                continue
            h = (h >> np.uint64(2)) & (size - one)
            word, bit = h >> six, one << (h & low)
            if repeat == 0:
                twice[word] |= once[word] & bit
                once[word] |= bit
            else:
                crowded[i] = (twice[word] & bit) != np.uint64(0)


@kernel
def _first_rows(bits, rows, slots):
    """Return for each of some rows the first of them that has the same bits; `slots` are a power of two of −1."""
    mask = np.uint64(len(slots) - 1)
    same = np.empty(len(rows), np.int64)
    for j in range(len(rows)):
        a, b, c = bits[rows[j], 0], bits[rows[j], 1], bits[rows[j], 2]
        slot = _hash(a, b, c) & mask
        same[j] = rows[j]
        while slots[slot] >= 0:
            k = rows[slots[slot]]
            if bits[k, 0] == a and bits[k, 1] == b and bits[k, 2] == c:
                same[j] = k
                break
            slot = (slot + np.uint64(1)) & mask
        if slots[slot] < 0:
            slots[slot] = j
    return same
