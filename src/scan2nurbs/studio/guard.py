"""Who may talk to the studio: this machine's own browser with the token that was printed, and nobody else.

A page of another site could reach a server on 127.0.0.1 too, by a form, by WebSocket, or by a name of its own that leads here. So the
Host must be one of ours on every request, the Origin on every WebSocket and write, and all but the empty page needs the cookie that
the token of the address is exchanged for. The token stands in the address's fragment, which browsers send to no server.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

OPEN = ("/", "/session", "/favicon.svg")
"""Paths that need no cookie, besides those under /assets/: they hold nothing of a project."""
SAFE = ("GET", "HEAD")
REFUSED = 4403
"""The code with which a WebSocket is closed."""

HEADERS = {
    "content-security-policy": (
        "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; img-src 'self' blob:"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}


class Access:
    """The secrets of one run of the server, and the names it answers to.

    Parameters
    ----------
    hosts : iterable of str
        Names and addresses, without the port.
    port : int
    """

    def __init__(self, hosts: Iterable[str], port: int) -> None:
        self.token = secrets.token_urlsafe(32)
        self.cookie = f"scan2nurbs-{port}"  # cookies do not know ports
        self.hosts = {f"{host}:{port}" for host in hosts}
        self.origins = {f"http://{host}" for host in self.hosts}
        self._secret = secrets.token_urlsafe(32)

    def exchange(self, token: str) -> str | None:
        """Return the cookie for a token; None for a wrong one."""
        good = secrets.compare_digest(token.encode(), self.token.encode())
        return f"{self.cookie}={self._secret}; Path=/; HttpOnly; SameSite=Strict" if good else None

    def knows(self, cookies: str) -> bool:
        """Tell whether a Cookie header holds ours."""
        try:
            morsel = SimpleCookie(cookies).get(self.cookie)
        except CookieError:
            return False
        return morsel is not None and secrets.compare_digest(morsel.value.encode(), self._secret.encode())


class Guard:
    """Refuses what may not come in, and gives every answer its headers.

    Parameters
    ----------
    app : ASGI application
    access : Access
    """

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app, self.access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request or WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        fault = self._fault(scope)
        if scope["type"] == "websocket":
            if fault is None:
                await self.app(scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close", "code": REFUSED, "reason": fault})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        answer = self.app if fault is None else PlainTextResponse(fault, status_code=403)
        await answer(scope, receive, send_with_headers)

    def _fault(self, scope: Scope) -> str | None:
        headers = Headers(scope=scope)
        if headers.getlist("host") != [headers.get("host")] or headers["host"] not in self.access.hosts:
            return "This name does not belong to the studio."
        writes = scope["type"] == "websocket" or scope["method"] not in SAFE
        if writes and headers.get("origin") not in self.access.origins:
            return "Another site may not talk to the studio."
        path = scope["path"]
        if path in OPEN or path.startswith("/assets/"):
            return None
        if not self.access.knows(headers.get("cookie", "")):
            return "Open the studio with the whole address that it printed, the part behind # included."
        return None
