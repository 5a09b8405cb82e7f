"""The helper that runs kernels over ranges in threads."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator

import pytest

from scan2nurbs.kernels.runner import run_ranges, set_threads


@pytest.fixture(params=[1, 2, 8])
def threads(request: pytest.FixtureRequest) -> Iterator[int]:
    set_threads(request.param)
    yield request.param
    set_threads(None)


@pytest.mark.parametrize("n", [0, 1, 7, 100])
def test_every_item_is_taken_once(threads: int, n: int) -> None:
    taken: list[tuple[int, int]] = []
    told: list[int] = []
    run_ranges(lambda a, b: taken.append((a, b)), n, size=7, progress=lambda done, total: told.append(done))
    assert sorted(taken) == [(a, min(a + 7, n)) for a in range(0, n, 7)]
    assert told == sorted(told)
    assert told[-1] == n


def test_it_ends_after_the_last_range(threads: int) -> None:
    here: set[str] = set()
    lock = threading.Lock()
    met = threading.Barrier(2) if threads > 1 else None

    def work(start: int, _stop: int) -> None:
        if met is not None and start < 2:
            met.wait(10.0)  # the first two ranges run at the same time
        with lock:
            here.add(threading.current_thread().name)

    run_ranges(work, 20, size=1)
    assert len(here) <= threads
    assert (len(here) > 1) == (threads > 1)


def test_what_is_wrong_in_a_range_is_told_and_ends_the_others(threads: int) -> None:
    taken: list[int] = []

    def work(start: int, _stop: int) -> None:
        taken.append(start)
        if start == 3:
            raise ZeroDivisionError("range 3")

    with pytest.raises(ZeroDivisionError, match="range 3"):
        run_ranges(work, 10_000, size=1)
    assert 3 in taken
    run_ranges(lambda a, b: taken.append(-a), 5, size=1)
    assert taken[-1] <= 0


def test_ranges_within_ranges_do_not_wait_for_each_other(threads: int) -> None:
    taken: list[tuple[int, int]] = []
    run_ranges(lambda a, _b: run_ranges(lambda c, _d: taken.append((a, c)), 5, size=1), 6, size=1)
    assert sorted(taken) == [(a, c) for a in range(6) for c in range(5)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="No processes are forked here.")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_starts_threads_of_its_own() -> None:
    set_threads(2)
    run_ranges(lambda a, b: None, 4, size=1)
    child = os.fork()
    if child == 0:
        done: list[int] = []
        run_ranges(lambda a, b: done.append(a), 4, size=1)
        os._exit(0 if len(done) == 4 else 1)
    set_threads(None)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
