"""Files of points, and files that appear whole or not at all."""

from __future__ import annotations

import os
import stat
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scan2nurbs.errors import OutputError, ParameterError
from scan2nurbs.io import atomic_path, read_scan, write_points

SUFFIXES = [".ply", ".npz", ".csv"]
POINTS = np.array([[4e6 + 0.001, 0.1, -1 / 3], [np.nan, np.nan, np.nan], [1e-300, -0.0, 5.0]])
COLUMNS = {
    "strength": np.array([0.1, np.nan, 90], np.float32),
    "residual": np.array([1 / 3, np.nan, -2.5]),
    "edge": np.array([1, 0, 255], np.uint8),
    "face": np.array([2**31 - 1, -1, 0], np.int32),
    "kept": np.array([True, False, True]),
}


def read_columns(path):
    """Read the columns back by other means than ours."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays_:
            return {name: arrays_[name] for name in arrays_.files if name not in {"points", "unit", "comments"}}
    if path.suffix == ".csv":
        table = np.genfromtxt(path, delimiter=",", names=True)
        return {name: table[name] for name in table.dtype.names[3:]}
    head, _, body = path.read_bytes().partition(b"end_header\n")
    types = {"uchar": "u1", "int": "<i4", "float": "<f4", "double": "<f8"}
    fields = [line.split()[1:] for line in head.decode().splitlines() if line.startswith("property")]
    table = np.frombuffer(body, [(name, types[kind]) for kind, name in fields])
    return {name: table[name] for _, name in fields[3:]}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_points_and_columns_come_back_to_the_bit(suffix, tmp_path):
    path = tmp_path / f"out{suffix}"
    write_points(path, POINTS, COLUMNS, unit="in", comments=["by hand", "two\nlines"])
    scan = read_scan(path)
    assert np.array_equal(scan.points, POINTS, equal_nan=True)
    assert scan.unit == (None if suffix == ".csv" else "in")
    columns = read_columns(path)
    assert list(columns) == list(COLUMNS)
    for name, column in COLUMNS.items():
        assert np.array_equal(columns[name].astype(column.dtype), column, equal_nan=True)
        if suffix != ".csv":
            assert columns[name].dtype == (np.uint8 if column.dtype == bool else column.dtype)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_without_columns_and_unit(suffix, tmp_path):
    path = tmp_path / f"OUT{suffix.upper()}"
    write_points(path, POINTS[[0, 2]].tolist(), {})
    scan = read_scan(path)
    assert np.array_equal(scan.points, POINTS[[0, 2]])
    assert scan.unit is None


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_more_points_than_a_chunk(suffix, tmp_path, monkeypatch):
    monkeypatch.setattr("scan2nurbs.io.write._CHUNK", 7)
    points = np.random.default_rng(0).normal(size=(50, 3))
    write_points(tmp_path / f"a{suffix}", points, {"i": np.arange(50, dtype=np.int32)})
    assert np.array_equal(read_scan(tmp_path / f"a{suffix}").points, points)
    assert np.array_equal(read_columns(tmp_path / f"a{suffix}")["i"], np.arange(50))


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(points=arrays(np.float64, st.tuples(st.integers(1, 5), st.just(3)), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_every_float_survives(suffix, points, tmp_path_factory):
    path = tmp_path_factory.mktemp("floats") / f"a{suffix}"
    write_points(path, points, {})
    assert np.array_equal(read_scan(path).points, points)


@pytest.mark.parametrize(
    ("name", "points", "columns", "message"),
    [
        ("a.txt", POINTS, {}, "must be one of .ply, .npz, .csv. Got '.txt'"),
        ("a.ply", POINTS[:, :2], {}, r"must be an \(N, 3\) array. Got the shape \(3, 2\)"),
        ("a.ply", POINTS, {"x": np.zeros(3)}, "Got 'x'"),
        ("a.ply", POINTS, {"two words": np.zeros(3)}, "Got 'two words'"),
        ("a.ply", POINTS, {"a": np.zeros(4)}, r"Got the shape \(4,\)"),
        ("a.ply", POINTS, {"a": np.zeros(3, np.int64)}, "Got int64"),
        ("a.ply", POINTS, {"a": np.array(["a", "b", "c"])}, "Got <U1"),
    ],
)
def test_what_cannot_be_written(name, points, columns, message, tmp_path):
    with pytest.raises(ParameterError, match=message):
        write_points(tmp_path / name, points, columns)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_unit(tmp_path):
    with pytest.raises(ParameterError, match="Got 'parsec'"):
        write_points(tmp_path / "a.ply", POINTS, {}, unit="parsec")


# --- atomic_path -------------------------------------------------------------------------------------------------------------


def test_the_file_appears_with_the_end_of_the_block(tmp_path):
    target = tmp_path / "part.step"
    with atomic_path(target) as temporary:
        assert temporary.suffix == ".step"
        assert temporary.parent == tmp_path
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit, GeneratorExit])
@pytest.mark.parametrize("existed", [True, False])
def test_nothing_is_left_of_a_failure(error, existed, tmp_path):
    target = tmp_path / "part.step"
    if existed:
        target.write_text("old")
    with pytest.raises(error), atomic_path(target) as temporary:  # noqa: PT012 - the block is what is interrupted
        temporary.write_text("half of it")
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ["part.step"] * existed
    if existed:
        assert target.read_text() == "old"


def test_a_writer_that_wrote_nothing_or_removed_the_file(tmp_path):
    with pytest.raises(OutputError, match="Nothing was written"), atomic_path(tmp_path / "a.step"):
        pass
    with pytest.raises(OutputError, match="Nothing was written"), atomic_path(tmp_path / "a.step") as temporary:
        temporary.unlink()
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_and_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match="No space left") as caught, atomic_path(tmp_path / "a.ply"):
        raise OSError(28, "No space left on device")
    assert caught.value.path == tmp_path / "a.ply"
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(tmp_path):
    for path, message in [(tmp_path, "a folder"), (tmp_path / "no" / "a.ply", "does not exist"), (__file__ + "/a.ply", "Not a directory")]:
        with pytest.raises(OutputError, match=message), atomic_path(path):
            pytest.fail("the block must not run")


@pytest.mark.skipif(sys.platform != "linux", reason="devices of Linux")
def test_a_device_is_not_replaced():
    with pytest.raises(OutputError, match="a device"), atomic_path("/dev/null"):
        pytest.fail("the block must not run")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="cannot be written to"), atomic_path(tmp_path / "a.ply"):
            pytest.fail("the block must not run")
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.skipif(sys.platform == "win32", reason="modes and links of POSIX")
def test_mode_links_and_long_names(tmp_path):
    old = os.umask(0o027)
    try:
        with atomic_path(tmp_path / "a.ply") as temporary:
            temporary.write_text("x")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "a.ply").stat().st_mode) == 0o640
    link = tmp_path / "link.ply"
    link.symlink_to("a.ply")
    with atomic_path(link) as temporary:
        temporary.write_text("y")
    assert link.is_symlink()
    assert (tmp_path / "a.ply").read_text() == "y"
    with atomic_path(tmp_path / ("n" * 251 + ".ply")) as temporary:
        temporary.write_text("z")
    assert (tmp_path / ("n" * 251 + ".ply")).read_text() == "z"
