"""The pictures of docs/studio.md: ``python -m examples.studio_pictures FOLDER`` from the root of the checkout; needs a Chromium.

A scan of a flange is simulated, and led through all six steps, as a person would; after each step the page is photographed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.studio import ARGUMENTS, STUDIO, serving, wait
from examples.parts.make_parts import write_parts

SIZE = {"width": 1280, "height": 720}
LASSO = ((0.27, 0.29), (0.41, 0.24), (0.52, 0.4), (0.44, 0.55), (0.32, 0.5))
HALF = ((0.36, 0.26), (0.506, 0.26), (0.522, 0.5), (0.36, 0.5))


def scan_of_a_flange(folder: Path) -> Path:
    """Simulate a scan, and return its file."""
    (part,) = write_parts(folder, ["flange"])
    scan = folder / "flange.ply"
    options = ["--n-points", "40000", "--mode", "grid", "--noise", "0.08", "--noise-across", "0.08", "--quiet"]
    subprocess.run([sys.executable, "-c", STUDIO, "simulate", str(part), "-o", str(scan), *options], check=True)
    return scan


class Photographer:
    """Does what a person does on the page, and photographs it."""

    def __init__(self, page: Any, folder: Path) -> None:
        self.page, self.folder = page, folder

    def go_on(self, step: str) -> None:
        """Press the blue button, and wait for the step."""
        self.page.click("#next")
        self.done(step)

    def done(self, step: str) -> None:
        """Wait until a step is done and nothing is computed."""
        wait(self.page, f"studio.store.status('{step}') === 'current' && studio.store.state.running === null")

    def take(self, name: str, *, drawing: bool = False) -> None:
        """Photograph the page, with the pointer out of the way unless it draws."""
        if not drawing:
            self.page.mouse.move(SIZE["width"] - 4, SIZE["height"] // 2)  # nothing is pointed at
        self.page.wait_for_timeout(600)  # until all points are drawn
        self.page.screenshot(path=self.folder / f"{name}.png")

    def lasso(self, corners: Sequence[tuple[float, float]], name: str | None = None) -> None:
        """Draw around a part of the picture, in shares of its size; photograph it before letting go where it has a name."""
        self.page.click("#tool-lasso")
        box = self.page.locator("main canvas").first.bounding_box()
        places = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in corners]
        self.page.mouse.move(*places[0])
        self.page.mouse.down()
        for place in places[1:]:
            self.page.mouse.move(*place, steps=6)
        if name is not None:
            self.take(name, drawing=True)
        self.page.mouse.up()


def photograph(page: Any, folder: Path) -> None:
    """Take all pictures, from the scan to the exported files."""
    photographer = Photographer(page, folder)
    photographer.done("scan")
    wait(page, "studio.viewer.cloud !== null")
    photographer.take("scan")
    photographer.go_on("edges")
    photographer.take("edges")
    photographer.lasso(LASSO, "lasso")
    page.click("#tool-turn")
    page.keyboard.press("Escape")
    photographer.go_on("faces")
    page.click("button.face >> nth=2")
    photographer.take("faces")
    page.click("button.face >> nth=6")
    photographer.lasso(HALF)
    photographer.take("split")
    page.keyboard.press("Escape")
    page.click("#tool-turn")
    photographer.go_on("surfaces")
    photographer.take("surfaces")
    photographer.go_on("model")
    photographer.take("model")
    page.click("#next")
    for kind in ("step", "report"):
        page.click(f"#export-{kind}")
        page.wait_for_selector(f"a.download >> nth={0 if kind == 'step' else 1}", timeout=120_000)
    photographer.done("model")
    photographer.take("export")


def main() -> None:
    from playwright.sync_api import sync_playwright

    folder = Path(sys.argv[1])
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory(prefix="studio-") as home:
        scan = scan_of_a_flange(Path(home))
        with serving(scan) as address, sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
            page = browser.new_page(viewport=SIZE)
            page.goto(address)
            photograph(page, folder)
            browser.close()


if __name__ == "__main__":
    main()
