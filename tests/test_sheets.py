"""Borders on surfaces that come back to themselves, and parts of which such a surface is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from scan2nurbs.brep.charts import SplineChart
from scan2nurbs.brep.part import ModelParams, build_part
from scan2nurbs.brep.wide import WideSpline
from scan2nurbs.faces.topology import find_topology
from scan2nurbs.scale import measure_scale
from scan2nurbs.surfaces.bspline import bicubic
from scan2nurbs.surfaces.cylinder import Cylinder
from scan2nurbs.surfaces.plane import Plane

X, Y, Z = np.eye(3)
TURN = 2.0 * np.pi


@dataclass
class Fit:
    shape: object


def spiral(turns, growth):
    """A strip around the z axis for several turns, each a little wider than the one before."""
    u, v = np.linspace(0.0, turns * TURN, 160), np.linspace(0.0, 10.0, 12)
    radius = 2.0 + growth * u / TURN
    points = np.empty((len(u), len(v), 3))
    points[..., 0], points[..., 1], points[..., 2] = (radius * np.cos(u))[:, None], (radius * np.sin(u))[:, None], v
    return bicubic((u, v), points, (False, False))


def rectangle(low, high, step):
    """Parameters along the border of a rectangle, closely spaced."""
    (a, c), (b, d) = low, high
    sides = [((a, c), (b, c)), ((b, c), (b, d)), ((b, d), (a, d)), ((a, d), (a, c))]
    return np.vstack([np.linspace(p, q, int(np.abs(np.subtract(q, p)).max() / step), endpoint=False) for p, q in sides])


@pytest.mark.parametrize("growth", [0.0, 0.02])
def test_feet_stay_on_the_sheet_that_most_of_a_border_lies_on(growth):
    surface = spiral(1.8, growth)
    uv = rectangle((0.1 * TURN, 2.0), (0.7 * TURN, 8.0), 0.05)
    loop = surface.evaluate(uv) + np.random.default_rng(0).normal(scale=0.03, size=(len(uv), 3))
    nearest = WideSpline(surface).parameters(loop)
    assert np.abs(np.diff(nearest[:, 0])).max() > 0.9 * TURN  # the point of it all: they jump by a turn
    chart = SplineChart(surface, 1.0).guided([loop], 0.5)
    found = chart.uv(loop)
    assert np.abs(np.diff(found, axis=0)).max() < 0.3
    between = chart.uv(0.5 * (loop + np.roll(loop, -1, axis=0)))
    assert np.abs(between - found).max() < 0.3
    # Which of two sheets that coincide is open; that it is one of them is not.
    assert np.abs(found - uv - np.round((found - uv)[:, :1] / TURN) * [TURN, 0.0]).max() < 0.3
    assert np.linalg.norm(chart.point(found) - loop, axis=1).max() < 0.25


def test_a_border_whose_feet_do_not_jump_needs_no_guide():
    surface = spiral(0.8, 0.0)
    loop = surface.evaluate(rectangle((0.1 * TURN, 2.0), (0.7 * TURN, 8.0), 0.05))
    assert SplineChart(surface, 1.0).guided([loop], 0.5).guide is None


def chamfered(width, radius, tilt):
    """A block whose chamfer was taken for a narrow cylinder: points, labels, and the surfaces."""
    rng = np.random.default_rng(3)
    points, labels, fits = [], [], []
    leg = width / np.sqrt(2)

    def side(origin, u, v, length, depth, shape=None, inside=None):
        a, b = (g.ravel() + rng.uniform(-0.3, 0.3, g.size) for g in np.meshgrid(np.arange(0.5, length), np.arange(0.5, depth)))
        at = np.array(origin, float) + np.clip(a, 0, length)[:, None] * u + np.clip(b, 0, depth)[:, None] * v
        at = at if inside is None else at[inside(at)]
        points.append(at)
        labels.append(np.full(len(at), len(fits)))
        fits.append(Fit(shape or Plane(np.array(origin, float), np.cross(u, v))))

    side([0, 0, 0], X, Y, 20, 30)
    side([0, 0, 10], X, Y, 20 - leg, 30)
    side([0, 0, 0], Y, Z, 30, 10)
    side([20, 0, 0], Y, Z, 30, 10 - leg)
    for y in (0, 30):
        side([0, y, 0], X, Z, 20, 10, inside=lambda at: (20 - at[:, 0]) + (10 - at[:, 2]) > leg)
    up = (Z - X) / np.sqrt(2)
    axis = (Y + tilt * up) / np.hypot(1.0, tilt)
    middle = np.array([20 - leg / 2, 15, 10 - leg / 2])
    side([20, 0, 10 - leg], Y, up, 30, width, Cylinder(middle - radius * (X + Z) / np.sqrt(2), axis, radius))
    cloud = np.concatenate(points)
    return cloud + rng.normal(scale=0.1, size=cloud.shape), np.concatenate(labels).astype(np.int32), fits


@pytest.mark.parametrize(("width", "radius", "tilt"), [(3.0, 0.6, 0.06), (5.0, 0.9, 0.12)])
def test_a_chamfer_that_was_taken_for_a_narrow_cylinder_does_not_open_a_part(width, radius, tilt):
    points, label, fits = chamfered(width, radius, tilt)
    scale = measure_scale(points)
    # The narrower one misses its borders by as much as asks for a tolerance of just over half a spacing.
    part = build_part(points, fits, find_topology(points, label, fits, scale), scale, ModelParams(bearable=0.6))
    assert part.valid
    assert part.closed
    assert part.volume == pytest.approx(20 * 30 * 10 - 30 * width**2 / 4, rel=0.01)
    assert part.coverage > 0.98
    assert part.precision > 0.98
