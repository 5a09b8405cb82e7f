"""Which parameters lie within the loops of a face, on a plane and around a tube."""

from __future__ import annotations

import numpy as np
import pytest

from scan2nurbs.faces.trim import TrimLoop, within

NO_CORNERS = np.empty(0, np.int64)


def ring(radius, centre, *, clockwise=False):
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False) * (-1 if clockwise else 1)
    return TrimLoop(np.stack([centre[0] + radius * np.cos(t), centre[1] + radius * np.sin(t)], axis=1), True, NO_CORNERS)


def around(height, *, period, start=0.0, backwards=False):
    """A wavy loop once around a tube whose u has the period."""
    u = np.linspace(0, period, 300, endpoint=False)
    uv = np.stack([start + u, height + 0.1 * np.sin(2 * np.pi * (start + u) / period)], axis=1)
    if backwards:
        uv = np.stack([start - u, height + 0.1 * np.sin(2 * np.pi * (start - u) / period)], axis=1)
    return TrimLoop(uv, False, NO_CORNERS)


def test_a_ring_in_the_plane():
    uv = np.random.default_rng(0).uniform(-2, 2, (5000, 2))
    r = np.hypot(*uv.T)
    clear = (np.abs(r - 0.5) > 0.01) & (np.abs(r - 1.5) > 0.01)
    found = within(uv, (ring(1.5, (0, 0)), ring(0.5, (0, 0), clockwise=True)), None)
    assert np.array_equal(found[clear], ((r > 0.5) & (r < 1.5))[clear])


@pytest.mark.parametrize("start", [0.0, 1.3, -2.0])
@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_between_two_loops_around_a_tube_but_not_in_its_hole(start, turns):
    period = 3.0
    uv = np.random.default_rng(1).uniform([0, -3], [period, 3], (5000, 2))
    wave = 0.1 * np.sin(2 * np.pi * uv[:, 0] / period)
    low, high = uv[:, 1] - (-1 + wave), uv[:, 1] - (1 + wave)
    # The hole lies across the seam; its copy a period away is the same hole.
    from_hole = np.hypot((uv[:, 0] + 1.5) % period - 1.5, uv[:, 1])
    loops = (
        around(-1, period=period, start=start),
        around(1, period=period, start=start + 0.4, backwards=True),
        ring(0.5, (turns * period, 0), clockwise=True),
    )
    found = within(uv, loops, period)
    clear = (np.abs(low) > 0.01) & (np.abs(high) > 0.01) & (np.abs(from_hole - 0.5) > 0.01)
    assert np.array_equal(found[clear], ((low > 0) & (high < 0) & (from_hole > 0.5))[clear])
    assert np.array_equal(found, within(uv + np.array([period, 0.0]), loops, period))
