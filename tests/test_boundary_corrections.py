"""Corrections by hand: what selections name, and what bad files are told."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scan2nurbs.edges.corrections import Lasso, in_polygon, read_selection
from scan2nurbs.errors import InputError

POINTS = np.array([[0, 0, 0], [5, 5, 0], [5, 5, 9], [20, 0, 0], [np.nan, 0, 0], [1e6, 1e6, 1e6]])


def selected(tmp_path, content):
    path = tmp_path / "selection"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return np.flatnonzero(read_selection(path).of(POINTS)).tolist()


@pytest.mark.parametrize(
    ("content", "rows"),
    [
        ("0 2,3  # the corner\n\n5;1\n", [0, 1, 2, 3, 5]),
        ("[1, 1, 4]", [1, 4]),
        ({"indices": [3]}, [3]),
        ({"boxes": [{"min": [0, 0, 0], "max": [5, 5, 5]}]}, [0, 1]),
        ({"boxes": [{"min": [None, None, 1], "max": [None, None, None]}]}, [2, 5]),
        ({"lassos": [{"view": "xy", "polygon": [[-1, -1], [6, -1], [6, 6], [-1, 6]]}]}, [0, 1, 2]),
        ({"lassos": [{"view": "xy", "polygon": [[-1, -1], [6, -1], [6, 6], [-1, 6]], "depth": [None, 5]}]}, [0, 1]),
        ({"lassos": [{"view": "xz", "polygon": [[4, 8], [6, 8], [6, 10], [4, 10]]}]}, [2]),
        ({"lassos": [{"view": "yz", "polygon": [[4, -1], [6, -1], [6, 1], [4, 1]]}]}, [1]),
        ({"lassos": [{"origin": [5, 5, 0], "u": [0, 0, 2], "v": [1, 0, 7], "polygon": [[-1, -1], [10, -1], [10, 1], [-1, 1]]}]}, [1, 2]),
        ({"indices": [0], "boxes": [{"min": [19, -1, -1], "max": [21, 1, 1]}]}, [0, 3]),
    ],
)
def test_what_a_file_selects(tmp_path, content, rows):
    assert selected(tmp_path, content) == rows


def test_byte_order_mark(tmp_path):
    path = tmp_path / "s.json"
    path.write_bytes(b"\xef\xbb\xbf[2]")
    assert read_selection(path).indices == (2,)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "empty"),
        ("# nothing\n", "names no row"),
        ("0 1\n2 x7\n", "Line 2 .* 'x7'"),
        ("-1", "'-1'"),
        ("1.5", "no row number"),
        ("{", "not valid JSON in line 1"),
        ('{"indices": [1,\n 2', "not valid JSON in line 2"),
        ("[" * 100000, "beyond any use"),
        ("[" + "9" * 5000 + "]", "beyond any use"),
        ("[1, true]", "'True'"),
        ("[-4]", "'-4'"),
        ("[1.0]", "'1.0'"),
        ("{}", "names nothing"),
        ({"box": []}, "unknown key 'box'"),
        ({"boxes": {}}, '"boxes" must be a list'),
        ({"boxes": [{"min": [0, 0, 0]}]}, r"boxes\[0\].max must be a list of 3 numbers"),
        ({"boxes": [{"min": [0, 0, 3], "max": [1, 1, 1]}]}, "min above its max"),
        ({"boxes": [3]}, r"boxes\[0\] must be an object"),
        ('{"boxes": [{"min": [0, 0, NaN], "max": [1, 1, 1]}]}', "finite"),
        ('{"boxes": [{"min": [0, 0, -1e999], "max": [1, 1, 1]}]}', "finite"),
        ({"lassos": [{"view": "xy", "polygon": [[0, 0], [1, 1]]}]}, "at least 3 corners"),
        ({"lassos": [{"view": "top", "polygon": [[0, 0], [1, 1], [0, 1]]}]}, "must be one of xy, xz, yz"),
        ({"lassos": [{"view": [], "polygon": [[0, 0], [1, 1], [0, 1]]}]}, "must be one of xy, xz, yz"),
        ({"lassos": [{"view": "xy", "u": [1, 0, 0], "polygon": [[0, 0], [1, 1], [0, 1]]}]}, "both a named view and a plane"),
        ({"lassos": [{"origin": [0, 0, 0], "u": [1, 0, 0], "v": [2, 0, 0], "polygon": [[0, 0], [1, 1], [0, 1]]}]}, "span a plane"),
        ({"lassos": [{"origin": [0, 0, 0], "u": [0, 0, 0], "v": [2, 0, 0], "polygon": [[0, 0], [1, 1], [0, 1]]}]}, "span a plane"),
        ({"lassos": [{"view": "xy", "polygon": [[0, 0], [1, None], [0, 1]]}]}, r"polygon\[1\]"),
        ({"lassos": [{"view": "xy", "polygon": [[0, 0], [1, 1], [0, 1]], "depth": [3, 1]}]}, "lower end above"),
        ({"lassos": [{"view": "xy", "polygon": [[0, 0], [1, 1], [0, 1]], "depth": 3}]}, "depth must be a list"),
        ("[6]", "index 6 names no row: the input has 6 rows"),
    ],
)
def test_bad_files_are_told_what_is_wrong(tmp_path, content, message):
    with pytest.raises(InputError, match=message) as caught:
        selected(tmp_path, content)
    assert caught.value.path == tmp_path / "selection"


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_selection(tmp_path / "none")
    with pytest.raises(InputError, match="cannot be read"):
        read_selection(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="not UTF-8"):
        read_selection(tmp_path / "binary")


@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_lasso_moves_with_its_plane(seed, n):
    rng = np.random.default_rng(seed)
    polygon = rng.normal(size=(n, 2))
    points = rng.normal(size=(100, 3))
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
    corners = tuple(map(tuple, polygon))
    flat = Lasso((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), corners, (-0.5, 1.0))
    turned = Lasso((3.0, 4.0, 5.0), tuple(frame[:, 0]), tuple(frame[:, 1]), corners, (-0.5, 1.0))
    np.testing.assert_array_equal(turned.contains(points @ frame.T + [3.0, 4.0, 5.0]), flat.contains(points))


@given(st.integers(0, 2**32 - 1), st.integers(3, 9))
def test_in_polygon_counts_crossings(seed, n):
    """A twin that winds: for a star-shaped polygon inside means nearer to the centre than the side in that direction."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
    if np.diff(np.r_[angle, angle[0] + 2.0 * np.pi]).max() > 0.95 * np.pi:
        return
    polygon = rng.uniform(0.5, 2.0, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = rng.uniform(-2.0, 2.0, (200, 2))
    expected = np.zeros(200, bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        weights = np.linalg.solve(np.stack([a, b], axis=1), points.T)
        expected |= (weights >= 0.0).all(axis=0) & (weights.sum(axis=0) < 1.0)
    np.testing.assert_array_equal(in_polygon(points, polygon), expected)
