"""A studio in a process of its own, and what a test says to it."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from scan2nurbs.io import write_points

COMMAND = [sys.executable, "-c", "from scan2nurbs.cli.main import main; main()"]
NOISE = 0.03


def small_part(path: Path, step: float = 0.42) -> Path:
    """Write a noisy scan of a block with a step in it: eight planes."""
    rng = np.random.default_rng(5)
    outline = np.array([[0, 0], [16, 0], [16, 5], [9, 5], [9, 10], [0, 10]], float)
    depth = 9.0
    faces = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        n = int(np.linalg.norm(b - a) * depth / step**2)
        t, z = rng.random(n), rng.random(n) * depth
        faces.append(np.column_stack([a + t[:, None] * (b - a), z]))
    for z in (0.0, depth):
        xy = rng.random((int(160 / step**2), 2)) * [16, 10]
        xy = xy[(xy[:, 0] < 9) | (xy[:, 1] < 5)]
        faces.append(np.column_stack([xy, np.full(len(xy), z)]))
    points = np.vstack(faces)
    points = points + rng.normal(0, NOISE, points.shape) + [50.0, 20.0, 0.0]
    write_points(path, np.vstack([[np.nan] * 3, points]), {}, unit="mm")
    return path


class Studio:
    """Runs `scan2nurbs studio` until it is stopped or killed."""

    def __init__(self, *arguments: object, cwd: Path | None = None, **more) -> None:
        command = [*COMMAND, "studio", *map(str, arguments), "--no-open"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=cwd, **more)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()
        assert self.url.startswith("http://127.0.0.1:"), self.process.stderr.read() if self.process.stderr else ""
        self.port = int(self.url.split(":")[2].split("/")[0])
        self.token = self.url.partition("#token=")[2]
        self.host = f"127.0.0.1:{self.port}"
        self.origin = f"http://{self.host}"

    def ask(self, method: str, path: str, body: bytes | str | None = None, **headers: str) -> tuple[int, dict[str, str], bytes]:
        """Send a request with just these headers; names are written with underscores."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        said = {name.replace("_", "-"): value for name, value in headers.items()}
        link.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        data = body.encode() if isinstance(body, str) else body
        for name, value in ({"Host": self.host} | said | ({"Content-Length": str(len(data))} if data is not None else {})).items():
            link.putheader(name, value)
        link.endheaders(data)
        answer = link.getresponse()
        found = answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        link.close()
        return found

    def cookie(self) -> str:
        """Exchange the token."""
        status, headers, _ = self.ask("POST", "/session", self.token, Origin=self.origin)
        assert status == 200
        return headers["set-cookie"].split(";")[0]

    def page(self, cookie: str | None = None, **more):
        """Open a WebSocket as the page does."""
        from websockets.sync.client import connect

        # A page that did not read all that was sent, of a studio that was killed, would wait ten seconds for the other's farewell.
        options = {"origin": self.origin, "additional_headers": {"Cookie": self.cookie() if cookie is None else cookie}, "max_size": None}
        options["close_timeout"] = 0.5
        return connect(f"ws://{self.host}/ws", **(options | more))

    def kill(self) -> None:
        """End it as a power cut would."""
        self.process.kill()
        self._ended()

    def stop(self) -> int:
        """Stop it as Ctrl-C does, and return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self._ended()

    def _ended(self) -> int:
        code = self.process.wait(20)
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()
        return code


def say(page, name: str, **content) -> None:
    """Send a message as the page does."""
    page.send(json.dumps({"type": name, **content}))


def hear(page, name: str, when=lambda _message: True, seconds: float = 60.0) -> dict:
    """Wait for a message."""
    end = time.monotonic() + seconds
    while True:
        message = page.recv(timeout=max(end - time.monotonic(), 0.01))
        if isinstance(message, str):
            content = json.loads(message)
            if content["type"] == name and when(content):
                return content


def is_current(step: str):
    """Tell of a state whether a step is done."""
    return lambda state: next(entry for entry in state["steps"] if entry["step"] == step)["status"] == "current"
