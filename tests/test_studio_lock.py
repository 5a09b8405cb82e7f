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
