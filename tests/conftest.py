"""One hypothesis profile for all tests, the fixtures of the tests of reading, and the browser of those of the studio.

The profile has no deadline, since kernels compile on their first call, and the same examples in every run.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "scan2nurbs",
    deadline=None,
    derandomize=True,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("scan2nurbs")


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """Let two processes compile the kernels of a part by halves, for each other: each would compile all of them at the same time.

    A third process, or one alone, compiles what its tests ask for.
    """
    import kernel_halves

    half = kernel_halves.HALVES.get(os.environ.get("PYTEST_XDIST_WORKER", ""))
    if half is not None:
        half()


@pytest.fixture(scope="session")
def every_format(tmp_path_factory):
    """Make a valid file of every format that is read: name → (suffix, content)."""
    import io_samples

    return io_samples.every_format(tmp_path_factory.mktemp("formats"))


@pytest.fixture
def read(tmp_path):
    """Give a function that reads bytes as the content of a file with some suffix."""
    from scan2nurbs.io import read_scan

    def read(content: bytes, suffix=".bin"):
        path = tmp_path / f"file{suffix}"
        path.write_bytes(content)
        return read_scan(path)

    return read


@pytest.fixture(scope="module")
def browser():
    """Run a Chromium; it ends with the file, since other tests run event loops of their own."""
    from studio_person import ARGUMENTS, CHROMIUM

    playwright_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    pytest.importorskip("starlette", reason="the studio is an extra")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with playwright_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield running
        running.close()
