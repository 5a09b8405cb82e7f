"""Empty, truncated, lying, contradicting and foreign files: one clear sentence, and no memory for what a header merely claims."""

from __future__ import annotations

import gzip
import io
import re
import struct
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

import io_samples as samples
from io_samples import NAMES
from scan2nurbs.errors import InputError, MissingExtraError
from scan2nurbs.io import read_scan
from scan2nurbs.io.lzf import LzfError, unpack_lzf

XYZ = samples.points()
PLY = samples.ply(XYZ, faces=False)
ASCII_PLY = samples.ply(XYZ, "", faces=False)


@pytest.fixture
def fault(tmp_path):
    """Read content that cannot be read; return the error."""

    def fault(content: bytes, suffix=".bin") -> InputError:
        path = tmp_path / f"file{suffix}"
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            read_scan(path)
        assert caught.value.path == path
        assert str(caught.value).startswith(f"{path}: ")
        return caught.value

    return fault


# --- the file itself ---------------------------------------------------------------------------------------------------------


def test_missing_folder_device_empty(tmp_path, fault):
    with pytest.raises(InputError, match="no such file"):
        read_scan(tmp_path / "missing.ply")
    with pytest.raises(InputError, match="a folder"):
        read_scan(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        read_scan(tmp_path / "missing" / "a.ply")
    with pytest.raises(InputError, match=r"cannot be read|no such file"):
        read_scan("a\0b.ply")
    if sys.platform == "linux":
        with pytest.raises(InputError, match="a device"):
            read_scan("/dev/null")
    assert "empty" in fault(b"", ".ply").message


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "JPEG"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG"),
        (b"%PDF-1.7\n", "PDF"),
        (b"ISO-10303-21;\nHEADER;\n", "STEP"),
        (b"DBRep_DrawableShape\n\nCASCADE Topology V1", "BREP"),
        (b" " * 72 + b"S      1\n", "IGES"),
        (b"<!DOCTYPE html>\n<html>", "HTML"),
        (b"  <html><body>404", "HTML"),
        (b"<?xml version='1.0'?><X3D/>", "XML"),
        (b'{"points": [[1, 2, 3]]}', "JSON"),
        (b"# vtk DataFile Version 3.0\nx\nASCII", "VTK"),
        (b"glTF\2\0\0\0", "glTF"),
        (b"BZh91AY&SY", "bzip2"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 12\n", "Git LFS"),
        (gzip.compress(gzip.compress(b"1 2 3\n", mtime=0), mtime=0), "gzip inside gzip"),
    ],
)
@pytest.mark.parametrize("suffix", [".ply", ".xyz", ".stl", ""])
def test_foreign_files_are_named(content, name, suffix, fault):
    assert name in fault(content, suffix).message


@pytest.mark.parametrize(("member", "name"), [("a.txt", "ZIP"), ("3D/3dmodel.model", "3MF"), ("xl/workbook.xml", "Excel")])
def test_foreign_archives_are_named(member, name, fault):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(member, "1 2 3")
    assert name in fault(stream.getvalue()).message


def test_noise_and_prose_are_no_points(fault):
    assert "no known format" in fault(bytes(range(256)) * 4).message
    assert "no PLY" in fault(b"This is not a mesh\nat all\n", ".ply").message
    assert "three numbers" in fault(b"Dear Sir,\nI beg to differ.\n", ".txt").message


def test_gzip_truncated_damaged_empty_and_a_bomb(fault, monkeypatch):
    packed = gzip.compress(samples.text(XYZ), mtime=0)
    assert "truncated" in fault(packed[:-12], ".xyz.gz").message
    assert "truncated" in fault(packed[:10], ".xyz.gz").message
    assert "damaged" in fault(packed[:-8] + b"\1" * 8, ".xyz.gz").message
    assert "nothing" in fault(gzip.compress(b"")).message
    monkeypatch.setattr("scan2nurbs.io.source.UNPACKED_ALWAYS_ALLOWED", 1 << 20)
    assert "unpacks to more" in fault(gzip.compress(bytes(1 << 23))).message


@pytest.mark.parametrize("name", [name for name in NAMES if name not in {"xyz", "csv", "semicolon", "obj"}])
def test_no_truncated_file_of_a_counted_format_passes(name, every_format, fault):
    suffix, content = every_format[name]
    body = {"ply ascii": ASCII_PLY, "ply little": PLY}.get(name, content)
    # What is behind the points may be missing, and of a last number in text nobody knows whether it is whole.
    end = {"ply big": -37, "ply element before": -37, "ply ascii": -15, "off": -25, "stl ascii": -20}.get(name, -3)
    for stop in (end, len(body) // 2, 60, 12, 5):
        fault(body[:stop], suffix)


# --- lying headers -----------------------------------------------------------------------------------------------------------


def edit(content: bytes, old: bytes, new: bytes) -> bytes:
    assert content.count(old) >= 1, old
    return content.replace(old, new, 1)


HUGE = b"99999999999"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (edit(PLY, b"vertex 12", b"vertex 13"), "declares 13 vertices, the payload ends after 12"),
        (edit(PLY, b"vertex 12", b"vertex " + HUGE), "declares 99,999,999,999 vertices, the payload ends after 12"),
        (edit(PLY, b"vertex 12", b"vertex -1"), "cannot be understood: 'element vertex -1'"),
        (edit(PLY, b"vertex 12", b"vertex nan"), "cannot be understood"),
        (edit(PLY, b"vertex 12", b"vertex " + b"9" * 400), "cannot be understood"),
        (edit(PLY, b"vertex 12", b"vertex 0"), "declares 0 vertices"),
        (edit(PLY, b"double z", b"double w"), "no property 'z'"),
        (edit(PLY, b"double z", b"double x"), "2 property 'x'"),
        (edit(PLY, b"property double z", b"property list uchar float z"), "is a list"),
        (edit(PLY, b"double z", b"quad z"), "cannot be understood"),
        (edit(PLY, b"element vertex", b"element point"), "no element 'vertex'"),
        (edit(PLY, b"end_header", b"element vertex 1\nend_header"), "an element twice"),
        (edit(PLY, b"format binary_little_endian 1.0\n", b""), "no line 'format'"),
        (edit(PLY, b"end_header", b"end_of_it"), "does not end"),
        (edit(PLY, b"element vertex", b"element a " + HUGE + b"\nproperty list uchar int i\nelement vertex"), "rows of 'a'"),
        (edit(ASCII_PLY, b"vertex 12", b"vertex " + HUGE), "declares 99,999,999,999 vertices, the file ends after 12"),
        (edit(ASCII_PLY, b"element vertex", b"element a " + HUGE + b"\nproperty int i\nelement vertex"), "ends before the points begin"),
        (edit(ASCII_PLY, b"-", b"x"), "is no number"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n",
            "ends after 1",
        ),
        (edit(samples.pcd(XYZ, header={"WIDTH": ""}), b"POINTS 12", b"POINTS " + HUGE), "ends after 12"),
        (samples.pcd(XYZ, "binary", header={"WIDTH": "", "POINTS": HUGE.decode()}), "the payload ends after 12"),
        (samples.pcd(XYZ, "binary_compressed", header={"WIDTH": "", "POINTS": HUGE.decode()}), "the payload ends after 12"),
        (samples.pcd(XYZ, "binary", header={"WIDTH": HUGE.decode(), "HEIGHT": HUGE.decode(), "POINTS": "13"}), "ends after 12"),
        (samples.pcd(XYZ, "binary", header={"WIDTH": "2", "POINTS": "3"}), "the payload holds neither"),
        (samples.pcd(XYZ, header={"POINTS": "-3"}), "must be whole numbers"),
        (samples.pcd(XYZ, header={"POINTS": "0", "WIDTH": "0"}), "declares 0 points"),
        (samples.pcd(XYZ, header={"POINTS": "", "WIDTH": ""}), "neither POINTS nor WIDTH"),
        (samples.pcd(XYZ, header={"FIELDS": "rgb x y y normal"}), "must name one field 'y'"),
        (samples.pcd(XYZ, header={"FIELDS": "rgb x y normal"}), "names 4 fields, but 5 sizes"),
        (samples.pcd(XYZ, header={"SIZE": "4 3 4 4 4"}), "a field of F3"),
        (samples.pcd(XYZ, header={"COUNT": "1 1 1 1 99999999999"}), "99999999999"),
        (samples.pcd(XYZ, "zip"), "none of ascii"),
        (edit(samples.pcd(XYZ), b"WIDTH", b"POINTS 12\nPOINTS"), "stands twice"),
        (edit(samples.pcd(XYZ), b"DATA ascii\n", b""), "no entry of|does not end"),
        (b"12\n1 2 3\n4 5 6\n", "declares 12 points, the file ends after 2"),
        (b"1 2 3\n4 5\n7 8 9\n", "Line 2 has 2 columns instead of 3"),
        (b"1 2 3\n\n# c\n4 5 6 7\n", "Line 4 has 4 columns instead of 3"),
        (b"1,2,3,a\n4,5,6\n", "Line 2 has 3 columns instead of 4"),
        (b"1,2,3,a\n4,5,6\n7,8,9,b,c\n", "Line 2 has 3 columns instead of 4"),
        (b"x y z\n1 2 3\n1 two 3\n", "Line 3: 'two' is no number"),
        (b"1 2 3\n1_0 2 3\n", "Line 2: '1_0' is no number"),
        (b"1 two 3\n1 2 3\n", "three numbers"),
        (b"1 2\n3 4\n", "three numbers"),
        (b"# nothing\n\n", "holds no points"),
        (b"x y z\n", "holds no points"),
        (samples.stl_text(XYZ)[:-20], "truncated"),
        (b"solid a\nendsolid a\n", "no triangles"),
        (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2\n", "Line 4 has 2 columns instead of at least 3"),
        (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex \n", "Line 4"),
        (b"v 1 2 3\nvn 1 2 3\nv 4 5\n", "Line 3 has 2 columns"),
        (b"o part\nvn 1 2 3\n", "no vertices"),
        (edit(samples.off(XYZ), b"\n12 ", b"\n" + HUGE + b" "), "declares 99,999,999,999 vertices"),
        (edit(samples.off(XYZ), b"\n12 ", b"\n-12 "), "counts vertices"),
        (samples.off(XYZ, "4OFF"), "not three-dimensional"),
        (b"OFF\n", "does not end"),
        (samples.off_binary(XYZ)[:-1], "declares 12 vertices, the payload can hold 11"),
        (edit(samples.npy(XYZ), b"(12, 3)", b"(99999999, 3)"), "the payload ends after"),
        (edit(samples.npy(XYZ), b"(12, 3)", b"(-12, 3)"), "negative shape"),
        (edit(samples.npy(XYZ), b"(12, 3)", b"(18, 2)"), "must be of numbers in"),
        (edit(samples.npy(XYZ), b"'<f8'", b"'|O8'"), "never unpickled"),
        (edit(samples.npy(XYZ), b"'<f8'", b"'<c8'"), "must be of numbers"),
        (edit(samples.npy(XYZ), b"'shape'", b"'shapE'"), "damaged NPY header"),
        (samples.npy(np.zeros((3, 500))), "transpose"),
        (samples.npy(np.zeros((0, 3))), "no points"),
        (samples.npy(np.array(["a"])), "must be of numbers"),
        (samples.npz(a=XYZ, b=XYZ), "several"),
        (samples.npz(a=XYZ[:, :2], b=XYZ[0]), "no (N, 3) array"),
        (samples.npz(x=XYZ[:, 0], y=XYZ[:, 1], z=XYZ[:3, 2]), "equally many"),
        (edit(samples.las(XYZ), struct.pack("<HI", 20, 12), struct.pack("<HI", 20, 2**32 - 1)), "the payload ends after 12"),
        (edit(samples.las(XYZ), struct.pack("<HI", 20, 12), struct.pack("<HI", 2, 12)), "at least 20 bytes"),
        (edit(samples.las(XYZ), struct.pack("<HI", 20, 12), struct.pack("<HI", 20, 0)), "declares 0 points"),
        (edit(samples.las(XYZ), struct.pack("<HII", 227, 227, 0), struct.pack("<HII", 227, 227, 2**31)), "do not fit before the points"),
        (edit(samples.las(XYZ), struct.pack("<d", 1 / 16), struct.pack("<d", np.nan)), "no usable numbers"),
        (edit(samples.las(XYZ), b"\1\2", b"\3\2"), "version 3.2"),
        (edit(samples.laz(XYZ), struct.pack("<HI", 20, 12), struct.pack("<HI", 20, 2**31)), "cannot hold"),
        (edit(samples.laz(XYZ), b"laszip encoded", b"laszip erased "), "'laszip encoded' is missing"),
    ],
)
def test_headers_that_lie(content, message, fault):
    tracemalloc.start()
    try:
        assert re.search(message if "|" in message else re.escape(message), fault(content).message)
        assert tracemalloc.get_traced_memory()[1] < 20e6  # the import of laspy included
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "content",
    [
        edit(PLY, b"end_header", b"element face " + HUGE + b"\nproperty list uchar int i\nend_header"),
        edit(PLY, b"element vertex", b"element nothing " + HUGE + b"\nelement vertex"),
        edit(samples.pcd(XYZ), b"POINTS 12", b"POINTS 13"),
        edit(ASCII_PLY, b"double x", b"uchar x"),
    ],
)
def test_lies_that_do_no_harm(content, tmp_path):
    (tmp_path / "file").write_bytes(content)
    assert np.array_equal(read_scan(tmp_path / "file").points, XYZ)


def test_faults_tell_where(fault):
    assert fault(b"1 2 3\n4 5\n").offset == 2
    content = edit(PLY, b"vertex 12", b"vertex 13")
    assert fault(content).offset == len(content)


def test_a_line_without_end(fault, monkeypatch):
    assert "Line 1 is longer than" in fault(b"1 2 3 " * 20000, ".xyz").message
    monkeypatch.setattr("scan2nurbs.io.table.BLOCK", 1 << 16)
    assert "Line 2 is longer than" in fault(b"1 2 3\n" + b"1 2 3 " * 20000, ".xyz").message
    assert "longer than" in fault(b"v 1 2 3\nv " + b"1 2 3 " * 20000, ".obj").message


def test_binary_stl_shorter_than_declared_or_its_header(fault):
    assert "declares 4 triangles, the payload ends after 3" in fault(samples.stl(XYZ)[:-1], ".stl").message
    assert "a header of 84 bytes" in fault(b"\0binary", ".stl").message
    assert "declares 0 triangles" in fault(bytes(84), ".stl").message


def test_an_npz_bomb(fault, monkeypatch):
    monkeypatch.setattr("scan2nurbs.io.source.UNPACKED_ALWAYS_ALLOWED", 1 << 20)
    assert "far more than its size" in fault(samples.npz(points=np.zeros((400000, 3)))).message


@pytest.mark.parametrize(
    ("packed", "size", "message"),
    [
        (b"\x05abc", 6, "end within a run"),
        (b"\x00a\x20", 4, "end within a reference"),
        (b"\x00a\xe0\x01", 10, "end within a reference"),
        (b"\x00a\x20\x05", 4, "before them"),
        (b"\x02abc", 2, "more than 2"),
        (b"\x02abc", 4, "3 bytes instead of 4"),
    ],
)
def test_damaged_lzf(packed, size, message):
    with pytest.raises(LzfError, match=message):
        unpack_lzf(packed, size)


def test_a_compressed_pcd_that_claims_the_impossible(fault):
    content = samples.pcd(XYZ, "binary_compressed", header={"WIDTH": "", "POINTS": "100000000"})
    start = content.index(b"DATA binary_compressed\n") + 23
    lying = content[:start] + content[start : start + 4] + struct.pack("<I", 2_800_000_000) + content[start + 8 :]
    assert "cannot hold" in fault(lying).message


@pytest.mark.parametrize(("suffix", "module", "extra"), [(".laz", "laspy", "las"), (".e57", "pye57", "e57")])
def test_a_missing_extra_says_how_to_get_it(suffix, module, extra, every_format, tmp_path, monkeypatch):
    content = next(content for known, content in every_format.values() if known == suffix)
    (tmp_path / f"a{suffix}").write_bytes(content)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'scan2nurbs\[{extra}\]'") as caught:
        read_scan(tmp_path / f"a{suffix}")
    assert caught.value.extra == extra


def test_e57_declares_entities(every_format, fault):
    _, content = every_format["e57"]
    assert "entities" in fault(edit(content, b"<e57Root", b"<!ENTITY")).message
