"""Start the studio: a socket, an address with a token, a browser."""

from __future__ import annotations

import ipaddress
import os
import socket
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import uvicorn

from scan2nurbs.errors import ParameterError
from scan2nurbs.studio.guard import Access
from scan2nurbs.studio.lock import lock_project
from scan2nurbs.studio.project import Project
from scan2nurbs.studio.server import LARGEST_MESSAGE, STATIC, make_app
from scan2nurbs.studio.session import Session

LOCAL = ("127.0.0.1", "localhost")


def is_local(host: str) -> bool:
    """Tell whether an address is of this machine alone."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def serve(project: Project | None, *, host: str, port: int, home: Path, opens: bool, say: Callable[[str], None]) -> None:
    """Serve until interrupted.

    Parameters
    ----------
    project : Project or None
        None waits for a scan to be dropped on the page.
    host : str
        Address to listen on.
    port : int
        0 takes a free one.
    home : Path
        Where projects of scans from the page are made.
    opens : bool
        Whether the browser is opened.
    say : callable
        Says where the studio is.

    Raises
    ------
    ParameterError
        If the address cannot be listened on.
    InputError
        If another studio has the project open.
    """
    if not (STATIC / "index.html").exists():
        raise ParameterError("The page of the studio is not built: run `npm ci && npm run build` in studio-web.")
    lock = None if project is None else lock_project(project.folder)
    listening = _listen(host, port)
    port = listening.getsockname()[1]
    address = listening.getsockname()[0]
    names = [_in_url(address)] if is_local(host) else _names(host)
    access = Access({*LOCAL, *names}, port)
    url = f"http://{names[0]}:{port}/#token={access.token}"
    look_only = project is not None and lock is None and not os.access(project.folder, os.W_OK)
    config = uvicorn.Config(
        make_app(Session(project, look_only=look_only), access, home),
        log_level="warning",
        access_log=False,
        server_header=False,
        ws="websockets-sansio",
        ws_max_size=LARGEST_MESSAGE,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=2,
    )
    say(url)
    if opens:
        webbrowser.open(url)
    _Server(config).run(sockets=[listening])
    if lock is not None:
        lock.close()


class _Server(uvicorn.Server):
    """A server that is stopped once: it takes two seconds at most, and whoever presses Ctrl-C again gets no traceback."""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Stop at the first signal."""
        if not self.should_exit:
            super().handle_exit(sig, frame)


def _names(host: str) -> list[str]:
    """Return the names under which an address is reached; one that stands for all addresses is reached under this machine's."""
    if host not in ("0.0.0.0", "::", ""):
        return [_in_url(host)]
    name = socket.gethostname()
    try:
        return [name, *socket.gethostbyname_ex(name)[2]]
    except OSError:
        return [name]


def _in_url(address: str) -> str:
    return f"[{address}]" if ":" in address else address


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    if sys.platform != "win32":
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(128)  # whoever reads the address may come at once
    except OSError as error:
        raise ParameterError(f"The studio cannot listen on {host}, port {port}: {error.strerror}. Try another --port.") from error
    return listening
