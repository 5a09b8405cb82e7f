"""CAD files as triangles that know where on which surface they lie."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.BRepTools import BRepTools
from OCP.GC import GC_MakeArcOfEllipse
from OCP.GeomAPI import GeomAPI_PointsToBSplineSurface
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Elips, gp_Pnt, gp_Trsf, gp_Vec
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Shape

from scan2nurbs.brep.cad import load_cad, tessellate
from scan2nurbs.brep.occ import EXPORT_LOCK, silence
from scan2nurbs.brep.read import read_shape
from scan2nurbs.errors import InputError


def moved(shape):
    """Turn and shift a shape, so that its faces carry a location."""
    turn, shift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 2)), 0.7)
    shift.SetTranslation(gp_Vec(40, -30, 20))
    return BRepBuilderAPI_Transform(shape, shift * turn, False).Shape()


def extrusion():
    arc = GC_MakeArcOfEllipse(gp_Elips(gp_Ax2(), 5.0, 2.0), 0.2, 2.5, True).Value()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeEdge(arc).Edge(), gp_Vec(1, 2, 7)).Shape()


def freeform(n=9):
    from OCP.collections import Array2_gp_Pnt

    grid = Array2_gp_Pnt(1, n, 1, n)
    for i in range(n):
        for j in range(n):
            grid.SetValue(i + 1, j + 1, gp_Pnt(i, j, 1.5 * np.sin(i / 2) * np.cos(j / 3)))
    job = GeomAPI_PointsToBSplineSurface()
    job.Interpolate(grid)
    return BRepBuilderAPI_MakeFace(job.Surface(), 1e-6).Face()


SHAPES = {
    "box": lambda: BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape(),
    "cylinder": lambda: BRepPrimAPI_MakeCylinder(2.0, 7.0).Shape(),
    "cone": lambda: BRepPrimAPI_MakeCone(3.0, 1.0, 5.0).Shape(),
    "sphere": lambda: BRepPrimAPI_MakeSphere(3.0).Shape(),
    "torus": lambda: BRepPrimAPI_MakeTorus(6.0, 1.5).Shape(),
    "nurbs torus": lambda: BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeTorus(6.0, 1.5).Shape()).Shape(),
    "nurbs cylinder": lambda: BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeCylinder(2.0, 7.0).Shape()).Shape(),
    "extrusion": extrusion,
    "freeform": freeform,
}


@pytest.mark.parametrize("place", [lambda s: s, moved], ids=["as made", "moved"])
@pytest.mark.parametrize("name", SHAPES)
def test_lifts_exactly_onto_the_surface_the_kernel_evaluates(name, place):
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepGProp import BRepGProp_Face

    from scan2nurbs.brep.cad import _faces_of

    part = tessellate(place(SHAPES[name]()))
    rng = np.random.default_rng(0)
    triangle, weight = rng.integers(len(part.corners), size=60), rng.dirichlet([1, 1, 1], 60)
    points, normals = part.lift(triangle, weight)
    uv = np.einsum("nkc,nk->nc", part.uv[triangle], weight)
    topo = _faces_of(part.shape)
    for k, (u, v) in enumerate(uv):
        face = topo[part.face[triangle[k]]]
        p, n = gp_Pnt(), gp_Vec()
        BRepGProp_Face(face).Normal(u, v, p, n)
        assert points[k] == pytest.approx((p.X(), p.Y(), p.Z()), abs=1e-12 * 100)
        if n.Magnitude() > 1e-9:
            n.Normalize()
            assert normals[k] == pytest.approx((n.X(), n.Y(), n.Z()), abs=1e-9)
        assert part.types[part.face[triangle[k]]] == BRepAdaptor_Surface(face).GetType().name.removeprefix("GeomAbs_")


@pytest.mark.parametrize("name", ["box", "cylinder", "cone", "sphere", "torus", "nurbs torus"])
def test_normals_and_triangles_of_a_solid_point_outwards(name):
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    part = tessellate(moved(SHAPES[name]()))
    middle = np.full((len(part.corners), 3), 1 / 3)
    points, normals = part.lift(np.arange(len(part.corners)), middle)
    # Gauss: three times the volume is the integral of p · n over the surface.
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(part.shape, properties)
    assert (np.einsum("nc,nc->n", points, normals) * part.triangle_area).sum() / 3 == pytest.approx(properties.Mass(), rel=5e-3)
    flat = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
    assert (np.einsum("nc,nc->n", flat, normals) > 0).all()


def test_normal_at_a_pole_is_the_limit_from_inside():
    part = tessellate(BRepPrimAPI_MakeSphere(3.0).Shape())
    corner = np.abs(part.corners[..., 2] - 3.0) < 1e-12
    triangle, place = np.nonzero(corner)
    points, normals = part.lift(triangle, np.eye(3)[place])
    assert len(triangle) > 0
    assert normals == pytest.approx(points / 3.0, abs=1e-3)


def test_area_and_face_area():
    part = tessellate(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape())
    assert part.area == pytest.approx(94)
    assert sorted(part.face_area) == pytest.approx([12, 12, 15, 15, 20, 20])


@pytest.mark.parametrize(
    ("point", "axis", "side"), [((1, 2, 9), 2, 5.0), ((1.5, 2.0, 4.9), 2, 5.0), ((-7, 1, 1), 0, 0.0), ((1, 3.9, 1), 1, 4.0)]
)
def test_nearest_face_measures_to_the_triangles_not_their_corners(point, axis, side):
    part = tessellate(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape())
    corners = part.corners[part.face == part.nearest_face(point)]
    assert (corners[..., axis] == side).all()


def write_step(shape, path, unit="MM"):
    with EXPORT_LOCK:
        silence()
        writer = STEPControl_Writer()
        Interface_Static.SetCVal_s("write.step.unit", unit)
        try:
            writer.Transfer(shape, STEPControl_AsIs)
            writer.Write(str(path))
        finally:
            Interface_Static.SetCVal_s("write.step.unit", "MM")


@pytest.mark.parametrize("unit", ["MM", "INCH"])
def test_reads_step_in_millimetres_whatever_its_unit(tmp_path, unit):
    path = tmp_path / "box.data"  # the content tells, not the suffix
    write_step(BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape(), path, unit)
    part = load_cad(path)
    assert part.area == pytest.approx(94)
    assert (part.unit, part.notes, len(part.faces)) == ("mm", (), 6)


def test_millimetres_stay_millimetres_whatever_unit_was_written_or_read_before(tmp_path):
    box, path = BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape(), tmp_path / "box.step"
    write_step(box, path)
    for unit in ("m", "in"):
        read_shape(path, unit=unit)
        assert np.ptp(load_cad(path).corners.reshape(-1, 3), axis=0) == pytest.approx([10.0, 20.0, 30.0])


def test_reads_iges_and_brep(tmp_path):
    shape = BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape()
    with EXPORT_LOCK:
        silence()
        writer = IGESControl_Writer("MM", 1)
        writer.AddShape(shape)
        writer.ComputeModel()
        writer.Write(str(tmp_path / "box.igs"))
    BRepTools.Write_s(shape, str(tmp_path / "box.brep"))
    assert load_cad(tmp_path / "box.igs").area == pytest.approx(94)
    part = load_cad(tmp_path / "box.brep")
    assert part.area == pytest.approx(94)
    assert "no unit" in part.notes[0]


def test_says_what_is_wrong_with_a_file(tmp_path):
    shape = BRepPrimAPI_MakeBox(3.0, 4.0, 5.0).Shape()
    with pytest.raises(InputError, match="cannot be read"):
        load_cad(tmp_path / "missing.step")
    with pytest.raises(InputError, match="cannot be read"):
        load_cad(tmp_path)
    for content, said in ((b"", "empty"), (b"  \n", "empty"), (b"solid nothing\n", "none of STEP"), (b"\x00" * 200, "none of STEP")):
        (tmp_path / "odd.step").write_bytes(content)
        with pytest.raises(InputError, match=said):
            load_cad(tmp_path / "odd.step")
    write_step(shape, tmp_path / "box.step")
    BRepTools.Write_s(shape, str(tmp_path / "box.brep"))
    for name in ("box.step", "box.brep"):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 3])
        with pytest.raises(InputError, match=r"damaged|no faces") as caught:
            load_cad(tmp_path / name)
        assert caught.value.path == tmp_path / name


def test_a_file_without_faces_is_refused(tmp_path):
    write_step(BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Edge(), tmp_path / "wire.step")
    with pytest.raises(InputError, match="no faces"):
        load_cad(tmp_path / "wire.step")
    with pytest.raises(InputError, match="no faces"):
        tessellate(TopoDS_Shape())


def test_deflection_bounds_the_distance_of_the_triangles():
    for deflection in (0.3, 0.01):
        part = tessellate(BRepPrimAPI_MakeSphere(gp_Ax2(), 30.0).Shape(), deflection=deflection)
        radius = np.linalg.norm(part.corners.mean(axis=1), axis=1)
        assert 30 - radius.min() < 1.01 * deflection
