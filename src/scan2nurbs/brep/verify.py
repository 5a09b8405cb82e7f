"""Whether a written file says what it should: it is read back and compared before it gets its name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scan2nurbs.brep.check import ModelCheck, check
from scan2nurbs.brep.occ import from_surface
from scan2nurbs.brep.read import read_back
from scan2nurbs.surfaces.bspline import BSplineSurface

_SHARE = 1e-7
_AREA = 1e-5
_STEPS = np.linspace(0.0, 1.0, 7)


def differences(path: Path, written: Sequence[Any], expected: ModelCheck, *, unit: str) -> tuple[str, ...]:
    """Read a model file back and say how it differs from what was to be written.

    Parameters
    ----------
    path : Path
        A STEP, IGES or BREP file.
    written : sequence of TopoDS_Face
        The faces that were to be written, in the order of the file, on B-spline surfaces.
    expected : ModelCheck
        What was found about them.
    unit : str
        The unit of their numbers.

    Returns
    -------
    tuple of str
        One sentence a difference; empty where there is none: the same number of faces and edges, surfaces equal to a ten-millionth of
        their extent, areas to a hundred-thousandth, and valid if the original was.
    """
    model = read_back(path, unit=unit, per_edge=1)
    found = check(model.shape)
    if found.n_faces != expected.n_faces:
        return (f"{found.n_faces} faces instead of {expected.n_faces}",)
    said = []
    for k, (face, original) in enumerate(zip(model.faces, written, strict=True), start=1):
        surface = _surface_of(original)
        extent = float(np.ptp(surface.control_points.reshape(-1, 3), axis=0).max())
        apart = _distance(face.surface, surface)
        if not apart <= max(_SHARE * extent, 1e-14 * float(np.abs(surface.control_points).max())):
            said.append(f"surface {k} lies {apart:.3g} {unit} away")
    # IGES does not say that two edges are one: a seam comes back as two.
    seams = expected.n_edges - expected.free_edges if path.suffix.lower() in (".iges", ".igs") else 0
    if not expected.n_edges <= found.n_edges <= expected.n_edges + seams:
        said.append(f"{found.n_edges} edges instead of {expected.n_edges}")
    if abs(found.area - expected.area) > _AREA * expected.area:
        said.append(f"an area of {found.area:.9g} instead of {expected.area:.9g} {unit}²")
    if expected.valid and not found.valid:
        said.append("the kernel's check finds the model invalid")
    return tuple(said)


def _surface_of(face: Any) -> BSplineSurface:
    from OCP.BRep import BRep_Tool  # pyright: ignore[reportAttributeAccessIssue]

    return from_surface(BRep_Tool.Surface_s(face))


def _distance(a: BSplineSurface, b: BSplineSurface) -> float:
    """Return the largest distance of two surfaces at the same shares of their domains."""
    u, v = np.meshgrid(_STEPS, _STEPS, indexing="ij")
    shares = np.column_stack([u.ravel(), v.ravel()])
    points = []
    for surface in (a, b):
        low, high = np.array(surface.domain).T
        points.append(surface.evaluate(np.clip(low + shares * (high - low), low, high)))
    return float(np.linalg.norm(points[0] - points[1], axis=1).max())
