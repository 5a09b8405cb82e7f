"""The server's side of the process that computes: ask, listen, cancel, and start another one where it ends."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Awaitable, Callable
from typing import Any

from scan2nurbs.studio.worker import HEAD

Answer = dict[str, Any] | bytes
GRACE = 3.0
"""Seconds after which a computation that does not look up is ended by force."""
DIED = "The computation ended unexpectedly; perhaps there was not enough memory. What you did is kept: undo the last step, or try again."


class Workshop:
    """One computing process at a time; requests are answered one after the other."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = asyncio.Event()

    async def request(self, on_answer: Callable[[Answer], Awaitable[None]], **request: Any) -> str | None:
        """Have something computed.

        Parameters
        ----------
        on_answer : callable
            Called with each answer on the way: an object, or a binary frame.
        **request
            See `worker`.

        Returns
        -------
        str or None
            What went wrong, as a sentence.

        Raises
        ------
        asyncio.CancelledError
            Never for a request that was cancelled: it ends without trouble.
        """
        self._cancelled.clear()
        process = await self._started()
        await self._write(process, request)
        listening = asyncio.ensure_future(self._listen(process, on_answer))
        watching = asyncio.ensure_future(self._cancelled.wait())
        try:
            await asyncio.wait({listening, watching}, return_when=asyncio.FIRST_COMPLETED)
            if not listening.done():
                await self._write(process, {"do": "cancel"})
                await asyncio.wait({listening}, timeout=GRACE)
            if not listening.done():
                await self.close()
                return None
            return await listening
        except (asyncio.IncompleteReadError, ConnectionError):
            await self.close()
            return None if self._cancelled.is_set() else DIED
        finally:
            listening.cancel()
            watching.cancel()

    async def start(self) -> None:
        """Start the process, which the first request would do else."""
        await self._started()

    def cancel(self) -> None:
        """Stop what is being computed."""
        self._cancelled.set()

    @property
    def cancelled(self) -> bool:
        """Whether the last request was cancelled."""
        return self._cancelled.is_set()

    async def close(self) -> None:
        """End the process."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()
        self._process = None

    async def _started(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            pipe = asyncio.subprocess.PIPE
            # In a group of its own, so that Ctrl-C in a terminal is for the server alone, which ends the process.
            self._process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "scan2nurbs.studio.worker", stdin=pipe, stdout=pipe, limit=1 << 22, start_new_session=True
            )
        return self._process

    @staticmethod
    async def _write(process: asyncio.subprocess.Process, request: dict[str, Any]) -> None:
        assert process.stdin is not None
        content = json.dumps(request).encode()
        process.stdin.write(HEAD.pack(len(content), b"J") + content)
        await process.stdin.drain()

    @staticmethod
    async def _listen(process: asyncio.subprocess.Process, on_answer: Callable[[Answer], Awaitable[None]]) -> str | None:
        assert process.stdout is not None
        while True:
            length, letter = HEAD.unpack(await process.stdout.readexactly(HEAD.size))
            content = await process.stdout.readexactly(length)
            if letter == b"B":
                await on_answer(content)
                continue
            answer = json.loads(content)
            if answer["say"] == "cancelled":
                return None
            if answer["say"] == "done":
                return answer["trouble"]
            await on_answer(answer)
