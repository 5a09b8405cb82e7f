"""Whole parts in files: names, colours, units, formats."""

import re

import numpy as np
import pytest

from scan2nurbs.brep import write_part as write_part_module
from scan2nurbs.brep.cad import tessellate
from scan2nurbs.brep.check import check
from scan2nurbs.brep.read import faces_of, read_shape
from scan2nurbs.brep.write_part import write_part
from scan2nurbs.errors import OutputError
from test_part import rod


def test_the_same_part_gives_the_same_bytes(tmp_path):
    first, second = (write_part(tmp_path / f"{k}.step", rod().build(noise=0.2), unit="mm", name="rod").path for k in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_step_names_and_colours_faces(tmp_path):
    path = write_part(tmp_path / "rod.step", rod().build(), unit="mm").path
    named = write_part(tmp_path / "named.step", rod().build(), unit="mm", names=["side", "floor", "lid"]).path
    assert re.findall(r"ADVANCED_FACE\('([^']*)'", named.read_text()) == ["side", "floor", "lid"]
    text = path.read_text()
    assert re.findall(r"ADVANCED_FACE\('([^']*)'", text) == ["cylinder_0", "plane_1", "plane_2"]
    assert text.count("COLOUR_RGB") >= 2
    assert "AP242" in text
    assert len(faces_of(read_shape(path))) == 3


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("m", 1000.0), ("in", 25.4)])
def test_units_and_origin_survive(tmp_path, unit, factor):
    path = write_part(tmp_path / "rod.step", rod().build(), unit=unit, origin=(100.0, 0.0, 0.0)).path
    found = check(read_shape(path, unit="mm"))
    assert found.closed
    assert found.volume == pytest.approx(np.pi * 300 * factor**3, rel=1e-5)


@pytest.mark.parametrize("suffix", [".brep", ".iges", ".stl", ".ply", ".obj"])
def test_other_formats_are_written(tmp_path, suffix):
    written = write_part(tmp_path / f"rod{suffix}", rod().build(), unit="mm")
    assert written.path.stat().st_size > 1000
    assert written.model.n_faces == 3


def test_a_mesh_depends_on_the_part_and_not_on_triangles_that_were_left_on_it(tmp_path):
    fresh, looked_at = rod().build(), rod().build()
    tessellate(looked_at.shape, deflection=1e-4 * looked_at.kernel_scale)
    first, second = (write_part(tmp_path / f"{k}.stl", part, unit="mm", deflection=0.5).path for k, part in enumerate((fresh, looked_at)))
    assert first.read_bytes() == second.read_bytes()


def test_a_file_that_cannot_be_read_again_is_an_output_error(tmp_path, monkeypatch):
    path = tmp_path / "rod.brep"
    monkeypatch.setattr(write_part_module, "write_brep", lambda written, _shape: written.write_bytes(b"garbage"))
    with pytest.raises(OutputError, match=r"rod\.brep: What was written cannot be read again") as caught:
        write_part(path, rod().build(), unit="mm")
    assert caught.value.path == path
    assert not list(tmp_path.iterdir())
