"""The server: the page and its files, the exchange of the token, the WebSocket, uploads of scans, downloads of exports."""

from __future__ import annotations

import asyncio
import contextlib
import shlex
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import BinaryIO

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from scan2nurbs.errors import OutputError, Scan2NurbsError
from scan2nurbs.studio.guard import Access, Guard
from scan2nurbs.studio.inside import is_linked
from scan2nurbs.studio.lock import lock_project
from scan2nurbs.studio.messages import Trouble
from scan2nurbs.studio.project import EXPORTS, SUFFIX, create_project
from scan2nurbs.studio.session import Page, Session
from scan2nurbs.studio.wire import from_text, to_text

STATIC = Path(__file__).parent / "static"
LARGEST_MESSAGE = 32 << 20
LARGEST_TOKEN = 1024
LARGEST_SCAN = 8 << 30
LONGEST_NAME = 200
"""Bytes, which leave room for the project's suffix."""


def make_app(session: Session, access: Access, home: Path) -> Guard:
    """Make the ASGI application.

    Parameters
    ----------
    session : Session
    access : Access
    home : Path
        Where projects of uploaded scans are made.
    """
    studio = _Studio(session, access, home)

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        working = asyncio.create_task(session.work())
        try:
            yield
        finally:
            working.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await working

    routes = [
        Route("/", studio.page),
        Route("/favicon.svg", studio.icon),
        Route("/session", studio.exchange, methods=["POST"]),
        Route("/scan", studio.upload, methods=["POST"]),
        Route("/files/{name}", studio.file),
        WebSocketRoute("/ws", studio.talk),
        Mount("/assets", StaticFiles(directory=STATIC / "assets", check_dir=False)),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), access)


class _Studio:
    def __init__(self, session: Session, access: Access, home: Path) -> None:
        self.session, self.access, self.home = session, access, home
        self.lock: BinaryIO | None = None
        self.folder: Path | None = None

    async def page(self, _request: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def icon(self, _request: Request) -> Response:
        return FileResponse(STATIC / "favicon.svg")

    async def exchange(self, request: Request) -> Response:
        """Give the cookie for the token."""
        body = await _limited(request, LARGEST_TOKEN)
        cookie = None if body is None else self.access.exchange(body.decode("utf-8", "replace"))
        if cookie is None:
            return PlainTextResponse("This address belongs to a studio that was closed: open the one that was printed last.", 403)
        return PlainTextResponse("", headers={"set-cookie": cookie})

    async def file(self, request: Request) -> Response:
        """Give an exported file; names lead nowhere else."""
        project, name = self.session.project, request.path_params["name"]
        if project is None or name not in project.exports:
            return PlainTextResponse("There is no such file in this project.", 404)
        path = project.folder / EXPORTS / name
        if is_linked(path) or not path.is_file():
            return PlainTextResponse("The file is gone: export it again.", 404)
        return FileResponse(path, filename=name, media_type="application/octet-stream")

    async def upload(self, request: Request) -> Response:
        """Take a scan where none is open, and make a project of it."""
        name = request.query_params.get("name", "")
        if not self.session.opens:
            return PlainTextResponse("A scan is open already; start another studio for another scan.", 409)
        if not _is_name(name):
            return PlainTextResponse("The file's name is too long, or holds signs that do not belong in a name; name it anew.", 400)
        folder = self.home / (name + SUFFIX)
        scan = folder / name
        if folder.exists():
            return PlainTextResponse(
                f"There is a folder {folder.name} already: start `scan2nurbs studio {shlex.quote(folder.name)}` to go on with it.", 409
            )
        try:
            await run_in_threadpool(folder.mkdir)
        except OSError as error:
            return PlainTextResponse(f"The folder of the project cannot be made: {error.strerror}.", 400)
        fault = await self._take(request, scan)
        if fault is not None:
            shutil.rmtree(folder, ignore_errors=True)  # so that the same scan can be sent again
            return PlainTextResponse(fault, 400)
        return PlainTextResponse("")

    async def _take(self, request: Request, scan: Path) -> str | None:
        """Write a scan into its folder and open it; return what is wrong with it, as a sentence."""
        try:
            if not await _written(request, scan):
                return "The scan is larger than 8 GB: start the studio with its name instead."
            made = await run_in_threadpool(create_project, scan, scan.parent)
            self._leave()
            self.lock, self.folder = lock_project(scan.parent), scan.parent
            self.session.open(made)
        except (Scan2NurbsError, OSError, ClientDisconnect) as error:
            return f"The scan could not be taken: {error}"
        return None

    def _leave(self) -> None:
        """Leave the project of a scan that was sent and cannot be read: there is nothing in it."""
        if self.lock is not None:
            self.lock.close()
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)

    async def talk(self, socket: WebSocket) -> None:
        """Talk to a page until it goes."""
        await socket.accept()
        page = self.session.join()
        sending = asyncio.create_task(_send(socket, page))
        try:
            while True:
                text = await socket.receive_text()
                try:
                    self.session.do(from_text(text))
                except Scan2NurbsError as error:
                    text = error.message if isinstance(error, OutputError) else str(error)  # it says where by itself
                    page.queue.put_nowait(to_text(Trouble(text=" ".join(text.split()))))
        except (WebSocketDisconnect, KeyError):  # KeyError: a binary message, which no page sends
            pass
        finally:
            self.session.leave(page)
            sending.cancel()


def _is_name(name: str) -> bool:
    """Tell whether a file may be called so: it stays in its folder, is seen there, and is no option of a command."""
    return name.isprintable() and not set(name) & set("/\\") and name[:1] not in ("", ".", "-", " ") and len(name.encode()) <= LONGEST_NAME


async def _send(socket: WebSocket, page: Page) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
        while True:
            content = await page.queue.get()
            if isinstance(content, bytes):
                await socket.send_bytes(content)
            else:
                await socket.send_text(content)


async def _written(request: Request, path: Path) -> bool:
    """Write the body into a file; stop and return False where it is larger than a scan may be."""
    size = 0
    with path.open("wb") as stream:
        async for chunk in request.stream():
            size += len(chunk)
            if size > LARGEST_SCAN:
                return False
            await run_in_threadpool(stream.write, chunk)
    return True


async def _limited(request: Request, most: int) -> bytes | None:
    """Return the body; None where it is longer than it may be."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > most:
            return None
    return body
