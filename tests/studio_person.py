"""A person before the page of the studio, in a real browser."""

from __future__ import annotations

import io
import shutil

import numpy as np

CHROMIUM = next((path for path in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if path), None)
ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


class Person:
    """What a person does on the page; any complaint of the page's console fails the test."""

    def __init__(self, context, url: str) -> None:
        self.page = context.new_page()
        self.complaints: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text) if message.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(url)

    def settle(self) -> None:
        """Wait until what was done is drawn."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self) -> np.ndarray:
        from matplotlib.image import imread

        self.settle()
        return np.asarray(imread(io.BytesIO(self.page.locator("main canvas").first.screenshot())))[..., :3]

    def n_colours(self) -> int:
        """Return how many colours the picture has, told apart by a sixteenth of each channel."""
        return len(np.unique((self.picture() * 16).astype(int) @ [1, 100, 10_000]))

    def wait(self, condition: str) -> None:
        for _ in range(600):  # the page's policy forbids what wait_for_function does
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(100)
        raise AssertionError(f"This did not come true: {condition}")

    def done(self, step: str) -> None:
        self.page.wait_for_selector(f"#step-{step}.current", timeout=60_000)

    def go_on(self, step: str) -> None:
        self.page.click("#next")
        self.done(step)

    def lasso(self, corners: list[tuple[float, float]], key: str | None = None) -> int:
        """Draw around a part of the picture, in shares of its size; return how many points are chosen."""
        self.page.click("#tool-lasso")
        box = self.page.locator("main canvas").first.bounding_box()
        places = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in corners]
        self.page.mouse.move(*places[0])
        self.page.mouse.down()
        for place in [*places[1:], places[0]]:
            self.page.mouse.move(*place, steps=2)
        self.page.mouse.up()
        return self.page.evaluate("studio.selection.count")
