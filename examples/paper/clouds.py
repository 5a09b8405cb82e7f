"""The stand-ins for the paper's scans: simulated scans of the example parts, of the same kind and size."""

from __future__ import annotations

from typing import Any

import numpy as np
from examples.parts import PARTS
from scipy.spatial import KDTree

from scan2nurbs.brep.cad import CadPart, tessellate
from scan2nurbs.simulate import SimulatedScan, simulate_scan

from .truth import SHARP, TOLERANCE, MeshEdges, StandIn, edges_between_faces, seen_by

# One view from above: what the scanner sees of Fig. 6 is the surface itself, open at its border, without the sides of a block.
SCANS: dict[str, dict[str, Any]] = {"shallow_step": {"views": 1, "spread": 0.0}}

DETAIL = 30.0
"""Radius in d̄ of the disc that is as large as the largest detail: r_l of Fig. 11."""


class Model:
    """A part, tessellated once and scanned as often as wanted."""

    def __init__(self, name: str) -> None:
        self.part = PARTS[name]
        self.shape = self.part.build()
        self.cad = tessellate(self.shape)
        self.functional = self.part.functional_faces(self.cad)[0]

    def scan(self, **changes: Any) -> StandIn:
        """Simulate a scan and work out what is true of it."""
        given = {**SCANS.get(self.part.name, {}), **changes}
        scan = simulate_scan(self.cad, self.part.params(**given))
        # The simulator left a fine mesh on the shape.
        fine = tessellate(self.shape, deflection=0.1 * scan.spacing)
        return with_truth(self.part.description, scan, fine, self.functional, smooth_step=self.part.name == "shallow_step")


def with_truth(title: str, scan: SimulatedScan, part: CadPart, functional: int, *, smooth_step: bool = False) -> StandIn:
    """Put the truth beside a scan without outliers.

    Parameters
    ----------
    functional : int
        The face that is the functional surface.
    smooth_step : bool
        Whether it is bounded by a rounded step instead of sharp edges. The true edge is then the step's flat wall, half-way up; what
        is marked anywhere on the step is right.
    """
    h = scan.spacing
    every = edges_between_faces(part)
    step = _step_faces(part, every, functional) if smooth_step else np.zeros(0, np.int64)
    wall = _wall(every, step, functional) if smooth_step else -1
    true = every.take((every.angle >= SHARP) | (every.faces == wall).any(axis=1))
    samples, row = true.sample(0.5 * h)
    faces = true.faces[row]
    seen = seen_by(scan, samples, faces, TOLERANCE * h)
    samples, faces = samples[seen], faces[seen]
    on_border = (faces == (wall if smooth_step else functional)).any(axis=1)
    border = samples[on_border]
    on_step = np.isin(scan.face, step)
    targets = np.concatenate([samples, scan.clean[on_step]])
    near = np.isfinite(KDTree(targets).query(scan.clean, distance_upper_bound=TOLERANCE * h)[0])
    edge_of_inside = np.concatenate([border, scan.clean[on_step]])
    doubtful = np.isfinite(KDTree(edge_of_inside).query(scan.clean, distance_upper_bound=TOLERANCE * h)[0])
    small = part.face_area < np.pi * (DETAIL * 0.85 * h) ** 2
    detail = np.zeros(len(samples), bool)
    if not smooth_step:
        detail[:] = small[faces].any(axis=1)
    return StandIn(
        title=title,
        points=scan.points,
        clean=scan.clean,
        inside=scan.face == functional,
        judged=~doubtful,
        side=_sides(scan, every, functional, step, wall),
        near=near,
        edges=samples,
        detail=detail,
        border=border,
        h=h,
        sigma=scan.noise,
    )


def _sides(scan: SimulatedScan, every: MeshEdges, functional: int, step: np.ndarray, wall: int) -> np.ndarray:
    """Count the upper rounding of a step to the inside."""
    beside = every.faces[(every.faces == functional).any(axis=1)]
    upper = [face for face in step if (beside == face).any()]
    side = np.where(np.isin(scan.face, [functional, *upper]), 1, -1)
    return np.where(scan.face == wall, 0, side).astype(np.int8)


def _step_faces(part: CadPart, every: MeshEdges, functional: int) -> np.ndarray:
    """Find the faces of the step: what joins the functional surface smoothly, and on as far as the ground, the largest other face."""
    area = part.face_area.copy()
    area[functional] = 0.0
    area[[i for i, kind in enumerate(part.types) if kind == "Plane"]] = 0.0
    ground = int(area.argmax())
    smooth = every.faces[every.angle < SHARP]
    step: set[int] = {functional}
    while True:
        grown = step | {int(f) for a, b in smooth for f in (a, b) if {int(a), int(b)} & step and f != ground}
        if grown == step:
            return np.array(sorted(step - {functional}), np.int64)
        step = grown


def _wall(every: MeshEdges, step: np.ndarray, functional: int) -> int:
    """Find the face of the step that touches neither the functional surface nor anything beyond the step."""
    for face in step:
        others = set(every.faces[(every.faces == face).any(axis=1)].ravel().tolist()) - {int(face)}
        if others <= set(step.tolist()):
            return int(face)
    raise ValueError(f"No wall among the faces {step.tolist()} of the step beside face {functional}.")
