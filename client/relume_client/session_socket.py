"""The WebSocket of a session, which connects again after each loss, and says why it cannot."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

from websockets import Subprotocol
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus, NegotiationError

from relume_client.bodies import SUBPROTOCOL
from relume_client.errors import AccessError, ProblemError, RelumeClientError, ServerVersionError
from relume_client.transport import Transport, backoff_s

MAX_FRAME_BYTES = 1 << 29
_MAX_RESUMES = 3
_VERSION_CODE = 1002
_LOGIN_CODES = frozenset({4401, 4403})
_FAULT_CODES = frozenset({1007, 1008, 1009, 1011})
_BAKE_CODES = {4404: "not-found", 4409: "not-ready", 4410: "store"}
_LOST = OSError, TimeoutError, InvalidHandshake, ConnectionClosed


class SessionSocket:
    """Sends messages in order, and receives until it is closed.

    Attributes:
        is_open: the server has greeted this connection.
        resume: token by which the next connection resumes the look.
        reason: the last reason why there is no connection.
        failure: the error that ended the session for good.

    Args:
        transport: address and token. bake: id.
        receive: called with each message; while it runs, no other is read.
        on_lost: called when the connection is lost or ended; with the server's sentence if it could not go on, which is
            the fault of what it was sent.
    """

    def __init__(
        self,
        transport: Transport,
        bake: str,
        receive: Callable[[str | bytes], Awaitable[None]],
        on_lost: Callable[[str | None], Awaitable[None]],
    ) -> None:
        self._transport, self._receive, self._on_lost = transport, receive, on_lost
        self._url = f"{transport.url.replace('http', 'ws', 1)}/api/bakes/{bake}/session"
        self._outbox = asyncio.Queue[str]()
        self.is_open, self.resume, self.reason = False, "", "not connected yet"
        self.failure: Exception | None = None

    async def run(self) -> None:
        """Connect, again and again, until the server ends the session for good."""
        attempt = 0
        while self.failure is None:
            sentence = None
            try:
                await self._connect()
                self.reason = "the server is restarting"
            except _LOST as error:
                self.failure = _final_failure(error)
                if isinstance(error, ConnectionClosed) and error.rcvd is not None and error.rcvd.code in _FAULT_CODES:
                    sentence = error.rcvd.reason or f"the server ended the session with code {error.rcvd.code}"
                self.reason = str(self._transport.unavailable(str(error) or type(error).__name__))
            except Exception as error:  # of a message that cannot be handled: raised where the user waits
                self.failure = error
            attempt = 0 if self.is_open else attempt + 1
            self.is_open = False
            if attempt > _MAX_RESUMES:
                self.resume = ""
            await self._on_lost(sentence)
            await asyncio.sleep(backoff_s(attempt))

    def send(self, message: dict[str, Any]) -> None:
        """Send a message after all earlier ones; without a connection it is lost."""
        if self.is_open:
            self._outbox.put_nowait(json.dumps(message))

    async def _connect(self) -> None:
        """Receive until the connection ends."""
        async with connect(
            self._url,
            subprotocols=[Subprotocol(SUBPROTOCOL)],
            additional_headers=self._transport.headers,
            max_size=MAX_FRAME_BYTES,
        ) as socket:
            self._outbox = asyncio.Queue()
            await socket.send(json.dumps({"type": "open", "resume": self.resume or None}))
            writer = asyncio.create_task(_write(socket, self._outbox))
            try:
                async for message in socket:
                    await self._receive(message)
                    if self.failure is not None or not self.is_open:
                        return
            finally:
                writer.cancel()

    def abandon(self) -> None:
        """Connect anew after this message."""
        self.is_open = False


async def _write(socket: ClientConnection, outbox: asyncio.Queue[str]) -> None:
    """Send queued messages; a lost connection is the reader's affair."""
    try:
        while True:
            await socket.send(await outbox.get())
    except ConnectionClosed:
        return


def _final_failure(error: Exception) -> RelumeClientError | None:
    """The error that ends the session for good; None if the server may come back."""
    if isinstance(error, NegotiationError):
        return ServerVersionError(f"the server does not speak {SUBPROTOCOL}: update relume here or there")
    if isinstance(error, InvalidStatus) and error.response.status_code in (401, 403):
        return AccessError(error.response.status_code, "login", "the server refused the session: check the token")
    if not isinstance(error, ConnectionClosed) or error.rcvd is None:
        return None
    code, reason = error.rcvd.code, error.rcvd.reason
    if code == _VERSION_CODE:
        return ServerVersionError(f"the server ended the session: {reason or 'another version of the protocol'}")
    if code in _LOGIN_CODES:
        return AccessError(code, "login", reason or "the server refused the token")
    return ProblemError(code, _BAKE_CODES[code], reason) if code in _BAKE_CODES else None
