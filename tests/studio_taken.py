"""Everything that can be taken away from a studio, and read back."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from scan2nurbs.brep.check import check
from scan2nurbs.brep.read import faces_of, read_shape
from scan2nurbs.io import read_scan
from studio_server import Studio, hear, say

TYPES = {"double": "<f8", "float": "<f4", "int": "<i4", "uchar": "u1"}


def taken_away(studio: Studio, page, folder: Path) -> dict[str, Path]:
    """Export in every other format that there is, and download the files."""
    folder.mkdir()
    cookie, files = studio.cookie(), {}
    for kind in hear_welcome(studio, cookie):
        say(page, "Export", kind=kind["name"])
        name = f"step{kind['suffix']}"
        hear(page, "State", lambda state, name=name: name in [file["name"] for file in state["files"]] and state["running"] is None)
        status, _, content = studio.ask("GET", f"/files/{name}", Cookie=cookie)
        assert status == 200
        files[kind["name"]] = folder / name
        files[kind["name"]].write_bytes(content)
    return files


def hear_welcome(studio: Studio, cookie: str) -> list[dict]:
    with studio.page(cookie) as page:
        return [kind for kind in hear(page, "Welcome")["exports"] if kind["available"]]


def read_back(taken: dict[str, Path], scan: Path, exported: bytes) -> set[int]:
    """Check that each file holds what was scanned; return the numbers of the faces."""
    assert {"step", "step-ap214", "iges", "brep", "stl", "points", "report"} <= taken.keys()
    assert taken["step"].read_bytes() == exported
    labelled = ply_columns(taken["points"])
    face, strength, deviation = labelled["face"], labelled["strength"], labelled["deviation"]
    given = read_scan(scan).points
    kept = np.isfinite(given).all(axis=1)
    np.testing.assert_allclose(read_scan(taken["points"]).points, given, atol=1e-9)
    assert (face[~kept] == -1).all()
    assert np.abs(deviation[face >= 0]).max() < 1.0
    assert (strength[labelled["edge"].astype(bool)] > 12).all()
    low, high = given[kept].min(axis=0), given[kept].max(axis=0)
    numbers = {int(number) for number in np.unique(face)} - {-1}
    for kind in ("step", "step-ap214", "iges", "brep"):
        shape = read_shape(taken[kind])
        checked = check(shape)
        assert checked.valid, kind
        assert len(faces_of(shape)) >= len(numbers), kind
    triangles = read_scan(taken["stl"]).points
    np.testing.assert_allclose([triangles.min(axis=0), triangles.max(axis=0)], [low, high], atol=1.0)
    if "3dm" in taken:
        rhino3dm = pytest.importorskip("rhino3dm")
        model = rhino3dm.File3dm.Read(str(taken["3dm"]))
        assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
        assert len(model.Objects) >= len(numbers)
    said = re.search(r'<script type="application/json" id="record">(.*?)</script>', taken["report"].read_text(encoding="utf-8"), re.DOTALL)
    assert said
    record = json.loads(said[1])
    assert record["input"]["path"] == str(scan)
    assert {relation["kind"] for relation in record["relations"]} == {"parallel"}
    return numbers


def ply_columns(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a binary PLY file of points, by name."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    fields = [(name, TYPES[kind]) for kind, name in re.findall(r"property (\w+) (\w+)", head.decode())]
    rows = np.frombuffer(body, np.dtype(fields))
    return {name: rows[name] for name, _ in fields}
