"""Tables of points as text, however they are separated, named and ended."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import io_samples as samples
from scan2nurbs.errors import InputError
from scan2nurbs.io import read_scan, table
from scan2nurbs.io.layout import Layout
from scan2nurbs.io.quick import read_quickly
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
        ("z [m],id,x,y", "m"),
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


@pytest.mark.parametrize(
    "rows",
    [b"1,2,3,\n5,6,7,8\n", b"1,2,3,4\n5,6,7,\n", b"1,2,3,\n5,6,7,\n", b"1,2,3,,\n5,6,7,8,\n"],
    ids=["first", "last", "all", "closed"],
)
def test_text_whose_last_column_is_empty_in_some_rows(rows, read):
    assert read(b"x,y,z,i\n" + rows, ".csv").points.tolist() == [[1, 2, 3], [5, 6, 7]]


def test_text_whose_first_row_is_empty(read):
    points = read(b"x,y,z\n,,\n1,2,3\n4,5,6\n", ".csv").points
    assert np.array_equal(points, [[np.nan] * 3, [1, 2, 3], [4, 5, 6]], equal_nan=True)


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


def careful(block: bytes, layout: Layout) -> np.ndarray | None:
    try:
        return np.stack(table._parse_lines(Source(Path("a"), block), block, 1, layout, None), axis=1)
    except InputError:
        return None


def quick_rows(block: bytes, layout: Layout, *, long: bool) -> np.ndarray | None:
    columns = read_quickly(block, layout, long=long)
    return None if columns is None else np.stack(columns, axis=1)


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Tell whether arrays are equal to the last bit, whatever the bits of their NaN."""
    undefined = np.isnan(a)
    return a.shape == b.shape and np.array_equal(undefined, np.isnan(b)) and a[~undefined].tobytes() == b[~undefined].tobytes()


FLOATS = st.floats(-1e9, 1e9).map(lambda value: [repr(value), f"{value:.3f}", f"{value:+.6e}", "nan"][hash(value) % 4])


@pytest.mark.parametrize("long", [False, True])
@given(
    rows=st.integers(3, 5).flatmap(lambda n: st.lists(st.lists(FLOATS, min_size=n, max_size=n), min_size=1, max_size=8)),
    separator=st.sampled_from([" ", "\t", ",", ";", "  ", " \t"]),
    columns=st.permutations([0, 1, 2]),
    around=st.sampled_from(["", " ", "\r", "trailing"]),
)
def test_the_quick_readers_take_rows_of_numbers(long, rows, separator, columns, around):
    known = separator.strip(" \t").encode() or None
    behind = around.replace("trailing", separator) if known is None else around.replace("trailing", f"{separator}\r").strip(" ")
    before = behind.strip("\r") if known is None else around.replace("trailing", "").strip("\r")  # a separator there makes a column
    block = "".join(before + separator.join(row) + behind + "\n" for row in rows).encode()
    layout = Layout(columns=tuple(columns), width=len(rows[0]), separator=known)
    quick = quick_rows(block, layout, long=long)
    expected = careful(block, layout)
    assert quick is not None
    assert expected is not None
    assert same(quick, expected)


WORDS = [
    *["inf", "-Infinity", "NaN", "nan(1)", "null", "NA", "-1.#IND", "1e400", "-1e-400", "5.", ".5", "+3e2", "1d3", "-0", "4.9e-324"],
    *["123456789012345678901234567890", "0.1000000000000000055511151231257827", "2.2250738585072011e-308", "9007199254740993"],
    *["", "abc", "é", '"1"', "1_0", "0x1p3", "1e", "--1", ".", "1.2.3", "1,5", "1\x1f", "\xa01", "\x00", "\ufeff1", "x^", "(", "True"],
    *["#", "#1", "1#", "//", "%", "!", ";", "1\r", "\v2", " 3", "4 "],
]
TOKENS = st.one_of(FLOATS, FLOATS, FLOATS, st.sampled_from(WORDS), st.text("0123456789+-.eE", max_size=6))
LINES = st.one_of(
    st.tuples(
        st.sampled_from(["", "", " ", "\t"]), st.lists(TOKENS, min_size=2, max_size=6), st.sampled_from(["", "", " ", "\r", " # c", "#"])
    ),
    st.sampled_from([("", [], ""), (" ", [], ""), ("# ", ["1", "2", "3"], ""), ("; ", ["1", "2", "3"], "")]),
)


@pytest.mark.parametrize(("long", "seen"), [(False, 4096), (True, 4096), (True, 0)])
@settings(max_examples=400)
@given(
    lines=st.lists(LINES, min_size=1, max_size=4),
    separator=st.sampled_from([None, None, b",", b";", b"\t"]),
    columns=st.permutations([0, 1, 2, 3]),
    width=st.sampled_from([None, 3, 4, 5]),
    decimal_comma=st.booleans(),
    gap=st.sampled_from(["", "", " "]),
    end=st.sampled_from(["\n", "", "\r\n", "\n\n"]),
)
def test_the_quick_readers_decline_what_they_would_read_otherwise(long, seen, lines, separator, columns, width, decimal_comma, gap, end):
    mark = (separator or b" ").decode()
    between = [gap + mark + gap, mark]  # columns that are padded in some lines only
    block = ("\n".join(before + between[k % 2].join(tokens) + behind for k, (before, tokens, behind) in enumerate(lines)) + end).encode()
    wanted = tuple(column for column in columns if width is None or column < width)[:3]
    layout = Layout(columns=wanted, width=width, separator=separator, decimal_comma=decimal_comma and separator != b",")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scan2nurbs.io.quick._SEEN", seen)
        quick = quick_rows(block, layout, long=long) if block.strip() else None
    if quick is not None:
        expected = careful(block, layout)
        assert expected is not None
        assert same(quick, expected)


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize(("last", "read"), [("4;5;6;", True), ("4;5;6", True), ("4;5;6;;", False), ("4;5;", False), ("4;5;;", False)])
@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
def test_separators_at_the_ends_of_lines(long, last, read, end):
    block = f"1;2;3;{end or chr(10)}{last}{end}".encode()
    layout = Layout(width=3, separator=b";")
    quick, expected = quick_rows(block, layout, long=long), careful(block, layout)
    assert (quick is not None) == read
    if quick is not None:
        assert expected is not None
        assert same(quick, expected)


@pytest.mark.parametrize("long", [False, True])
@pytest.mark.parametrize(("row", "columns"), [("  \t4\t5\t6", (1, 2, 3)), ("4\t5\t6\t ", (0, 1, 2)), ("\t4\t5\t6", (1, 2, 3))])
def test_blanks_about_a_row_are_no_column(long, row, columns):
    block = f"1\t2\t3\t4\n{row}\n5\t6\t7\t8\n".encode()
    layout = Layout(columns=columns, width=4, separator=b"\t")
    assert careful(block, layout) is None
    assert read_quickly(block, layout, long=long) is None


@pytest.mark.parametrize("word", WORDS)
def test_long_texts_read_every_word_as_short_ones_do(word, read, monkeypatch):
    def outcome(content: bytes) -> object:
        try:
            return np.nan_to_num(read(content, ".csv").points, nan=-1.0).tobytes()
        except InputError as error:
            return error.message

    content = f"x,y,z\n1,2,3\n4,{word},6\n7,8,9\n".encode() + b"1,2,3\n" * 40
    short = outcome(content)
    monkeypatch.setattr("scan2nurbs.io.table.BLOCK", 64)
    assert outcome(content) == short


@pytest.mark.parametrize("quick_block", [64, 100, 300, 1 << 24])
def test_a_note_in_a_long_text_does_not_spoil_its_rows(quick_block, read, monkeypatch):
    monkeypatch.setattr("scan2nurbs.io.table.BLOCK", 64)
    monkeypatch.setattr("scan2nurbs.io.table.QUICK_BLOCK", quick_block)
    xyz = np.round(samples.points(200), 3)
    rows = [b"%.3f %.3f %.3f" % tuple(row) for row in xyz]
    rows[70] += b"  # looked at twice"
    rows[120:120] = [b"", b"# a second scan"]
    assert np.array_equal(read(b"\n".join(rows), ".xyz").points, xyz)
    header = b"ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\nproperty float z\n"
    tail = b"element face 1\nproperty list uchar int vertex_index\nend_header\n"
    rows = [row for row in rows if row and b"#" not in row]
    rows.insert(70, b"%.3f %.3f %.3f" % tuple(xyz[70]))
    assert np.array_equal(read(header + tail + b"\n".join([*rows, b"3 0 1 2"]), ".ply").points, xyz)


@pytest.mark.parametrize("quick_block", [64, 100, 300, 1 << 24])
def test_a_fault_in_a_long_text_names_its_line(quick_block, read, monkeypatch):
    monkeypatch.setattr("scan2nurbs.io.table.BLOCK", 64)
    monkeypatch.setattr("scan2nurbs.io.table.QUICK_BLOCK", quick_block)
    rows = [b"1.5 2.5 3.5"] * 40
    rows[29] = b"1.5 2.5"
    with pytest.raises(InputError) as error:
        read(b"\n".join(rows), ".xyz")
    assert (error.value.message, error.value.offset) == ("Line 30 has 2 columns instead of 3.", 30)


def test_long_texts_are_the_same_with_any_number_of_threads(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_bytes(samples.text(np.random.default_rng(3).normal(size=(200_000, 3))))
    assert path.stat().st_size > 2 * table.BLOCK
    code = (
        "import sys, hashlib; from scan2nurbs.io import read_scan\n"
        "print(hashlib.sha256(read_scan(sys.argv[1]).points.tobytes()).hexdigest(), 'polars' in sys.modules)"
    )
    told = {
        subprocess.run(
            [sys.executable, "-c", code, str(path)],
            env=os.environ | {"POLARS_MAX_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "3")
    }
    assert told == {hashlib.sha256(np.loadtxt(path).tobytes()).hexdigest() + " True\n"}


def test_short_texts_do_not_wait_for_the_reader_of_long_ones(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_bytes(samples.text(XYZ))
    code = "import sys; from scan2nurbs.io import read_scan; read_scan(sys.argv[1]); print('polars' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True).stdout == "False\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"x","y","z"\n"2,7392","-4,6043","9,18"\n"2,5","4,5","1,5"\n', "commas within quotes"),
        ("id x y z\n0 1.2 3.4 5.6 17\n1 1.3 3.4 5.6 17\n", r"names 4 columns, the rows below it have 5"),
        ("x,y,z\n0.5,1.2,3.4,5.6\n1.5,1.3,3.4,5.6\n", r"names 3 columns, the rows below it have 4"),
        ("x [mm],y [mm],z [m]\n0.5,1.2,3.4\n1.5,1.3,3.4\n", r"different units: x \[mm\], y \[mm\], z \[m\]"),
    ],
)
def test_what_a_header_or_quotes_say_is_not_passed_over(tmp_path, text, said):
    path = tmp_path / "scan.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read_scan(path)
    assert caught.value.offset == 2 or "quotes" in said
