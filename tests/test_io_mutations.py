"""Whatever bytes a file holds, a reader returns points or raises an InputError."""

from __future__ import annotations

import gzip
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from io_samples import NAMES
from scan2nurbs.errors import InputError
from scan2nurbs.io import FORMATS, read_scan

NUMBERS = ["-1", "0", "1", "2", "11", "13", "255", "4294967295", "99999999999999999999", "nan", "1e9", "", "x"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("mutations")


def survives(folder, content, suffix) -> bool:
    """Read the content; tell whether what came out is points, or an error as errors should be."""
    path = folder / f"file{suffix}"
    path.write_bytes(content)
    try:
        scan = read_scan(path)
    except InputError as error:
        return (error.path, "\n" in error.message) == (path, False)
    # Either a whole point or none: no row is half empty.
    empty = np.isnan(scan.points)
    whole = np.array_equal(empty.any(axis=1), empty.all(axis=1)) and bool(np.isfinite(scan.points[~empty]).all())
    return whole and scan.points.dtype == np.float64 and scan.points.shape == (len(scan.points), 3) and len(scan.points) > 0


@st.composite
def mutations(draw, content: bytes) -> bytes:
    """Flip, cut out, insert and repeat bytes, mostly near the beginning, where headers are."""
    changed = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        span = min(len(changed), draw(st.sampled_from([64, 400, 1 << 30])))
        at = draw(st.integers(0, max(0, span - 1)))
        match draw(st.sampled_from(["flip", "cut", "insert", "delete", "extreme"])):
            case "flip" if changed:
                changed[at] ^= 1 << draw(st.integers(0, 7))
            case "cut":
                del changed[at:]
            case "insert":
                changed[at:at] = draw(st.binary(min_size=1, max_size=8))
            case "delete":
                del changed[at : at + draw(st.integers(1, 16))]
            case "extreme":
                changed[at : at + 4] = draw(st.sampled_from([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\0\x80"]))
    return bytes(changed)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=60)
@given(data=st.data())
def test_mutated_files(name, every_format, folder, data):
    suffix, content = every_format[name]
    assert survives(folder, data.draw(mutations(content)), suffix)


@pytest.mark.parametrize("name", [n for n in NAMES if n.startswith(("ply", "pcd", "off", "stl ascii", "pts", "npy"))])
@given(data=st.data())
def test_mutated_header_numbers(name, every_format, folder, data):
    suffix, content = every_format[name]
    numbers = list(re.finditer(rb"\d+", content[:400]))
    chosen = data.draw(st.sampled_from(numbers))
    number = data.draw(st.sampled_from(NUMBERS)).encode()
    assert survives(folder, content[: chosen.start()] + number + content[chosen.end() :], suffix)


@given(text=st.text(alphabet=" \t\n\r,;.#-+eE0123456789nax/\"'%\ufeffé", max_size=200))
def test_arbitrary_text(text, folder):
    assert survives(folder, text.encode(), ".txt")


@given(content=st.binary(max_size=300), suffix=st.sampled_from([s for known in FORMATS for s in known.suffixes] + ["", ".csv"]))
def test_arbitrary_bytes(content, suffix, folder):
    assert survives(folder, content, suffix)


@given(
    magic=st.sampled_from(
        [b"ply\n", b"# .PCD v0.7\n", b"LASF", b"ASTM-E57", b"\x93NUMPY", b"PK\3\4x.npy", b"OFF\n", b"solid a\nfacet", b"v 1 2 3\n"]
    ),
    content=st.binary(max_size=400),
    packed=st.booleans(),
)
def test_arbitrary_bytes_behind_a_magic_word(magic, content, packed, folder):
    assert survives(folder, gzip.compress(magic + content) if packed else magic + content, "")
