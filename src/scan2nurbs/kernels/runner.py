"""The decorators of all kernels, and the helper that runs a kernel over ranges in threads.

A kernel is a plain function over an index range, ``kernel(..., start, stop, out)``. It writes its own slice of `out`, so that the
result does not depend on how many threads ran it: range borders follow from n alone, partial sums are combined in order.
"""

from __future__ import annotations

import gc
import itertools
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event

from scan2nurbs.kernels import compiled
from scan2nurbs.ranges import require_int

# What Numba returns is called as the function was; its types say only that it is a dispatcher, hence the ignored return value below.
Function = TypeVar("Function", bound=Callable[..., Any])
Progress = Callable[[int, int], None]

# fastmath=True would assume that there is no NaN; these flags only allow reordering, which vectorised sums need.
REORDERING = {"nsz", "arcp", "contract", "afn", "reassoc"}

_threads: int | None = None
_helpers: tuple[ThreadPoolExecutor, int] | None = None
_lock = threading.Lock()


def kernel(function: Function) -> Function:
    """Compile a function that releases the GIL, lazily, cached on disk where the package's folder or the user's cache can be written.

    Its arithmetic stays as written. Numba compiles a function that others call once more within each of them, and which of the copies
    runs depends on whether they were compiled in this process or loaded from the cache: free to reorder, they would round differently.
    """
    return _compiled(function, nogil=True)


def summing(function: Function) -> Function:
    """Compile a kernel whose sums may be reordered, twice as fast: for sums over neighbourhoods alone, tested to be the same to the bit."""
    return _compiled(function, nogil=True, fastmath=REORDERING)


def inlined(function: Function) -> Function:
    """Compile a function into the loops that call it, which only then become vector instructions."""
    return _compiled(function, forceinline=True, nogil=True, fastmath=REORDERING)


def _compiled(function: Function, **options: Any) -> Function:
    dispatcher = numba.njit(cache=compiled.can_be_kept(), error_model="numpy", **options)(function)
    if dispatcher.stats.cache_path is not None:
        compiled.forget_outdated(Path(dispatcher.stats.cache_path))
    return dispatcher  # type: ignore[return-value] - a dispatcher


class _WithoutCollection(event.Listener):
    """Keep the garbage collector from going through all the compiler's objects again and again: an eighth of the time of compiling."""

    def __init__(self) -> None:
        # Numba compiles what a function calls within it; its lock lets one thread compile at a time.
        self._depth = 0
        self._collected = False

    def on_start(self, event: event.Event) -> None:
        if self._depth == 0:
            self._collected = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0 and self._collected:
            gc.enable()


event.register("numba:compile", _WithoutCollection())


def set_threads(n: int | None) -> None:
    """Set how many threads kernels may use; None means as many as this process has processors."""
    if n is not None:
        require_int(n, "threads", "set_threads", 1)
    global _threads  # noqa: PLW0603 - one setting for the whole process, like every thread pool's
    _threads = n


def thread_count() -> int:
    """Return how many threads kernels use."""
    if _threads is not None:
        return _threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_ranges(work: Callable[[int, int], None], n: int, *, size: int, progress: Progress | None = None) -> None:
    """Call ``work(start, stop)`` for the ranges of `size` that cover ``range(n)``, in threads.

    Parameters
    ----------
    work : callable
        Runs a kernel on a range and writes only what belongs to it.
    n : int
        How many items there are.
    size : int
        Items a range; must not depend on the number of threads where ranges hold partial sums.
    progress : callable, optional
        Called with (items done, n) between ranges, from the calling thread, and with (n, n) at the end.
    """
    ranges = [(start, min(start + size, n)) for start in range(0, n, size)]
    threads = min(thread_count(), len(ranges))
    turns, done, over = itertools.count(), itertools.count(1), threading.Event()

    def take_turns(tell: Progress | None = None) -> None:
        try:
            while not over.is_set() and (turn := next(turns)) < len(ranges):
                work(*ranges[turn])
                finished = next(done)
                if tell is not None:
                    tell(min(finished * size, n), n)
        except BaseException:
            over.set()  # after Ctrl-C nobody needs the other ranges any more
            raise

    helpers = [_pool(threads - 1).submit(take_turns) for _ in range(threads - 1)]
    try:
        take_turns(progress)
    finally:
        # Who has not begun has nothing left to do; nobody may still write when this call ends.
        running = [helper for helper in helpers if not helper.cancel()]
        wait(running)
    for helper in running:
        helper.result()
    if progress is not None:
        progress(n, n)


def _pool(threads: int) -> ThreadPoolExecutor:
    """Return the threads that help; starting them anew for each of thousands of calls takes a tenth of the time of a whole part."""
    global _helpers  # noqa: PLW0603 - one pool for the whole process
    with _lock:
        if _helpers is None or _helpers[1] < threads:
            _helpers = ThreadPoolExecutor(threads, thread_name_prefix="kernel"), threads
        return _helpers[0]


def _forget_helpers() -> None:
    """Let a forked process, which has none of its parent's threads, start its own."""
    global _helpers, _lock
    _helpers, _lock = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_helpers)
