"""Read messages from a session's WebSocket."""

from __future__ import annotations

import asyncio
from typing import Any

from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.core.errors import ProtocolError
from relume_server.errors import CLOSE_POLICY, CLOSE_TOO_BIG, make_problem, message_problem
from relume_server.schemas import protocol
from relume_server.schemas.connection import OpenMessage

OPEN_SECONDS = 10.0
"""Time limit for a client's first message."""


async def read_opening(websocket: WebSocket) -> OpenMessage:
    """Read the first message of a session.

    Raises:
        WebSocketDisconnect: the client is gone.
        ProtocolError: no message in time, or another one; carries the close code.
    """
    try:
        async with asyncio.timeout(OPEN_SECONDS):
            message = read_message(await websocket.receive())
    except TimeoutError:
        raise ProtocolError(f"no message arrived within {OPEN_SECONDS:g} s; send open first", CLOSE_POLICY) from None
    if isinstance(message, protocol.Problem):
        raise ProtocolError(message.detail, CLOSE_POLICY)
    if not isinstance(message, OpenMessage):
        raise ProtocolError(f"the first message is {message.type}; send open first", CLOSE_POLICY)
    return message


def read_message(received: Any) -> protocol.ClientMessage | protocol.Problem:
    """Parse a message of ASGI, or return the problem if it is invalid.

    Raises:
        WebSocketDisconnect: the client is gone.
        ProtocolError: it is too large; carries the close code.
    """
    if received["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(received.get("code", 1005))
    text: str | None = received.get("text")
    size_bytes = len(received.get("bytes") or b"") if text is None else len(text.encode(errors="surrogatepass"))
    if size_bytes > protocol.MAX_MESSAGE_BYTES:
        raise ProtocolError(f"messages have at most {protocol.MAX_MESSAGE_BYTES} bytes; send less", CLOSE_TOO_BIG)
    if text is None:
        return make_problem(ProtocolError("messages are JSON text; send text frames", 1003))
    try:
        return protocol.CLIENT_MESSAGE.validate_json(text)
    except ValidationError as error:
        return message_problem(error, text)
