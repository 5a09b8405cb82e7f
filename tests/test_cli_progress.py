"""What is drawn and said while a command runs."""

from __future__ import annotations

import io

import numba
import numpy as np
import pytest
from rich.console import Console

from scan2nurbs.cli import progress
from scan2nurbs.cli.progress import Bars, compiling_noticed


@pytest.fixture
def terminal(monkeypatch) -> io.StringIO:
    """A terminal that remembers what was drawn on it."""
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100)
    monkeypatch.setattr(progress, "console", lambda: console)
    return stream


def test_a_stage_has_a_bar_with_its_share_and_time_left(terminal):
    with Bars(True) as bars:
        bars("finding edges", 1, 4)
        bars("fitting", 1, 2)
        bars("finding edges", 3, 4)
        bars._progress.refresh()
        drawn = terminal.getvalue()
    assert "finding edges" in drawn
    assert "75%" in drawn
    assert ":" in drawn  # the time left


def test_a_stage_may_start_again(terminal):
    with Bars(True) as bars:
        bars("finding edges", 4, 4)
        bars("finding edges", 1, 4)
        (task,) = bars._progress.tasks
        assert task.completed == 1


def test_nothing_is_drawn_unless_wanted(terminal):
    with Bars(False) as bars:
        bars("finding edges", 1, 4)
    assert terminal.getvalue() == ""


def test_compiling_is_said_once(capsys):
    def kernel(x):
        return x.sum()

    with compiling_noticed(True):
        numba.njit(kernel)(np.ones(3))
        numba.njit(kernel)(np.ones((3, 3)))
    assert capsys.readouterr().err.count("Compiling kernels (first run only)") == 1
    with compiling_noticed(False):
        numba.njit(kernel)(np.ones(3))
    assert capsys.readouterr().err == ""
