"""Sorting whole numbers by their digits, in threads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scan2nurbs.kernels.runner import kernel, run_ranges

_BITS = 11
_RANGE = 1 << 17


def radix_argsort(keys: NDArray[np.int64], bound: int) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Sort stably by counting 11 bits at a time, least significant first.

    Parameters
    ----------
    keys : (N,) int64
        Numbers in [0, bound).
    bound : int

    Returns
    -------
    order : (N,) int32
        Where each of the sorted keys stood.
    sorted_keys : (N,) int64

    Notes
    -----
    O(N) time for each 11 bits. Every range of the keys counts its digits, and moves its keys to where those of the ranges before it
    end: the order is the stable one, however many threads there are.
    """
    n = len(keys)
    order = np.empty(0, np.int32)
    for shift in range(0, max(int(bound - 1).bit_length(), 1), _BITS):
        counts = np.empty((-(-n // _RANGE), 1 << _BITS), np.int64)
        run_ranges(lambda start, stop, k=keys, s=shift, c=counts: _count(k, s, start, stop, c[start // _RANGE]), n, size=_RANGE)
        ends = np.cumsum(counts.T).reshape(counts.T.shape).T  # by digit, then by range
        places = np.ascontiguousarray(ends - counts)
        moved, moved_keys = np.empty(n, np.int32), np.empty(n, np.int64)
        run_ranges(
            lambda start, stop, k=keys, o=order, s=shift, p=places, m=moved, mk=moved_keys: _move(
                k, o, s, start, stop, p[start // _RANGE], m, mk
            ),
            n,
            size=_RANGE,
        )
        order, keys = moved, moved_keys
    return order, keys


@kernel
def _count(keys, shift, start, stop, count):
    for digit in range(len(count)):
        count[digit] = 0
    part = keys[start:stop]
    for i in range(len(part)):
        count[np.uint64((part[i] >> shift) & 2047)] += 1


@kernel
def _move(keys, order, shift, start, stop, place, moved, moved_keys):
    for i in range(start, stop):
        digit = np.uint64((keys[i] >> shift) & 2047)
        at = np.uint64(place[digit])
        moved[at] = order[i] if len(order) > 0 else i
        moved_keys[at] = keys[i]
        place[digit] += 1
