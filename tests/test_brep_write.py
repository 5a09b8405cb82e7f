"""Model files: the same surface back in every format and unit, the same bytes every time, whole or not at all."""

from __future__ import annotations

import getpass
import re
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brep_samples import circle, cylinder, plate
from scan2nurbs.brep import write as write_module
from scan2nurbs.brep.check import check
from scan2nurbs.brep.face import Loop, trimmed_face
from scan2nurbs.brep.header import plain
from scan2nurbs.brep.occ import EXPORT_LOCK
from scan2nurbs.brep.read import read_back
from scan2nurbs.brep.tessellate import tessellate_face
from scan2nurbs.brep.write import FORMATS, write_model
from scan2nurbs.cloud import UNITS
from scan2nurbs.errors import InputError, OutputError, ParameterError
from scan2nurbs.io import read_scan

CAD = [".step", ".stp", ".iges", ".igs", ".brep"]
STEP_UNITS = {
    "mm": r"SI_UNIT\(\.MILLI\.,\.METRE\.\)",
    "cm": r"SI_UNIT\(\.CENTI\.,\.METRE\.\)",
    "m": r"LENGTH_UNIT\(\)\s*NAMED_UNIT\(\*\)\s*SI_UNIT\(\$,\.METRE\.\)",
    "um": r"SI_UNIT\(\.MICRO\.,\.METRE\.\)",
    "in": r"CONVERSION_BASED_UNIT\('INCH'",
    "ft": r"CONVERSION_BASED_UNIT\('FOOT'",
}
IGES_UNITS = {"mm": "2HMM", "cm": "2HCM", "m": "1HM", "um": "2HUM", "in": "4HINCH", "ft": "2HFT"}
TURN = np.linspace(0, 1, 101)


@pytest.fixture(scope="module")
def face():
    return trimmed_face(plate(), [circle(0.5, 0.5, 0.4), circle(0.4, 0.4, 0.1)], tolerance=0.05)


@pytest.fixture(scope="module")
def tube():
    ends = [Loop(np.column_stack([TURN, height + 2 * np.sin(2 * np.pi * TURN)]), closed=False) for height in (10, 30)]
    return trimmed_face(cylinder(), ends, tolerance=0.05)


def text_of(path: Path) -> str:
    return re.sub(r"\s+", " ", path.read_text("ascii"))


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("suffix", [".step", ".iges"])
def test_the_surface_comes_back_in_millimetres_whatever_the_unit(tmp_path, face, suffix, unit):
    path = tmp_path / f"part{suffix}"
    written = write_model(path, face, unit=unit)
    model, found = read_back(path), check(read_back(path).shape)
    points = face.surface.control_points * UNITS[unit]
    assert np.abs(model.faces[0].surface.control_points - points).max() <= 1e-12 * np.abs(points).max()
    assert model.faces[0].surface.degrees == face.surface.degrees
    assert len(model.faces[0].loops) == 2
    assert found.valid
    assert found.n_edges == face.n_edges == written.model.n_edges
    assert found.area == pytest.approx(face.area * UNITS[unit] ** 2, rel=1e-6)
    named = re.search(STEP_UNITS[unit], text_of(path)) if suffix == ".step" else IGES_UNITS[unit] in text_of(path)
    assert named


@pytest.mark.parametrize("suffix", CAD)
def test_a_tube_and_a_rational_surface_come_back(tmp_path, tube, suffix):
    path = tmp_path / f"part{suffix}"
    write_model(path, tube, unit="mm")
    back = read_back(path).faces[0].surface
    assert np.allclose(back.control_points, tube.surface.control_points, atol=1e-9)
    assert np.allclose(back.weights, tube.surface.weights, rtol=1e-12)
    assert back.closed == (True, False)


@pytest.mark.parametrize(("schema", "says"), [("AP242", "AP242_MANAGED_MODEL"), ("AP214", "AUTOMOTIVE_DESIGN")])
def test_step_names_its_schema_product_and_faces(tmp_path, face, tube, schema, says):
    path = tmp_path / "part.step"
    write_model(path, [face, tube], unit="mm", schema=schema, name="Gehäuse 'A'")
    text = text_of(path)
    assert says in text
    assert "PRODUCT('Gehause _A_'" in text
    assert "ADVANCED_FACE('bspline_1'" in text
    assert "ADVANCED_FACE('bspline_2'" in text
    assert len(read_back(path).faces) == 2


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_faces_give_the_same_bytes_and_nothing_of_the_writer(tmp_path, face, tube, suffix, monkeypatch):
    if suffix == ".3dm":
        pytest.importorskip("rhino3dm")
    (tmp_path / "secretfolder").mkdir()
    first, second = tmp_path / f"a{suffix}", tmp_path / "secretfolder" / f"b{suffix}"
    write_model(first, [face, tube], unit="mm")
    write_model(second, [face, tube], unit="mm")
    data = first.read_bytes()
    assert data == second.read_bytes()
    assert b"scan2nurbs" in data or suffix in (".brep", ".3dm")
    private = [socket.gethostname(), "secretfolder", str(Path.home()), *([getpass.getuser()] if len(getpass.getuser()) > 3 else [])]
    for word in private:
        assert word.encode() not in data
        assert word.encode("utf-16-le") not in data
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    write_model(second, face, unit="mm")
    if suffix in (".step", ".iges"):
        assert re.search(rb"2001-09-09T01:46:40|20010909\.014640", second.read_bytes())


@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("suffix", CAD)
def test_far_from_zero_nothing_is_lost(tmp_path, face, tube, suffix, unit):
    origin = np.array([1e6, 2e6, -1e6])
    path = tmp_path / f"part{suffix}"
    write_model(path, [face, tube], unit=unit, origin=origin)
    model = read_back(path, unit=unit) if suffix in (".step", ".stp") else read_back(path)
    factor = UNITS[unit] if suffix in (".iges", ".igs") else 1.0
    for back, original in zip(model.faces, (face, tube), strict=True):
        assert np.abs(back.surface.control_points / factor - origin - original.surface.control_points).max() < 1e-8


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_meshes_read_back_as_points_on_the_face(tmp_path, suffix):
    flat = trimmed_face(plate(bend=0.0), [circle(0.5, 0.5, 0.3)], tolerance=0.05)
    path = tmp_path / f"mesh{suffix}"
    written = write_model(path, flat, unit="mm", deflection=0.01, origin=(5.0, 0.0, 7.0))
    points = read_scan(path).points
    assert "0.01 mm" in written.notes[0]
    assert np.abs(points[:, 2] - 7.0).max() < 1e-5
    assert points[:, 0].min() == pytest.approx(25.0, abs=0.1)


def test_an_stl_far_from_zero_stays_about_its_origin(tmp_path, face):
    written = write_model(tmp_path / "mesh.stl", face, unit="m", origin=(1e6, 0.0, 0.0))
    assert "about the origin" in written.notes[1]
    assert read_scan(tmp_path / "mesh.stl").points[:, 0].max() < 200


def test_triangles_lie_on_the_face_and_cover_it():
    small = plate(size=1e-3)
    face = trimmed_face(small, [circle(0.5, 0.5, 0.3)], tolerance=1e-6)
    mesh = tessellate_face(face, deflection=1e-6)
    corners = mesh.points[mesh.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(face.area, rel=5e-3)
    assert np.abs(small.evaluate(mesh.uv) - mesh.points).max() < 1e-7
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("nd,nd->n", normal, small.normals(mesh.uv[mesh.triangles[:, 0]])) > 0).all()
    with pytest.raises(ParameterError, match="'deflection'"):
        tessellate_face(face, deflection=0.0)


@pytest.mark.parametrize("suffix", [".step", ".brep"])
def test_a_face_of_a_few_nanometres_is_written(suffix, tmp_path):
    face = trimmed_face(plate(size=2e-6), [circle(0.5, 0.5, 0.3)], tolerance=2e-9)
    written = write_model(tmp_path / f"tiny{suffix}", face, unit="mm")
    assert written.model.valid
    assert written.model.area == pytest.approx(face.area, rel=1e-3)


def test_3dm_holds_surface_and_curves_in_its_unit(tmp_path, tube):
    rhino3dm = pytest.importorskip("rhino3dm")
    written = write_model(tmp_path / "part.3dm", tube, unit="in")
    assert "untrimmed" in written.notes[0]
    model = rhino3dm.File3dm.Read(str(tmp_path / "part.3dm"))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Inches
    names = [item.Attributes.Name for item in model.Objects]
    assert names == ["bspline_1", "bspline_1_trim_1", "bspline_1_trim_2", "bspline_1_trim_3"]
    surface = model.Objects[0].Geometry
    point = surface.PointAt(0.3, 12.0)
    assert pytest.approx(tube.surface.evaluate([[0.3, 12.0]])[0].tolist(), abs=1e-9) == [point.X, point.Y, point.Z]


@pytest.mark.parametrize("suffix", CAD)
def test_a_file_that_reads_back_as_something_else_is_not_kept(tmp_path, face, suffix, monkeypatch):
    path = tmp_path / f"part{suffix}"
    path.write_text("what was here before")
    real = write_module.differences

    def compare(temporary, shapes, expected, *, unit):
        wrong = replace(expected, n_edges=9)
        wrong.__dict__["area"] = 2 * expected.area
        return real(temporary, shapes, wrong, unit=unit)

    monkeypatch.setattr(write_module, "differences", compare)
    with pytest.raises(OutputError, match=r"does not read back.*3 edges instead of 9|2 edges instead of 9.*area"):
        write_model(path, face, unit="mm")
    assert path.read_text() == "what was here before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_missing_folder_is_said_and_leaves_nothing(tmp_path, face, suffix):
    if suffix == ".3dm":
        pytest.importorskip("rhino3dm")
    with pytest.raises(OutputError, match="does not exist"):
        write_model(tmp_path / "missing" / f"part{suffix}", face, unit="mm")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"path": "part.dxf"}, "suffix"),
        ({"unit": "yd"}, "'unit'"),
        ({"schema": "AP203"}, "'schema'"),
        ({"faces": []}, "'faces'"),
        ({"origin": (0.0, np.nan, 0.0)}, "'origin'"),
        ({"deflection": -1.0}, "'deflection'"),
    ],
)
def test_parameters_out_of_range_are_refused(tmp_path, face, change, said):
    call = {"path": "part.step", "faces": face, "unit": "mm"} | change
    call["path"] = tmp_path / call["path"]
    with pytest.raises(ParameterError, match=said):
        write_model(**call)


def test_foreign_files_are_refused(tmp_path):
    for name, content in (("a.step", "nonsense"), ("a.brep", "nonsense"), ("a.txt", "0 0 0")):
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError):
            read_back(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        read_back(tmp_path / "missing.step")


def test_nothing_is_printed_and_the_lock_is_free_again(tmp_path, face, capfd):
    for suffix in CAD:
        write_model(tmp_path / f"part{suffix}", face, unit="mm")
    assert capfd.readouterr() == ("", "")
    assert EXPORT_LOCK.acquire(blocking=False)
    EXPORT_LOCK.release()


def test_names_become_ascii():
    assert plain("Gehäuse №1") == "Gehause No1"
    assert plain("a'b\\c\n") == "a_b_c_"
    assert plain("") == "part"
