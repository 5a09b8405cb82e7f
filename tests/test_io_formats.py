"""What is written comes back, in every format and variant."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import io_samples as samples
from io_samples import NAMES
from scan2nurbs.errors import InputError
from scan2nurbs.io import FORMATS, read_scan
from scan2nurbs.io.lzf import unpack_lzf

XYZ = samples.points()
UTM = np.array([[431250.125, 5411875.0625, 312.001], [431251.377, 5411874.999, 311.5], [4000000.001, 5411870.333, 0.0001]])


def test_the_list_of_formats_is_whole(every_format):
    assert sorted(every_format) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_format_reads_back(name, every_format, read):
    suffix, content = every_format[name]
    scan = read(content, suffix)
    assert scan.points.dtype == np.float64
    assert np.array_equal(scan.points, XYZ)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in {"gzip"}])
def test_the_content_tells_the_format_whatever_the_suffix(name, every_format, read):
    suffix, content = every_format[name]
    right, wrong = read(content, suffix), read(content, ".pcd" if suffix != ".pcd" else ".ply")
    assert np.array_equal(wrong.points, XYZ)
    assert wrong.format == right.format
    assert "the content was believed" in wrong.notes[0]
    assert not any("believed" in note for note in right.notes)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in {"gzip", "e57"}])
def test_everything_but_e57_may_be_packed_by_gzip(name, every_format, read):
    suffix, content = every_format[name]
    scan = read(gzip.compress(content), suffix + ".gz")
    assert np.array_equal(scan.points, XYZ)
    assert scan.notes[-1] == "The file was unpacked by gzip."
    assert not any("believed" in note for note in scan.notes)


def test_every_format_has_a_suffix_of_its_own():
    suffixes = [suffix for known in FORMATS for suffix in known.suffixes]
    assert len(suffixes) == len(set(suffixes))


# --- PLY ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("faces", [True, False])
def test_ply_with_any_properties_and_line_ends(order, newline, faces, read):
    content = samples.ply(
        XYZ,
        order,
        ("f8", "f4", "f8"),
        before=[("nx", "f4"), ("flag", "i2")],
        after=[("red", "u1"), ("q", "f8")],
        faces=faces,
        newline=newline,
    )
    assert np.array_equal(read(content, ".ply").points, XYZ)


def test_ply_header_with_carriage_returns_before_data_that_begin_with_a_line_feed(read):
    xyz = XYZ.copy()
    xyz[0, 0] = np.frombuffer(b"\x0a\0\0\0\0\0\x10\x40", "<f8")[0]
    assert np.array_equal(read(samples.ply(xyz, "<", faces=False, newline="\r"), ".ply").points, xyz)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("lengths", [(2,) * 5, (0, 3, 1, 2, 7)])
def test_ply_with_lists_among_the_vertex_properties(order, lengths, read):
    head = f"ply\nformat binary_{'little' if order == '<' else 'big'}_endian 1.0\nelement vertex 5\n"
    head += "property list uchar short tags\nproperty double x\n"
    head += "property list int float more\nproperty double y\nproperty float z\nelement face 0\nproperty list uchar int i\nend_header\n"
    rows = b""
    for (x, y, z), n in zip(XYZ[:5].tolist(), lengths, strict=True):
        rows += struct.pack(f"{order}B{n}h", n, *range(n)) + struct.pack(order + "d", x)
        rows += struct.pack(f"{order}i{n}f", n, *range(n)) + struct.pack(order + "df", y, z)
    assert np.array_equal(read(head.encode() + rows).points, XYZ[:5])


def test_ascii_ply_with_lists_before_the_coordinates(read):
    head = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar int i\nproperty float x\nproperty float y\n"
    head += b"property list uchar int j\nproperty float z\nend_header\n"
    assert np.array_equal(read(head + b"2 8 8 1 2 0 3\n0 4 5 1 9 6\n1 8 7 8 2 9 9 9\n").points, [[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    for row, message in [
        (b"2 8 8 1 2 0", "6 columns instead of 7"),
        (b"99 1 2 0 3", "no length"),
        (b"-1 1 2 0 3", "no length"),
        (b"0 a 2 0 3", "'a'"),
    ]:
        with pytest.raises(InputError, match=message):
            read(head + b"0 1 2 0 3\n" + row + b"\n")
    with pytest.raises(InputError, match="declares 3 vertices, the payload ends after 1"):
        read(head + b"0 1 2 0 3\n")


@pytest.mark.parametrize("sizes", [(3, 3, 3), (3, 5, 4)])
def test_ply_with_the_faces_before_the_vertices(sizes, read):
    faces = b"".join(struct.pack(f"<B{n}i", n, *range(n)) for n in sizes)
    content = samples.ply(XYZ, "<", extra=[("polygon", 3, ["property list uchar int i"], faces)], faces=False)
    assert np.array_equal(read(content).points, XYZ)
    text = "".join(f"{n} {' '.join(map(str, range(n)))}\n" for n in sizes).encode()
    content = samples.ply(XYZ, "", extra=[("polygon", 3, ["property list uchar int i"], text)], faces=False)
    assert np.array_equal(read(content).points, XYZ)


@pytest.mark.parametrize("order", ["<", ""])
def test_ply_that_goes_on_behind_its_vertices_is_told(order, read):
    content = samples.ply(XYZ, order, faces=False)
    assert read(content).notes == ()
    assert read(content + b"\n \n" * (not order)).notes == ()
    fewer = content.replace(f"element vertex {len(XYZ)}".encode(), f"element vertex {len(XYZ) - 1}".encode())
    found = read(fewer)
    assert np.array_equal(found.points, XYZ[:-1])
    (note,) = found.notes
    assert note.startswith(f"The header declares {len(XYZ) - 1} vertices, but ")
    assert ("24 more bytes" if order else "1 more lines") in note


def test_ply_with_integer_coordinates(read):
    xyz = np.arange(12).reshape(4, 3) - 5
    assert np.array_equal(read(samples.ply(xyz, "<", ("i4", "i2", "i1"))).points, xyz)


@pytest.mark.parametrize(
    ("comment", "unit"),
    [
        ("comment SOLIDWORKS generated,length unit = meters", "m"),
        ("comment unit: mm", "mm"),
        ("obj_info units inch", "in"),
        ("comment units in mm", "mm"),
        ("comment unit: in", "in"),
        ("comment the unit is metres", "m"),
        ("comment Units = Millimetres", "mm"),
        ("comment one unit of work", None),
        ("comment made by hand in mm or so", None),
    ],
)
def test_ply_comments_may_state_the_unit(comment, unit, read):
    assert read(samples.ply(XYZ, comments=[comment])).unit == unit


# --- PCD ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("size", [4, 8])
def test_pcd_keeps_points_that_are_none(data, size, read):
    xyz = XYZ.copy()
    xyz[3] = np.nan
    xyz[5, 1] = np.inf
    scan = read(samples.pcd(xyz, data, size))
    assert np.isnan(scan.points[[3, 5]]).all()
    assert np.array_equal(np.delete(scan.points, [3, 5], axis=0), np.delete(XYZ, [3, 5], axis=0))
    assert "2 of 12 rows hold no finite point." in scan.notes
    assert scan.unit is None
    assert any("metres" in note for note in scan.notes)


def test_pcd_without_comment_and_with_a_pose(read):
    scan = read(samples.pcd(XYZ, header={"VIEWPOINT": "1 0 0 1 0 0 0"}, comment=False))
    assert np.array_equal(scan.points, XYZ)
    assert any("VIEWPOINT" in note for note in scan.notes)


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("header", [{"POINTS": "9"}, {"WIDTH": "3", "HEIGHT": "2"}])
def test_pcd_with_two_counts_believes_the_one_that_the_payload_bears_out(data, header, read):
    scan = read(samples.pcd(XYZ, data, header=header))
    assert np.array_equal(scan.points, XYZ)
    assert any("differ" in note for note in scan.notes)


@given(st.binary(max_size=2000) | st.lists(st.sampled_from([b"abcabc", b"\0" * 300, b"x"]), max_size=40).map(b"".join))
def test_lzf_unpacks_what_was_packed(data):
    assert unpack_lzf(samples.lzf(data), len(data)) == data


# --- meshes, arrays ----------------------------------------------------------------------------------------------------------


def test_binary_stl_that_begins_with_solid(read):
    assert np.array_equal(read(samples.stl(XYZ, b"solid made by hand\nfacet"), ".stl").points, XYZ)


def test_binary_stl_with_a_tail(read):
    scan = read(samples.stl(XYZ) + b"tail\0", ".stl")
    assert np.array_equal(scan.points, XYZ)
    assert any("5 bytes behind" in note for note in scan.notes)


@pytest.mark.parametrize("extra", ["", " 1.0", " 0.1 0.2 0.3", " # a comment"])
def test_obj_vertices_with_weights_and_colours(extra, read):
    content = "".join(f"v {x!r} {y!r} {z!r}{extra}\nvt 0 0\n" for x, y, z in XYZ.tolist())
    assert np.array_equal(read(("#\n" + content).encode()).points, XYZ)


@pytest.mark.parametrize(
    ("keyword", "extra", "width"),
    [("COFF", " 255 0 0 255", 7), ("NOFF", " 0 0 1", 6), ("CNOFF", " 0 0 1 1 1 1 1", 10), ("STOFF", " 0 1", 5)],
)
def test_off_variants(keyword, extra, width, read):
    assert np.array_equal(read(samples.off(XYZ, keyword, extra)).points, XYZ)
    assert np.array_equal(read(samples.off_binary(XYZ, keyword, width)).points, XYZ)


def test_off_without_its_keyword(read):
    assert np.array_equal(read(samples.off(XYZ).replace(b"OFF\n", b""), ".off").points, XYZ)


def test_obj_that_begins_with_an_unknown_statement(read):
    assert np.array_equal(read(b"call a b\n" + samples.obj(XYZ)).points, XYZ)


def test_off_with_the_counts_beside_the_keyword(read):
    assert np.array_equal(read(samples.off(XYZ).replace(b"OFF\n# by hand\n", b"OFF ")).points, XYZ)


@pytest.mark.parametrize("dtype", ["f4", ">f8", "f2", "i2", "i8"])
def test_npy_of_any_numbers(dtype, read):
    xyz = np.round(XYZ).astype(dtype)
    assert np.array_equal(read(samples.npy(xyz)).points, xyz)
    assert np.array_equal(read(samples.npy(np.asfortranarray(xyz))).points, xyz)


def test_npy_with_more_columns_fields_or_rows_of_rows(read):
    scan = read(samples.npy(np.column_stack([XYZ, XYZ])))
    assert np.array_equal(scan.points, XYZ)
    assert "6 columns" in scan.notes[0]
    table = np.zeros(len(XYZ), [("i", "i4"), ("Z", "f8"), ("X", "f4"), ("Y", "f8")])
    table["X"], table["Y"], table["Z"] = XYZ.T
    assert np.array_equal(read(samples.npy(table)).points, XYZ)
    assert np.array_equal(read(samples.npy(XYZ.reshape(3, 4, 3))).points, XYZ)


@pytest.mark.parametrize(
    "arrays",
    [
        {"points": XYZ, "normals": XYZ + 1},
        {"vertices": XYZ, "faces": np.zeros((4, 3), int)},
        {"cloud": XYZ, "labels": np.zeros(12), "wide": np.zeros((4, 5))},
        dict(zip("xyz", XYZ.T, strict=True)),
    ],
)
def test_npz_finds_the_points(arrays, read):
    assert np.array_equal(read(samples.npz(**arrays)).points, XYZ)
    assert read(samples.npz(**arrays, unit=np.array("cm"))).unit == "cm"


# --- LAS, E57 ----------------------------------------------------------------------------------------------------------------


def geo_keys(*entries):
    return ("LASF_Projection", 34735, struct.pack(f"<{4 * len(entries) + 4}H", 1, 1, 0, len(entries), *np.ravel(entries).tolist()))


@pytest.mark.parametrize(
    ("vlr", "unit", "noted"),
    [
        (geo_keys((3076, 0, 1, 9001), (4099, 0, 1, 9001)), "m", ""),
        (geo_keys((3076, 0, 1, 9002)), "ft", ""),
        (geo_keys((3076, 0, 1, 9003)), "ft", "survey"),
        (geo_keys((3076, 0, 1, 9001), (4099, 0, 1, 9002)), "ft", "several"),
        (geo_keys((1024, 0, 1, 2)), "m", "degrees"),
        (("LASF_Projection", 2112, b'PROJCS["a",GEOGCS["b",UNIT["degree",0.0174532925]],UNIT["metre",1]]'), "m", ""),
        (("LASF_Projection", 2112, b'PROJCS["a",UNIT["US survey foot",0.3048006096012192]]\0'), "ft", "survey"),
        (("LASF_Projection", 2112, b'PROJCRS["a",LENGTHUNIT["foot",0.3048]]'), "ft", ""),
        (("LASF_Projection", 2112, b'GEOGCS["b",UNIT["degree",0.0174532925]]'), "m", "degrees"),
    ],
)
def test_las_takes_the_unit_of_its_coordinate_system(vlr, unit, noted, read):
    scan = read(samples.las(XYZ, vlrs=[("other", 7, b"123"), vlr]))
    assert scan.unit == unit
    assert noted in " ".join(scan.notes)
    assert bool(scan.notes) == bool(noted)


def test_las_takes_its_scale_and_offset(read):
    scan = read(samples.las(UTM[:2], scale=0.001, offset=(4e5, 5e6, 0)))
    integers = np.round((UTM[:2] - [4e5, 5e6, 0]) / 0.001)
    assert np.array_equal(scan.points, integers * 0.001 + [4e5, 5e6, 0])


def test_e57_applies_poses_and_keeps_the_rows_of_invalid_points(tmp_path):
    half = np.sqrt(0.5)  # a quarter turn about z: x → y, y → −x
    invalid = np.arange(12) % 4 == 0
    path = tmp_path / "a.e57"
    samples.e57(path, [(XYZ, invalid, (half, 0, 0, half), (4e6, 0, 10)), (XYZ, None, (1, 0, 0, 0), (0, 0, 0))])
    scan = read_scan(path)
    turned = np.column_stack([-XYZ[:, 1] + 4e6, XYZ[:, 0], XYZ[:, 2] + 10])
    turned[invalid] = np.nan
    np.testing.assert_allclose(scan.points, np.concatenate([turned, XYZ]), rtol=0, atol=1e-9)
    assert scan.unit == "m"
    assert "3 points of scan 1 are marked as invalid and kept as empty rows." in scan.notes


# --- large coordinates -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        samples.ply(UTM, "<"),
        samples.ply(UTM, ">"),
        samples.ply(UTM, ""),
        samples.pcd(UTM, "ascii"),
        samples.pcd(UTM, "binary", 8),
        samples.pcd(UTM, "binary_compressed", 8),
        samples.text(UTM),
        samples.text(UTM, ";").replace(b".", b","),
        samples.obj(UTM),
        samples.off(UTM),
        samples.stl_text(UTM),
        samples.npy(UTM),
        samples.npz(points=UTM),
    ],
)
def test_large_coordinates_lose_nothing(content, read):
    assert np.array_equal(read(content).points, UTM)
