"""The commands `segment` and `convert`, from files to files, on a scan of a part whose faces are known."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from io_samples import columns
from scan2nurbs.cli.main import main
from scan2nurbs.io import read_scan, write_points

NOISE = 0.05
RADIUS, HEIGHT = 6.0, 8.0
BASE = np.array([24.0, 20.0, 6.0])


def run(*arguments: object) -> int:
    """Run a command in this process and return its exit code."""
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return 0 if stopped.value.code is None else int(stopped.value.code)


def block_with_pin(step: float = 0.45) -> tuple[np.ndarray, np.ndarray]:
    """Return noisy points on a block with a round pin on it, and the true face of each."""
    rng = np.random.default_rng(3)
    x, y, z = BASE
    faces = []

    def plane(origin, u, v):
        n = int(np.linalg.norm(u) / step) * int(np.linalg.norm(v) / step)
        a = rng.random((n, 2))
        return origin + a[:, :1] * u + a[:, 1:] * v

    ex, ey, ez = np.diag(BASE)
    zero = np.zeros(3)
    for origin, u, v in ((zero, ex, ey), (ez, ex, ey), (zero, ex, ez), (ey, ex, ez), (zero, ey, ez), (ex, ey, ez)):
        faces.append(plane(origin, u, v))
    middle = np.array([x / 2, y / 2])
    faces[1] = faces[1][np.linalg.norm(faces[1][:, :2] - middle, axis=1) > RADIUS]
    n = int(2 * np.pi * RADIUS * HEIGHT / step**2)
    turn, up = rng.uniform(0, 2 * np.pi, n), rng.uniform(z, z + HEIGHT, n)
    faces.append(np.column_stack([middle[0] + RADIUS * np.cos(turn), middle[1] + RADIUS * np.sin(turn), up]))
    n = int(np.pi * RADIUS**2 / step**2)
    turn, out = rng.uniform(0, 2 * np.pi, n), RADIUS * np.sqrt(rng.random(n))
    faces.append(np.column_stack([middle[0] + out * np.cos(turn), middle[1] + out * np.sin(turn), np.full(n, z + HEIGHT)]))
    points = np.vstack(faces)
    label = np.repeat(np.arange(len(faces)), [len(face) for face in faces])
    return points + rng.normal(0, NOISE, points.shape) + [100.0, 0.0, -50.0], label


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The part's scan, with a row that is no point."""
    points, _ = block_with_pin()
    path = tmp_path_factory.mktemp("part") / "pin.ply"
    write_points(path, np.vstack([points, [np.nan] * 3]), {}, unit="mm")
    return path


@pytest.fixture(scope="module")
def done(scan: Path) -> Path:
    """A folder with everything that one run of `convert` writes, its JSON among it."""
    folder = scan.parent / "done"
    folder.mkdir()
    names = {"-o": "part.step", "--points": "points.npz", "--mesh": "part.stl", "--report": "report.html"}
    outputs = [word for option, name in names.items() for word in (option, folder / name)]
    out = sys.stdout
    with (folder / "record.json").open("w", encoding="utf-8") as stream:
        sys.stdout = stream
        try:
            code = run("convert", scan, "--json", "--quiet", *outputs)
        finally:
            sys.stdout = out
    assert code == 0
    return folder


@pytest.fixture(scope="module")
def record(done: Path) -> dict:
    """The JSON of that run."""
    return json.loads((done / "record.json").read_text(encoding="utf-8"))


def test_the_model_is_the_part(record):
    model = record["model"]
    assert model["valid"]
    assert model["closed"]
    assert model["n_solids"] == 1
    assert model["n_faces"] == 8
    assert model["free_edges"] == 0
    assert model["volume"] == pytest.approx(np.prod(BASE) + np.pi * RADIUS**2 * HEIGHT, rel=2e-3)
    assert model["coverage"] > 0.99
    assert model["precision"] > 0.99
    assert model["rms"] < 1.15 * NOISE


def test_the_pin_is_a_cylinder_with_its_radius_and_place(record):
    (pin,) = [face for face in record["faces"] if face["type"] == "cylinder"]
    assert pin["shape"]["radius"] == pytest.approx(RADIUS, abs=0.1 * NOISE)
    assert abs(pin["shape"]["radius"] - RADIUS) < 5 * pin["uncertainty"]["radius"] + 0.01 * NOISE
    assert abs(pin["shape"]["axis"][2]) > np.cos(np.radians(0.1))
    np.testing.assert_allclose(pin["shape"]["point"][:2], [100 + BASE[0] / 2, BASE[1] / 2], atol=0.5 * NOISE)
    assert pin["name"] == f"cylinder_{pin['number']}"
    assert "radius" in pin["parameters"]
    assert sum(face["type"] == "plane" for face in record["faces"]) == 7


def test_relations_are_listed_with_what_they_moved(record):
    kinds = {relation["kind"] for relation in record["relations"]}
    assert {"parallel", "perpendicular"} & kinds
    for relation in record["relations"]:
        assert relation["moved_angle"] < 1.0
        assert relation["between"].count("_") == 2


def test_a_config_says_which_relations(scan, tmp_path, capsys):
    config = tmp_path / "config.toml"
    config.write_text('[relations]\nkinds = ["perpendicular"]\nangle = 1\n', encoding="utf-8")
    assert run("convert", scan, "--config", config, "--quiet", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {relation["kind"] for relation in found["relations"]} == {"perpendicular"}
    assert found["parameters"]["relations"] == {"kinds": ["perpendicular"], "angle": 1.0, "length": 0.1, "max_rise": 0.25}
    assert found["parameters"]["part"]["relations"] is True
    assert run("convert", scan, "--config", config, "--no-relations", "--quiet", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["relations"] == []
    assert found["parameters"]["part"]["relations"] is False
    config.write_text('[relations]\nkinds = ["friendly"]\n', encoding="utf-8")
    assert run("convert", scan, "--config", config, "--quiet") == 2
    assert "section 'relations'" in capsys.readouterr().err


def test_edges_lie_on_both_faces(record):
    edges = record["edges"]
    assert len(edges) == 14
    assert all(None not in edge["faces"] for edge in edges)
    assert max(edge["gap"] for edge in edges) < 0.1 * record["scale"]["h"]
    assert all(edge["angle"] == pytest.approx(90, abs=1) for edge in edges)


def test_the_file_reads_back_as_a_closed_solid_where_the_scan_lies(done):
    from scan2nurbs.brep.check import check
    from scan2nurbs.brep.read import read_shape

    found = check(read_shape(done / "part.step", unit="mm"))
    assert found.valid
    assert found.closed
    text = (done / "part.step").read_text(encoding="ascii")
    assert "cylinder_" in text
    corners = read_scan(done / "part.stl").points
    np.testing.assert_allclose(corners.min(axis=0), [100, 0, -50], atol=0.2)


def test_every_point_knows_its_face_and_its_deviation(done, scan, record):
    found = columns(done / "points.npz")
    _, true = block_with_pin()
    face, deviation = found["face"][:-1], found["deviation"][:-1]
    assert found["face"][-1] == -1
    assert np.isnan(found["deviation"][-1])
    right = 0
    for k in range(8):
        numbers, counts = np.unique(face[true == k], return_counts=True)
        assert numbers[counts.argmax()] >= 0
        right += counts.max()
    assert right > 0.96 * len(true)
    known = np.isfinite(deviation)
    assert known.mean() > 0.99
    assert np.sqrt(np.mean(deviation[known] ** 2)) < 1.15 * NOISE


def test_the_report_names_every_face(done, record):
    page = (done / "report.html").read_text(encoding="utf-8")
    for face in record["faces"]:
        assert face["name"] in page
    assert page.count("data:image/png") == 5


def test_segment_writes_a_face_for_every_row(scan, tmp_path, capsys):
    assert run("segment", scan, "-o", tmp_path / "faces.npz", "--quiet", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    face = columns(tmp_path / "faces.npz")["face"]
    assert face.dtype == np.int32
    assert len(face) == record["input"]["n_rows"]
    assert face[-1] == -1
    assert len(record["faces"]) == 8
    assert {f["number"] for f in record["faces"]} == set(np.unique(face[face >= 0]).tolist())
    assert np.bincount(face[face >= 0]).tolist() == [f["n_points"] for f in record["faces"]]


def test_a_run_of_segment_is_repeated_from_its_own_parameters(scan, tmp_path, capsys):
    assert run("segment", scan, "--tolerance", 1e-4, "--quiet", "--json") == 0
    first = json.loads(capsys.readouterr().out)
    assert set(first["parameters"]) == {"edges", "segment", "part"}
    assert any("changes nothing" in warning for warning in first["warnings"])
    config = tmp_path / "again.toml"
    sections = {
        name: "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items() if value is not None)
        for name, values in first["parameters"].items()
    }
    config.write_text("".join(f"[{name}]\n{values}" for name, values in sections.items()), encoding="utf-8")
    assert run("segment", scan, "--config", config, "--quiet", "--json") == 0
    again = json.loads(capsys.readouterr().out)
    assert again["parameters"] == first["parameters"]
    assert again["faces"] == first["faces"]


def test_a_value_of_the_config_may_go_with_one_of_the_command_line(scan, tmp_path, capsys):
    config = tmp_path / "config.toml"
    config.write_text('[edges]\noperator = "edn"\nsmall_radius = 12.0\n', encoding="utf-8")
    assert run("edges", scan, "--config", config, "--large-radius", 20, "--quiet", "--json") == 0
    assert json.loads(capsys.readouterr().out)["parameters"]["edges"]["large_radius"] == 20
    assert run("edges", scan, "--config", config, "--quiet") == 2
    assert "config.toml: In the section 'edges'" in capsys.readouterr().err


def test_where_there_are_no_curves_nothing_is_written(tmp_path, capsys):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(3000, 3))
    write_points(tmp_path / "ball.ply", points / np.linalg.norm(points, axis=1)[:, None], {}, unit="mm")
    files = tmp_path / "edges.ply", tmp_path / "curves.ply"
    assert run("edges", tmp_path / "ball.ply", "-o", files[0], "--curves", files[1], "--quiet") == 4
    assert "no file of curves" in capsys.readouterr().err
    assert not any(path.exists() for path in files)


def test_corrections_are_done_and_replayed(scan, tmp_path, capsys, record):
    (pin,) = [face["number"] for face in record["faces"] if face["type"] == "cylinder"]
    steps = [
        {"type": {"face": pin, "kind": "cone"}},
        {"split": {"face": 0, "boxes": [{"min": [100 + BASE[0] / 2, None, None], "max": [None, None, None]}]}},
    ]
    corrections = tmp_path / "corrections.json"
    corrections.write_text(json.dumps(steps), encoding="utf-8")
    outputs = []
    for name in ("one.npz", "two.npz"):
        code = run("segment", scan, "-o", tmp_path / name, "--corrections", corrections, "--quiet", "--json")
        text = capsys.readouterr().out
        if code == 4:  # a cylinder's points may not determine a cone at all
            assert text == ""
            return
        assert code == 0
        outputs.append((tmp_path / name).read_bytes())
        found = json.loads(text)
        assert len(found["faces"]) == 9
    assert outputs[0] == outputs[1]


def test_a_correction_of_a_face_that_is_not_there_is_refused(scan, tmp_path, capsys):
    corrections = tmp_path / "corrections.json"
    corrections.write_text('[{"delete": 99}]', encoding="utf-8")
    assert run("convert", scan, "-o", tmp_path / "part.step", "--corrections", corrections, "--quiet") == 3
    assert "there is no face 99" in capsys.readouterr().err
    assert not (tmp_path / "part.step").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--keep-types", "plane,cube"], "'cube'"),
        (["--max-faces", "0"], "max_faces"),
        (["--tolerance", "-1"], "tolerance"),
        (["-o", "part.xyz"], "suffix"),
    ],
)
def test_wrong_usage_is_refused_before_anything_is_computed(options, said, scan, capsys):
    assert run("convert", scan, "--quiet", *options) == 2
    assert said in capsys.readouterr().err


def test_only_kept_types_are_used(scan, capsys):
    assert run("segment", scan, "--keep-types", "plane,bspline", "--quiet", "--json") == 0
    kinds = {face["type"] for face in json.loads(capsys.readouterr().out)["faces"]}
    assert kinds <= {"plane", "bspline"}
