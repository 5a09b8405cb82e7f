"""Tables of points as text, however they are separated, named and ended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import io_samples as samples
from scan2nurbs.io import read_scan
from scan2nurbs.io.source import Source

XYZ = samples.points()


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", ", ", "   ", " ; "])
@pytest.mark.parametrize("extra", ["", "{s}255", "{s}0.5{s}128{s}abc"])
@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
def test_text_with_any_separator(separator, extra, newline, read):
    content = samples.text(XYZ, separator, extra.format(s=separator)).replace(b"\n", newline)
    assert np.array_equal(read(content, ".txt").points, XYZ)


@pytest.mark.parametrize("separator", [" ", "\t", ";"])
def test_text_with_decimal_commas(separator, read):
    scan = read(samples.text(XYZ, separator).replace(b".", b","), ".asc")
    assert np.array_equal(scan.points, XYZ)
    assert "Commas were taken for decimal points." in scan.notes


@pytest.mark.parametrize(
    "before",
    [
        "# made by hand\n",
        "// made by hand\n\n",
        "; made by hand\n",
        "12\n",
        "# n\n12\n",
        "\ufeff",
        "x y z\n",
        "X,Y,Z\n",
        '"x" "y" "z"\n',
        "//X Y Z\n12\n",
    ],
)
def test_text_with_something_before_the_rows(before, read):
    assert np.array_equal(read(samples.text(XYZ, before=before)).points, XYZ)


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("z,id,x,y", None),
        ("Z [mm],Id,X [mm],Y [mm]", "mm"),
        ("z_m,id,x_m,y_m", "m"),
        ("Points:2,Points_Magnitude,Points:0,Points:1", None),
        ("elevation,name,easting,northing", None),
        ('"Z(in)","id","X(in)","Y(in)"', "in"),
    ],
)
def test_text_takes_the_columns_that_the_header_names(header, unit, read):
    rows = np.column_stack([XYZ[:, 2], np.arange(len(XYZ)), XYZ[:, :2]])
    scan = read(samples.text(rows, ",", before=header + "\n"), ".csv")
    assert np.array_equal(scan.points, XYZ)
    assert scan.unit == unit
    assert "the header names" in scan.notes[0]


def test_text_passes_over_words_before_the_numbers(read):
    content = b"".join(b"P%d,%r,%r,%r\n" % (i, *row) for i, row in enumerate(XYZ.tolist()))
    scan = read(content, ".csv")
    assert np.array_equal(scan.points, XYZ)
    assert "columns 2, 3 and 4" in scan.notes[0]


def test_text_keeps_rows_that_are_no_point(read):
    content = b"1 2 3\nnan nan nan\n# a comment\n4 5 6 # another\n\n-1.#IND 0 0\n1.0D+01 2e1 .5\ninf 0 0\n"
    points = read(content).points
    expected = np.array([[1, 2, 3], [np.nan] * 3, [4, 5, 6], [np.nan] * 3, [10, 20, 0.5], [np.nan] * 3])
    assert np.array_equal(points, expected, equal_nan=True)


def test_text_with_missing_values_and_trailing_separators(read):
    points = read(b"x;y;z;i;\n1;2;3;4;\n5;;6;7;\n7;8;9;;\n", ".csv").points
    assert np.array_equal(points, [[1, 2, 3], [np.nan] * 3, [7, 8, 9]], equal_nan=True)


def test_text_in_utf_16(read):
    assert np.array_equal(read(samples.text(XYZ, "\t", before="x\ty\tz\n").decode().encode("utf-16")).points, XYZ)


def test_text_longer_than_a_block_reads_as_one(read, monkeypatch):
    monkeypatch.setattr("scan2nurbs.io.table.BLOCK", 256)
    xyz = samples.points(500)
    content = samples.text(xyz, " ", " 7").replace(b"\n", b" # note\n", 40)
    assert np.array_equal(read(content).points, xyz)
    assert np.array_equal(read(samples.ply(xyz, "")).points, xyz)
    assert np.array_equal(read(samples.obj(xyz)).points, xyz)


@given(st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), min_size=1, max_size=20))
def test_text_reads_every_number_to_the_last_bit(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("bits") / "a.xyz"
    path.write_bytes(samples.text(np.array(rows)))
    assert np.array_equal(read_scan(path).points, rows)


FLOATS = st.floats(-1e9, 1e9).map(lambda value: [repr(value), f"{value:.3f}", f"{value:+.6e}", "nan"][hash(value) % 4])


@given(
    rows=st.integers(3, 5).flatmap(lambda n: st.lists(st.lists(FLOATS, min_size=n, max_size=n), min_size=1, max_size=8)),
    separator=st.sampled_from([" ", "\t", ",", ";"]),
    columns=st.permutations([0, 1, 2]),
)
def test_the_quick_reader_equals_the_careful_one(rows, separator, columns):
    from scan2nurbs.io import table

    block = "".join(separator.join(row) + "\n" for row in rows).encode()
    layout = table.Layout(columns=tuple(columns), width=len(rows[0]), separator=separator.strip(" \t").encode() or None)
    quick = table._parse_fast(block, layout)
    careful = table._parse_lines(Source(Path("a"), block), block, 1, layout, None)
    assert quick is not None
    assert np.array_equal(quick, careful, equal_nan=True)
