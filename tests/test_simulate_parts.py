"""The example parts: valid, with the functional surface they declare, and found again in the STEP file."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepCheck import BRepCheck_Analyzer

from scan2nurbs.brep.cad import load_cad, tessellate
from scan2nurbs.simulate import simulate_scan

sys.path.insert(0, str(Path(__file__).parents[1]))

from examples.parts import PARTS
from examples.parts.make_parts import write_parts

QUICK = [name for name in PARTS if name != "complex_body"]  # which takes ten seconds to build


@pytest.mark.parametrize("name", QUICK)
def test_part_is_valid_and_its_functional_surface_is_scanned(name):
    part = PARTS[name]
    shape = part.build()
    assert BRepCheck_Analyzer(shape).IsValid()
    model = tessellate(shape)
    (face,) = part.functional_faces(model)
    assert model.types[face] == "BSplineSurface"
    points, _ = model.lift(np.flatnonzero(model.face == face), np.full(((model.face == face).sum(), 3), 1 / 3))
    assert np.linalg.norm(points - part.seed, axis=1).min() < 0.05 * np.sqrt(model.face_area[face])
    scan = simulate_scan(model, part.params(n_points=4000, noise=0))
    on_face = scan.clean[scan.face == face]
    assert len(on_face) * scan.spacing**2 > 0.9 * model.face_area[face] - 0.05 * model.area * bool(part.scan.get("holes"))
    # The border has to be found: other faces are scanned beside it.
    assert (scan.face >= 0).sum() - len(on_face) > 0.2 * len(scan.points)


def test_the_functional_surface_is_found_again_in_the_file(tmp_path):
    (path,) = write_parts(tmp_path, ["ring"])
    part, built = load_cad(path), tessellate(PARTS["ring"].build())
    (there,), (here,) = PARTS["ring"].functional_faces(part), PARTS["ring"].functional_faces(built)
    assert part.face_area[there] == pytest.approx(built.face_area[here], rel=1e-3)


def test_the_benchmark_takes_a_faces_true_outline():
    from benchmarks.surface import _border
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder

    box = tessellate(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape())
    border = _border(box, (box.nearest_face((1.5, 2.0, 9.0)),), 0.1)
    assert (border[:, 2] == 5.0).all()
    assert (np.minimum(border[:, :2], [3.0, 4.0] - border[:, :2]).min(axis=1) < 1e-12).all()
    assert np.ptp(border, axis=0) == pytest.approx([3.0, 4.0, 0.0])
    # The seam of a closed surface is no border.
    tube = tessellate(BRepPrimAPI_MakeCylinder(2.0, 7.0).Shape())
    ends = _border(tube, (tube.nearest_face((2.0, 0.0, 3.5)),), 0.1)
    assert (np.minimum(ends[:, 2], 7.0 - ends[:, 2]) < 1e-12).all()
