"""Sending to one client's WebSocket."""

from __future__ import annotations

import asyncio

from pydantic import BaseModel
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from relume.core.errors import ProtocolError
from relume_server.errors import CLOSE_NO_ACKNOWLEDGEMENT, make_problem
from relume_server.schemas.protocol import Problem, ProblemMessage

CLOSE_SECONDS = 2.0


class ClientSocket:
    """Sends messages; gives up on a client that does not read."""

    def __init__(self, websocket: WebSocket, send_timeout_s: float) -> None:
        self._websocket, self._send_timeout_s = websocket, send_timeout_s

    async def send(self, message: BaseModel) -> None:
        """Send a text message."""
        async with self._limit_send_time():
            await self._websocket.send_text(message.model_dump_json(by_alias=True))

    async def send_frame(self, frame: bytes) -> None:
        """Send a binary message."""
        async with self._limit_send_time():
            await self._websocket.send_bytes(frame)

    async def refuse(self, error: Exception | Problem, revision: int | None = None) -> None:
        """Send a problem for a rejected message."""
        problem = error if isinstance(error, Problem) else make_problem(error)
        await self.send(ProblemMessage(revision=revision, problem=problem))

    async def close(self, code: int, reason: str) -> None:
        """Close the session with a reason of at most 123 bytes; an unresponsive client is abandoned."""
        if self._websocket.application_state is WebSocketState.DISCONNECTED:
            return
        try:
            async with asyncio.timeout(CLOSE_SECONDS):
                await self._websocket.close(code, reason.encode()[:123].decode(errors="ignore"))
        except (TimeoutError, WebSocketDisconnect, RuntimeError):
            return

    def _limit_send_time(self) -> _Backoff:
        if self._websocket.application_state is WebSocketState.DISCONNECTED:  # another task has timed out already
            raise WebSocketDisconnect(1006)
        return _Backoff(self._send_timeout_s)


class _Backoff:
    """A timeout that raises the session's own error."""

    def __init__(self, seconds: float) -> None:
        self._timeout, self._seconds = asyncio.timeout(seconds), seconds

    async def __aenter__(self) -> None:
        await self._timeout.__aenter__()

    async def __aexit__(self, *raised: object) -> None:
        try:
            await self._timeout.__aexit__(*raised)  # type: ignore[arg-type]
        except TimeoutError:
            text = f"nothing was read for {self._seconds:g} s; reload the page"
            raise ProtocolError(text, CLOSE_NO_ACKNOWLEDGEMENT) from None
