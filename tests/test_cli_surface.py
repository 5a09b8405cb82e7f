"""The commands `surface` and `simulate`, from files to files."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from io_samples import columns
from scan2nurbs.cli.main import main
from scan2nurbs.io import write_points

NOISE, RADIUS = 0.02, 12.0


def run(*arguments: object) -> int:
    """Run a command in this process and return its exit code."""
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    code = stopped.value.code
    return 0 if code is None else int(code)


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A shallow dome that stands out of a plane by a wall, with a row that is no point."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-20, 20, (2, 12_000))
    z = np.where(np.hypot(x, y) < RADIUS, 6 - (x**2 + y**2) / 80, 0.0)
    turn, height = rng.uniform(0, 2 * np.pi, 1500), rng.uniform(0, 4.2, 1500)
    wall = np.stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), height], axis=1)
    points = np.vstack([np.stack([x, y, z], axis=1), wall])
    points += rng.normal(0, NOISE, points.shape)
    points[100] = np.nan
    path = tmp_path_factory.mktemp("scan") / "dome.ply"
    write_points(path, points, {}, unit="mm")
    return path


@pytest.fixture(scope="module")
def done(scan: Path) -> Path:
    """Return a folder with everything that one run writes, its JSON among it."""
    folder = scan.parent / "done"
    folder.mkdir()
    names = {"-o": "face.step", "--points": "points.npz", "--mesh": "face.stl", "--report": "report.html"}
    outputs = [word for option, name in names.items() for word in (option, folder / name)]
    out = sys.stdout
    with (folder / "record.json").open("w", encoding="utf-8") as stream:
        sys.stdout = stream
        try:
            code = run("surface", scan, "--seed", "0,0,6", "--json", "--quiet", *outputs)
        finally:
            sys.stdout = out
    assert code == 0
    return folder


@pytest.fixture(scope="module")
def record(done: Path) -> dict:
    """The JSON of that run."""
    return json.loads((done / "record.json").read_text(encoding="utf-8"))


def test_the_surface_is_the_dome(record):
    (face,) = record["faces"]
    assert face["rms"] < 1.2 * NOISE
    assert face["p95"] < 2.4 * NOISE
    assert face["area"] == pytest.approx(np.pi * RADIUS**2 * 1.02, rel=0.06)
    assert record["model"]["valid"]
    assert record["model"]["n_faces"] == 1


def test_the_points_know_what_they_belong_to(done, scan):
    from scan2nurbs.io import read_scan

    given, found = read_scan(scan).points, columns(done / "points.npz")
    np.testing.assert_allclose(found["points"], given, atol=1e-9)
    assert found["face"][100] == -1
    assert np.isnan(found["deviation"][100])
    x, y, z = given.T
    on_dome = (np.hypot(x, y) < RADIUS - 1.5) & (z > 3)
    elsewhere = (np.hypot(x, y) > RADIUS + 1.5) | (z < 3)
    assert (found["face"][on_dome] == 0).mean() > 0.99
    assert (found["face"][elsewhere] == -1).mean() > 0.99
    assert np.nanmedian(np.abs(found["deviation"])) < NOISE


def test_every_file_is_there_and_named(done, record):
    assert [Path(path).name for path in record["outputs"]] == ["face.step", "points.npz", "face.stl", "report.html"]
    assert all((done / name).stat().st_size > 500 for name in ("face.step", "points.npz", "face.stl", "report.html"))
    assert (done / "face.step").read_text(encoding="ascii").startswith("ISO-10303-21;")
    assert len(list(done.iterdir())) == 5


def test_the_report_holds_the_json_and_the_pictures(done, record):
    page = (done / "report.html").read_text(encoding="utf-8")
    inside = json.loads(page.split('id="record">')[1].split("</script>")[0])
    assert inside["faces"] == record["faces"]
    assert inside["parameters"] == record["parameters"]
    assert page.count("data:image/png;base64,") == 7


def test_a_run_can_be_repeated_from_its_parameters(record, scan, tmp_path, capfd):
    lines = []
    for section, values in record["parameters"].items():
        lines += [f"[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items() if value is not None)]
    config = tmp_path / "again.toml"
    config.write_text("\n".join(lines), encoding="utf-8")
    assert run("surface", scan, "--config", config, "--json", "--quiet") == 0
    again = json.loads(capfd.readouterr().out)
    assert again["parameters"] == record["parameters"]
    assert again["faces"] == record["faces"]


def test_the_command_line_beats_the_file(scan, tmp_path, capfd):
    config = tmp_path / "config.toml"
    config.write_text("[fit]\ndegree = [3, 2]\ntolerance = 0.5\n[edges]\nthreshold = 30\n[region]\nseed = [0, 0, 6]\n", encoding="utf-8")
    assert run("surface", scan, "--config", config, "--degree", "2", "--json", "--quiet") == 0
    used = json.loads(capfd.readouterr().out)["parameters"]
    assert used["fit"]["degree"] == 2
    assert used["fit"]["tolerance"] == 0.5
    assert used["edges"]["threshold"] == 30
    assert used["region"]["seed"] == [0, 0, 6]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[fits]\ndegree = 3", "unknown section 'fits'"),
        ("[fit]\ndegre = 3", "unknown key 'fit.degre'"),
        ("degree = 3", "unknown section 'degree'"),
        ("[surface]\nedges = 3", "unknown key 'surface.edges'"),
        ('[edges]\nthreshold = "high"', "edges.threshold"),
        ("[edges]\nthreshold = true", "edges.threshold"),
        ("[edges]\nthreshold = 100", "section 'edges'"),
        ("[fit]\nrobust = 1", "fit.robust"),
        ("[region]\nseed = 3", "region.seed"),
        ('[boundary]\nthinning = "none"', "thinning"),
    ],
)
def test_a_config_that_is_wrong_is_named_with_its_key(text, said, scan, tmp_path, capsys):
    config = tmp_path / "config.toml"
    config.write_text(text, encoding="utf-8")
    assert run("surface", scan, "--config", config) == 2
    err = capsys.readouterr().err
    assert str(config) in err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("content", [b"[fit\n", b"\xff\xfe", None])
def test_a_config_that_cannot_be_read(content, scan, tmp_path, capsys):
    config = tmp_path / "config.toml"
    if content is not None:
        config.write_bytes(content)
    assert run("surface", scan, "--config", config) == 3
    assert str(config) in capsys.readouterr().err


def test_the_documented_config_is_one(tmp_path):
    from scan2nurbs.cli.config import read_config
    from scan2nurbs.cli.surface_options import STAGES

    page = (Path(__file__).parent.parent / "docs" / "commands.md").read_text(encoding="utf-8")
    config = tmp_path / "documented.toml"
    config.write_text(page.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    assert read_config(config, STAGES) == tomllib.loads(config.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seed", "1,2"], "Three numbers"),
        (["--seed", "a,b,c"], "Three numbers"),
        (["--degree", "three"], "degree"),
        (["--degree", "0"], "degree"),
        (["--degree", "3,3,3"], "degree"),
        (["--tolerance", "-1"], "tolerance"),
        (["-o", "face.dwg"], "no writer"),
        (["--mesh", "face.step"], "no writer"),
        (["-o", "same.ply", "--mesh", "same.ply"], "overwrite"),
    ],
)
def test_what_cannot_be_asked_for(options, said, scan, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert run("surface", scan, *options) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_selection_that_cannot_be_read(scan, tmp_path, capsys):
    drop = tmp_path / "drop.json"
    drop.write_text("{", encoding="utf-8")
    assert run("surface", scan, "--drop", drop) == 3
    assert str(drop) in capsys.readouterr().err


def test_what_holds_no_surface_has_no_result(tmp_path, capsys):
    line = tmp_path / "line.xyz"
    line.write_text("\n".join(f"{t} {2 * t} {3 * t}" for t in range(200)), encoding="utf-8")
    output = tmp_path / "face.step"
    assert run("surface", line, "-o", output, "--unit", "mm", "--quiet") == 4
    captured = capsys.readouterr()
    assert captured.err.startswith(f"scan2nurbs: {line}: ")
    assert captured.err.count("\n") == 1
    assert not output.exists()


def test_suffixes_are_those_of_the_writers():
    from scan2nurbs.brep.write import FORMATS
    from scan2nurbs.cli import outputs
    from scan2nurbs.io import write

    assert set(outputs.CAD + outputs.MESHES) == set(FORMATS)
    assert set(outputs.POINTS) == set(write._WRITERS)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A box of 20 x 10 x 5 mm as a BREP file."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.BRepTools import BRepTools

    path = tmp_path_factory.mktemp("part") / "box.brep"
    BRepTools.Write_s(BRepPrimAPI_MakeBox(20.0, 10.0, 5.0).Shape(), str(path))
    return path


class TestSimulate:
    def test_a_part_becomes_a_scan_with_its_truth(self, part, tmp_path, capfd):
        scan, truth = tmp_path / "scan.npz", tmp_path / "truth.npz"
        options = ["--n-points", 3000, "--noise", 0.2, "--outliers", 0.01, "--seed", 4]
        assert run("simulate", part, "-o", scan, "--truth", truth, "--json", *options) == 0
        record = json.loads(capfd.readouterr().out)
        assert record["schema"] == "scan2nurbs/simulate/1"
        assert record["scan"]["n_points"] == 3000
        assert record["scan"]["n_outliers"] == 30
        assert len(record["faces"]) == 6
        assert sum(face["n_points"] for face in record["faces"]) == 2970
        made, true = columns(scan), columns(truth)
        assert made["points"].shape == (3000, 3)
        on_face = made["face"] >= 0
        assert on_face.sum() == 2970
        assert np.abs(made["points"] - true["points"])[on_face].max() < 2.0
        assert np.isnan(true["points"][~on_face]).all()

    def test_the_seed_decides(self, part, tmp_path):
        names = [tmp_path / f"{name}.csv" for name in "abc"]
        for path, seed in zip(names, (1, 1, 2), strict=True):
            assert run("simulate", part, "-o", path, "--n-points", 500, "--views", "0,0,1; 1,0,1", "--seed", seed, "--quiet") == 0
        one, same, other = (path.read_bytes() for path in names)
        assert one == same
        assert one != other

    @pytest.mark.parametrize(
        ("options", "code"), [(["--unit", "m"], 2), (["--mode", "sonar"], 2), (["--views", "up"], 2), (["--n-points", "3"], 2)]
    )
    def test_refusals(self, options, code, part, tmp_path):
        assert run("simulate", part, "-o", tmp_path / "scan.ply", *options) == code
        assert list(tmp_path.iterdir()) == []

    def test_the_part_has_to_be_one(self, tmp_path, capsys):
        part = tmp_path / "part.step"
        part.write_text("ISO-10303-21; nonsense", encoding="ascii")
        assert run("simulate", part, "-o", tmp_path / "scan.ply") == 3
        assert str(part) in capsys.readouterr().err
        assert run("simulate", part, "-o", part) == 2
