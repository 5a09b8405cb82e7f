"""One studio at a time on a project, and a project that is free again when its studio was killed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from scan2nurbs.errors import InputError
from scan2nurbs.studio.lock import lock_project

HOLD = """
import sys
from pathlib import Path
from scan2nurbs.studio.lock import lock_project
kept = lock_project(Path(sys.argv[1]))
print(1, flush=True)
input()
"""


def test_a_project_belongs_to_one_process_until_it_ends(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline()
        with pytest.raises(InputError, match=f"process {other.pid}") as refused:
            lock_project(tmp_path)
        assert str(tmp_path) in str(refused.value)
        other.kill()
    lock = lock_project(tmp_path)
    assert lock is not None
    lock.close()


def test_a_second_studio_on_a_project_is_refused(tmp_path):
    """The command says who has it, and writes nothing."""
    scan = tmp_path / "scan.csv"
    scan.write_text("\n".join(f"{x},{y},{x * y / 9}" for x in range(12) for y in range(12)))
    command = [sys.executable, "-c", "from scan2nurbs.cli.main import main; main()", "studio", str(scan), "--no-open", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        assert first.stdout.readline().startswith("http://127.0.0.1:")
        folder = next(path for path in tmp_path.iterdir() if path.is_dir())
        second = subprocess.run([*command[:4], str(folder), *command[5:]], capture_output=True, text=True, timeout=60, check=False)
        first.kill()
    assert second.returncode == 3
    assert f"process {first.pid}" in second.stderr
    assert "Traceback" not in second.stderr
