"""Kernels kept between processes: what was compiled from other sources is not used any more."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import scan2nurbs
from scan2nurbs.kernels import compiled

INNER = """
from scan2nurbs.kernels.runner import kernel

@kernel
def inner(x):
    return x + {}
"""
OUTER = """
from scan2nurbs.kernels.inner import inner
from scan2nurbs.kernels.runner import kernel

@kernel
def outer(x):
    return 10 * inner(x)
"""
PROGRAM = "from scan2nurbs.kernels.outer import outer; print(outer(1), sum(outer.stats.cache_hits.values()))"


def package_in(folder: Path) -> Path:
    """Copy what kernels need of the package; return the folder of its kernels."""
    source, package = Path(scan2nurbs.__file__).parent, folder / "scan2nurbs"
    kernels = package / "kernels"
    kernels.mkdir(parents=True)
    (package / "__init__.py").touch()
    for name in ("errors.py", "ranges.py"):
        shutil.copy(source / name, package)
    for name in ("__init__.py", "runner.py", "compiled.py"):
        shutil.copy(source / "kernels" / name, kernels)
    (kernels / "outer.py").write_text(OUTER)
    return kernels


def run_in(folder: Path) -> list[int]:
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=folder, capture_output=True, text=True, check=True)
    return [int(word) for word in done.stdout.split()]


def test_a_kernel_compiled_into_another_is_compiled_anew_where_it_changed(tmp_path):
    inner = package_in(tmp_path) / "inner.py"
    inner.write_text(INNER.format(1))
    assert run_in(tmp_path) == [20, 0]
    assert run_in(tmp_path) == [20, 1], "kept"
    inner.write_text(INNER.format(2))
    assert run_in(tmp_path) == [30, 0], "the file of the outer kernel is as it was, and Numba alone would not look further"


def test_a_folder_that_cannot_be_written_is_left_as_it_is(tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("no folder")
    compiled.forget_outdated(taken)
    assert taken.read_text() == "no folder"
