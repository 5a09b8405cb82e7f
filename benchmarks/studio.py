"""Measure the studio's page on a large cloud: bytes on the wire, frames a second, the time of a frame, of a move of a slider, of edges.

    python -m benchmarks.studio [--points N] [--frames N] [--chromium PATH]

from the root of the checkout; needs the extras ``studio`` and ``test`` and a Chromium. The cloud is the blocky part of `benchmarks.clouds`.
Without a graphics card Chromium draws with SwiftShader, on the processor; the picture's renderer and the machine's load are printed beside
the figures, since both decide them. A frame is timed from its start until the picture can be read back. Frames a second are those that are
drawn while the view turns, or a slider moves, a little before each of them; the first time the page has not yet learnt how fast it draws.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.clouds import random_cloud
from scan2nurbs.io import write_points

COUNTS = (250_000, 100_000, 50_000, 20_000, 3_000)
SECONDS = 3
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
STUDIO = "from scan2nurbs.cli.main import main; main()"
RENDERER = """() => {
  const gl = document.createElement('canvas').getContext('webgl2');
  return gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info').UNMASKED_RENDERER_WEBGL);
}"""
FRAMES = """([moving, n]) => {
  const { viewer } = window.studio;
  const learnt = viewer.pace.points;
  if (moving) viewer.pace.points = moving;
  const times = Array.from({ length: n }, () => viewer.measure(moving > 0));
  viewer.pace.points = learnt;
  return times;
}"""
SLIDER = """(n) => Array.from({ length: n }, (_, k) => {
  const start = performance.now();
  window.studio.sync.live(12 + (k % 40), 0.4);
  return performance.now() - start;
})"""
MOVE = """async ([what, seconds]) => {
  const { viewer } = window.studio;
  const { controls } = viewer.cameras;
  const slider = document.getElementById('threshold');
  const turn = () => controls.update();
  const slide = (k) => ((slider.value = String(12 + (k % 40))), slider.dispatchEvent(new Event('input')));
  const drawn = viewer.onDrawn;
  let [frames, k] = [0, 0];
  viewer.onDrawn = () => (drawn(), frames++);
  Object.assign(controls, { autoRotate: what === 'turn', autoRotateSpeed: 10 });
  const start = performance.now();
  while (performance.now() < start + 1000 * seconds) {
    (what === 'turn' ? turn : slide)(k++);
    await new Promise(requestAnimationFrame);
  }
  controls.autoRotate = false;
  viewer.onDrawn = drawn;
  const gl = document.querySelector('main canvas').getContext('webgl2');
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // until the last one is drawn
  return [(1000 * frames) / (performance.now() - start), Math.min(viewer.pace.points, viewer.cloud.n)];
}"""


@contextmanager
def serving(scan: Path) -> Iterator[str]:
    """Run a studio, and give its address."""
    command = [sys.executable, "-c", STUDIO, "studio", str(scan), "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def wait(page: Any, condition: str) -> None:
    """Wait until something is true of the page, whose policy forbids what Playwright does for it."""
    while not page.evaluate(condition):
        page.wait_for_timeout(50)


def spread(milliseconds: list[float]) -> str:
    """Write the median with the least and the most."""
    low, middle, high = min(milliseconds), statistics.median(milliseconds), max(milliseconds)
    return f"{middle:.3g} ms ({low:.3g} to {high:.3g})"


def moving(page: Any, what: str) -> str:
    """Move something for some seconds; write how many frames were drawn a second, and of how many points in the end."""
    page.wait_for_timeout(2500)
    page.evaluate(FRAMES, [0, 1])  # all that was to be drawn before is drawn
    rate, points = page.evaluate(MOVE, [what, SECONDS])
    return f"{rate:.0f} frames a second, in the end of {points:,} points"


def measure(page: Any, address: str, frames: int) -> list[tuple[str, str]]:
    """Lead the page to its edges, and return what was measured, in words and figures."""
    rows: list[tuple[str, str]] = []
    page.goto(address)
    wait(page, "studio.viewer.cloud !== null && studio.store.status('scan') === 'current'")
    cloud = page.evaluate("studio.bytes()")
    points = page.evaluate("studio.viewer.cloud.n")
    rows.append(("points", f"{points:,}"))
    rows.append(("on the wire until the cloud is seen", f"{cloud / 1e6:.1f} MB ({cloud / points:.1f} bytes a point)"))
    page.evaluate(FRAMES, [0, 1])  # compiles the shaders
    rows.append((f"the view turns for {SECONDS} s", moving(page, "turn")))
    rows.append(("a frame with all points", spread(page.evaluate(FRAMES, [0, frames]))))
    for count in COUNTS:
        rows.append((f"a frame of {count:,} points", spread(page.evaluate(FRAMES, [count, 3 * frames]))))
    start = time.perf_counter()
    page.click("#next")
    wait(page, "studio.store.status('edges') === 'current' && studio.sync.strength !== null")
    rows.append(("from the click to edges and curves", f"{time.perf_counter() - start:.1f} s"))
    rows.append(("with edges", f"{(page.evaluate('studio.bytes()') - cloud) / 1e6:.1f} MB more"))
    rows.append(("a move of the threshold's slider, the page's part", spread(page.evaluate(SLIDER, 60))))
    rows.append((f"the threshold's slider moves for {SECONDS} s", moving(page, "slide")))
    rows.append((f"the view turns for {SECONDS} s, coloured by strength", moving(page, "turn")))
    rows.append(("a frame of 20,000 points coloured by strength", spread(page.evaluate(FRAMES, [20_000, 3 * frames]))))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_678_267)
    parser.add_argument("--frames", type=int, default=5)
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("google-chrome"))
    options = parser.parse_args()
    from playwright.sync_api import sync_playwright

    before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder) / "blocks.ply"
        write_points(scan, random_cloud(options.points), {}, unit="mm")
        with serving(scan) as address, sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=options.chromium, args=ARGUMENTS)
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            rows = measure(page, address, options.frames)
            rows.append(("drawn by", page.evaluate(RENDERER)))
            browser.close()
        rows.append(("processors; tasks at work before and after", f"{os.cpu_count()}; {before:.1f} and {os.getloadavg()[0]:.1f}"))
    for name, value in rows:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
