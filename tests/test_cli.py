"""The command line: what it says, what it refuses, and what it leaves behind."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from scan2nurbs.cli.failures import Interrupted, exit_code, interruptible, sentence
from scan2nurbs.cli.main import COMMANDS, main
from scan2nurbs.errors import InputError, NoResultError, OutputError, ParameterError
from scan2nurbs.io import read_scan

HEAVY = ("numpy", "scipy", "numba", "OCP", "matplotlib", "polars", "jinja2")


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A roof of 60 degrees with a row that is no point and a duplicate."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-1, 1, (2, 2500))
    points = np.stack([x, y, -1.7 * np.abs(x)], axis=1) + rng.normal(0, 0.002, (2500, 3))
    points[7] = np.nan
    points[9] = points[8]
    path = tmp_path / "scan.npy"
    np.save(path, points)
    return path


def run(*arguments: object) -> int:
    """Run a command in this process and return its exit code."""
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    code = stopped.value.code
    return 0 if code is None else int(code)


def start(code: str, *arguments: object, **options: object) -> subprocess.Popen[bytes]:
    """Run Python code in a process of its own, with `main` imported and the arguments in sys.argv."""
    command = [sys.executable, "-c", f"from scan2nurbs.cli.main import main\n{code}", *map(str, arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, **{"stdout": subprocess.PIPE, **options})  # type: ignore[call-overload] - any options


class TestOverview:
    def test_help_names_every_command_and_what_it_does(self, capsys):
        assert run("--help") == 0
        listed = dict(re.findall(r"^  (\w+) +([A-Z].*\.)$", capsys.readouterr().out, re.MULTILINE))
        assert listed == {name: text for name, (_, text) in COMMANDS.items()}
        assert list(listed) == ["info", "edges", "surface", "simulate", "segment", "convert", "studio"]

    def test_help_imports_nothing_that_takes_long(self):
        code = """
import sys
from scan2nurbs.cli.main import main
try:
    main(["--help"])
except SystemExit:
    print(*sys.modules, file=sys.stderr)
"""
        loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stderr.split()
        assert "typer" in loaded
        assert not {"numpy", "numba", "scipy", "rich.console", "importlib.metadata"} & set(loaded)

    @pytest.mark.parametrize("name", COMMANDS)
    def test_the_overview_says_what_the_command_says(self, name):
        module, text = COMMANDS[name]
        command = getattr(import_module(f"scan2nurbs.cli.{module}"), name)
        assert (command.__doc__ or "").splitlines()[0] == text

    @pytest.mark.parametrize("name", COMMANDS)
    def test_every_command_explains_itself(self, name, capsys):
        assert run(name, "--help") == 0
        assert "--help" in capsys.readouterr().out

    def test_building_the_parser_imports_nothing_heavy(self):
        code = f"from scan2nurbs.cli.main import build; build(); import sys; print([m for m in {HEAVY} if m in sys.modules])"
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        assert out.strip() == "[]"

    def test_python_dash_m_is_the_command_line_too(self):
        out = subprocess.run([sys.executable, "-m", "scan2nurbs", "--version"], capture_output=True, text=True, check=True).stdout
        assert re.fullmatch(r"scan2nurbs \d+\.\d+\.\d+\n", out)

    def test_version(self, capsys):
        assert run("--version") == 0
        assert re.fullmatch(r"scan2nurbs \d+\.\d+\.\d+\n", capsys.readouterr().out)


class TestAnswers:
    def test_info_for_a_reader(self, scan, capsys):
        assert run("info", scan, "--unit", "mm") == 0
        out = capsys.readouterr().out
        assert "2,498 points in mm" in out
        assert "1 rows that are no point, 1 duplicates" in out

    def test_info_as_json(self, scan, capfd):
        assert run("info", scan, "--json", "--unit", "m") == 0
        record = json.loads(capfd.readouterr().out)
        assert record["schema"] == "scan2nurbs/info/1"
        counts = {"n_rows": 2500, "n_points": 2498, "n_invalid": 1, "n_duplicates": 1, "unit": "m"}
        assert counts.items() <= record["input"].items()
        assert 0 < record["scale"]["noise"] < record["scale"]["h"]
        assert len(record["input"]["sha256"]) == 64
        assert record["peak_memory_mb"] > 10
        assert record["seconds"]["measure"] > 0
        assert {"scan2nurbs", "numpy", "python"} <= record["versions"].keys()

    def test_json_has_stdout_to_itself(self, scan):
        code = """
import os
from scan2nurbs import api
measure = api.measure
def chatty(*arguments, **options):
    os.write(1, b"a compiled library says hello\\n")
    print("so does Python")
    return measure(*arguments, **options)
api.measure = chatty
main()
"""
        with start(code, "info", scan, "--json") as process:
            out, err = process.communicate(timeout=60)
        assert json.loads(out)["schema"] == "scan2nurbs/info/1"
        assert b"a compiled library says hello" in err
        assert b"so does Python" in err

    def test_a_guessed_unit_is_a_warning_that_quiet_hides(self, scan, capsys):
        run("info", scan)
        assert "warning: " in capsys.readouterr().err
        run("info", scan, "--quiet")
        assert capsys.readouterr().err == ""

    def test_edges_keeps_rows_and_order(self, scan, tmp_path, capsys):
        output = tmp_path / "edges.npz"
        assert run("edges", scan, "-o", output, "--unit", "mm") == 0
        given = np.load(scan)
        with np.load(output) as columns:
            found = dict(columns)
        np.testing.assert_allclose(found["points"], given, atol=1e-12)
        assert found["edge"].dtype == np.uint8
        assert found["strength"].dtype == np.float32
        assert np.isnan(found["strength"][7])
        assert found["edge"][7] == 0
        # The border of the sheet is an edge too, but no crease.
        on_edge = (found["edge"] == 1) & (found["kind"] != 3)
        assert np.abs(given[on_edge, 0]).max() < 0.25
        assert on_edge.sum() > 40
        assert f"wrote {output}" in capsys.readouterr().out

    def test_edges_as_ply_can_be_read_back(self, scan, tmp_path):
        output = tmp_path / "edges.ply"
        assert run("edges", scan, "-o", output, "--unit", "mm", "--quiet") == 0
        np.testing.assert_allclose(read_scan(output).points, np.load(scan), atol=1e-12)

    def test_the_options_reach_the_operator(self, scan, capfd):
        options = ["--sequence", "vdn*2, dn", "--small-radius", "2.5", "--large-radius", "6", "--threshold", "15", "--sectors", "6"]
        assert run("edges", scan, "--json", *options) == 0
        record = json.loads(capfd.readouterr().out)
        assert [each["operator"] for each in record["edges"]["runs"]] == ["vdn", "vdn", "dn"]
        assert record["edges"]["threshold"] == 15
        assert record["parameters"]["edges"]["sectors"] == 6

    def test_threads_change_nothing(self, scan, tmp_path):
        for n in (1, 2):
            assert run("edges", scan, "-o", tmp_path / f"{n}.ply", "--threads", n, "--quiet", "--unit", "mm") == 0
        assert (tmp_path / "1.ply").read_bytes() == (tmp_path / "2.ply").read_bytes()

    def test_a_reader_that_goes_away_is_no_failure(self, scan):
        with start("main()", "info", scan, "--quiet") as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            assert process.wait(60) == 0
            assert process.stderr.read() == b""


class TestRefusals:
    @pytest.mark.parametrize(
        ("options", "said"),
        [
            (["--operator", "sobel"], "must be one of"),
            (["--threshold", "120"], "threshold"),
            (["--small-radius", "-1"], "small_radius"),
            (["--sequence", "dn,,"], "sequence"),
            (["--threads", "0"], "threads"),
            (["--unit", "furlong"], "unit"),
            (["--operator", "edn", "--alpha", "0.5", "--beta", "0.6"], "alpha + beta"),
        ],
    )
    def test_parameters_out_of_range(self, options, said, scan, capsys):
        assert run("edges", scan, *options) == 2
        err = capsys.readouterr().err
        assert said in err
        assert err.count("\n") == 1

    @pytest.mark.parametrize("options", [["--frobnicate"], ["--threshold", "much"], ["second-scan.ply"]])
    def test_what_the_parser_refuses(self, options, scan):
        assert run("edges", scan, *options) == 2

    def test_no_command_and_wrong_command(self, capsys):
        assert run("sharpen") == 2
        assert "sharpen" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("output", "said"),
        [("no/such/folder/edges.ply", "does not exist"), ("edges.jpeg", "no writer"), ("edges", "no writer"), (".", "no writer")],
    )
    def test_a_bad_output_is_found_before_the_input_is_read(self, output, said, tmp_path, capsys):
        assert run("edges", tmp_path / "missing.ply", "-o", tmp_path / output) == 2
        assert said in capsys.readouterr().err

    def test_input_and_output_are_never_one_file(self, scan, tmp_path, capsys):
        path, link = tmp_path / "scan.npz", tmp_path / "link.npz"
        np.savez(path, points=np.load(scan))
        before = path.read_bytes()
        link.symlink_to(path)
        for output in (path, link, tmp_path / "x" / ".." / "scan.npz"):
            assert run("edges", path, "-o", output) == 2
            err = capsys.readouterr().err
            assert "overwrite" in err or "does not exist" in err
        assert path.read_bytes() == before

    def test_two_outputs_are_never_one_file(self, scan, tmp_path):
        assert run("info", scan, "--report", tmp_path / "a.html", "--config", tmp_path / "a.html") != 0

    @pytest.mark.parametrize(
        ("name", "content"),
        [("missing.ply", None), ("empty.ply", b""), ("cut.ply", b"ply\nformat ascii 1.0\n"), ("a.jpg", b"\xff\xd8\xff\xe0" * 9)],
    )
    def test_input_that_cannot_be_read(self, name, content, tmp_path, capsys):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        assert run("info", path, "--json") == 3
        captured = capsys.readouterr()
        assert captured.out == ""
        assert str(path) in captured.err
        assert captured.err.count("\n") == 1

    def test_the_traceback_is_for_debug_alone(self, tmp_path, capsys):
        assert run("info", tmp_path / "missing.ply", "--debug") == 3
        assert "Traceback" in capsys.readouterr().err
        assert run("info", tmp_path / "missing.ply") == 3
        assert "Traceback" not in capsys.readouterr().err

    def test_a_bug_is_called_one(self, scan, capsys, monkeypatch):
        from scan2nurbs import api

        monkeypatch.setattr(api, "measure", lambda *_, **__: 1 / 0)
        assert run("info", scan) == 1
        err = capsys.readouterr().err
        assert "Internal error" in err
        assert "ZeroDivisionError" in err

    @pytest.mark.parametrize(
        ("error", "code"),
        [
            (ParameterError("x"), 2),
            (InputError("x"), 3),
            (NoResultError("x"), 4),
            (OutputError("x", path="y"), 4),
            (MemoryError(), 4),
            (OSError(28, "No space left on device", "out.step"), 4),
            (Interrupted(130), 130),
            (KeyboardInterrupt(), 130),
            (RuntimeError("x"), 1),
        ],
    )
    def test_exit_codes(self, error, code):
        assert exit_code(error) == code
        assert "\n" not in sentence(error)

    def test_the_file_is_named_once(self):
        error = NoResultError("No surface was found.")
        error.add_note("scan.ply")
        assert sentence(error) == "scan.ply: No surface was found."
        named = InputError("It is empty.", path="scan.ply")
        named.add_note("scan.ply")
        assert sentence(named) == "scan.ply: It is empty."


class TestInterruption:
    WRITE_SLOWLY = """
import sys, time
import scan2nurbs.io as io
def write_slowly(path, *_, **__):
    with io.atomic_path(path) as temporary:
        temporary.write_bytes(b"half")
        print("HALF", file=sys.stderr, flush=True)
        time.sleep(60)
io.write_points = write_slowly
main()
"""

    @pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
    @pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
    def test_nothing_half_written_stays(self, number, code, scan, tmp_path):
        folder = tmp_path / "out"
        folder.mkdir()
        with start(self.WRITE_SLOWLY, "edges", scan, "-o", folder / "edges.ply", "--quiet") as process:
            assert process.stderr is not None
            while b"HALF" not in process.stderr.readline():
                assert process.poll() is None
            assert len(list(folder.iterdir())) == 1
            process.send_signal(number)
            assert process.wait(30) == code
            assert b"Interrupted" in process.stderr.read()
        assert list(folder.iterdir()) == []

    @pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
    def test_a_library_that_calls_the_interruption_a_failure_of_its_own_changes_nothing(self):
        @interruptible()
        def import_a_library():
            try:
                signal.raise_signal(signal.SIGINT)
            except BaseException as error:
                raise ImportError("initialization failed") from error

        with pytest.raises(Interrupted) as stopped:
            import_a_library()
        assert stopped.value.code == 130

    def test_a_computation_stops_between_ranges(self, scan, tmp_path, capsys, monkeypatch):
        from scan2nurbs.cli.progress import Bars

        output = tmp_path / "edges.ply"
        monkeypatch.setattr(Bars, "__call__", lambda *_: signal.raise_signal(signal.SIGINT))
        assert run("edges", scan, "-o", output) == 130
        assert not output.exists()
        assert "Interrupted" in capsys.readouterr().err
