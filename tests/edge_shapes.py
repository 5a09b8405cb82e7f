"""Clouds with edges whose truth is known."""

from __future__ import annotations

import numpy as np


def grid(n=40, noise=0.0, seed=0):
    """Return a jittered grid of n × n points, a unit apart."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float))
    flat = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.3, 0.3, (n * n, 2))
    return np.column_stack([flat, rng.normal(0, noise, n * n)])


def wedge(turn, n=40, noise=0.0, seed=0):
    """Return two half-planes that meet along the y axis, with the crease on top where the turn is positive."""
    left = grid(n, noise, seed) + np.array([0.5, 0, 0])
    right = grid(n, noise, seed + 1) + np.array([0.5, 0, 0])
    a = np.radians(turn) / 2
    down = lambda p, side: np.column_stack(  # noqa: E731
        [side * (p[:, 0] * np.cos(a) + p[:, 2] * np.sin(a)), p[:, 1], -p[:, 0] * np.sin(a) + p[:, 2] * np.cos(a)]
    )
    return np.concatenate([down(left, 1.0), down(right, -1.0)])


def box(size=24, noise=0.1, seed=0):
    """Return the surface of a cube, a unit between points."""
    rng = np.random.default_rng(seed)
    faces = []
    for axis in range(3):
        for end in (0.0, float(size)):
            flat = grid(size, 0.0, seed + axis)[:, :2] + 0.5
            faces.append(np.insert(flat, axis, end, axis=1))
    points = np.concatenate(faces)
    return points + rng.normal(0, noise, points.shape)


def box_edges(size, step):
    """Return samples of the twelve edges of the cube."""
    along = np.arange(0, size + step, step)
    edges = []
    for axis in range(3):
        for a in (0.0, float(size)):
            for b in (0.0, float(size)):
                points = np.empty((len(along), 3))
                points[:, axis], points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = along, a, b
                edges.append(points)
    return np.concatenate(edges)


def drum(radius, height, noise=0.1):
    """Return a cylinder with both lids, about a unit between points."""
    rng = np.random.default_rng(0)
    lid = rng.uniform(-radius, radius, (int(4 * radius**2), 2))
    lid = lid[np.linalg.norm(lid, axis=1) < radius]
    turn = rng.uniform(0, 2 * np.pi, int(2 * np.pi * radius * height))
    wall = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rng.uniform(0, height, len(turn))])
    points = np.concatenate([np.column_stack([lid, np.zeros(len(lid))]), np.column_stack([lid[::-1], np.full(len(lid), height)]), wall])
    return points + rng.normal(0, noise, points.shape)
