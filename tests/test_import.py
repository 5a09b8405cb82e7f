"""What importing costs, and what is left without the optional dependencies."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import scan2nurbs

EXTRAS = ("laspy", "lazrs", "pye57", "rhino3dm")

WITHOUT_EXTRAS = f"""
import importlib.abc, sys
class Missing(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {EXTRAS}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


def python(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own, warnings being errors."""
    command = [sys.executable, "-W", "error", "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_importing_the_package_costs_nothing():
    done = python("import sys, scan2nurbs; print([m for m in ('numpy', 'scipy', 'numba', 'OCP', 'matplotlib') if m in sys.modules])")
    assert done.stdout.strip() == "[]", done.stderr


def test_no_process_waits_for_the_slowest_of_scipy():
    done = python("import sys, scan2nurbs.part, scan2nurbs.pipeline; print('scipy.stats' in sys.modules)")
    assert done.stdout.strip() == "False", done.stderr


def test_edges_wait_for_nothing_that_only_surfaces_need():
    code = (
        "import sys, numpy as np\n"
        "from scan2nurbs import EdgeParams, detect_edges\n"
        "detect_edges(np.random.default_rng(0).random((500, 3)) * [1, 1, 0.01], EdgeParams(operator='edn'))\n"
        "print([m for m in ('scan2nurbs.part', 'scan2nurbs.surfaces', 'scipy.interpolate', 'OCP') if m in sys.modules])"
    )
    done = python(code)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_garbage_collector_rests_while_kernels_compile_and_is_left_as_it_was():
    code = (
        "import gc, numba, scan2nurbs.kernels.runner\n"
        "from numba.core import event\n"
        "seen = []\n"
        "class Look(event.Listener):\n"
        "    def on_start(self, event): seen.append(gc.isenabled())\n"
        "    def on_end(self, event): pass\n"
        "event.register('numba:compile', Look())\n"
        "@numba.njit\n"
        "def half(x):\n"
        "    return x / 2\n"
        "half(1.0); print(seen, gc.isenabled())\n"
        "gc.disable(); half(1); print(gc.isenabled())"
    )
    done = python(code)
    assert done.stdout.split("\n")[:2] == ["[False] True", "False"], done.stderr


@pytest.mark.parametrize("name", scan2nurbs.__all__)
def test_every_public_name_is_there(name):
    assert getattr(scan2nurbs, name) is not None
    assert name in dir(scan2nurbs)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = scan2nurbs.no_such_name


def test_every_module_imports_without_the_extras():
    code = WITHOUT_EXTRAS + (
        "import pkgutil, importlib, scan2nurbs\n"
        "for found in pkgutil.walk_packages(scan2nurbs.__path__, 'scan2nurbs.'):\n"
        "    importlib.import_module(found.name)\n"
    )
    done = python(code)
    assert done.returncode == 0, done.stderr


def write_laz(path: Path) -> None:
    """Write three points with laspy; LAS without compression needs no extra."""
    laspy = pytest.importorskip("laspy")
    with laspy.open(path, mode="w", header=laspy.LasHeader(point_format=0, version="1.2")) as writer:
        points = laspy.ScaleAwarePointRecord.zeros(3, header=writer.header)
        points.x = [0.0, 1.0, 2.0]
        writer.write_points(points)


def write_e57(path: Path) -> None:
    """Write three points with pye57."""
    pye57 = pytest.importorskip("pye57")
    columns = {f"cartesian{axis}": np.array([0.0, 1.0, 2.0]) for axis in "XYZ"}
    file = pye57.E57(str(path), mode="w")
    file.write_scan_raw(columns)
    file.close()


@pytest.mark.parametrize(("name", "write", "extra"), [("scan.laz", write_laz, "las"), ("scan.e57", write_e57, "e57")])
def test_a_format_without_its_extra_says_what_to_install(name, write, extra, tmp_path: Path):
    path = tmp_path / name
    write(path)
    done = python(WITHOUT_EXTRAS + "from scan2nurbs.cli.main import main; main()", "info", path)
    assert done.returncode == 3
    assert f"pip install 'scan2nurbs[{extra}]'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_version_is_that_of_the_installation():
    from importlib.metadata import version

    assert import_module("scan2nurbs").__version__ == version("scan2nurbs")
