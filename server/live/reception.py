"""The receiving half of a session: reads messages, checks them, and notes what the client wants."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from relume.errors import ParameterError, ProtocolError, RelumeError
from server import protocol
from server.errors import CLOSE_POLICY, CLOSE_TOO_BIG, message_problem
from server.live.parts import Parts
from server.live.pointers import check_held, find_curve

MAX_BAD_MESSAGES = 50


class Reception:
    """Runs until the client goes or breaks the rules too often."""

    def __init__(self, websocket: WebSocket, parts: Parts) -> None:
        self._websocket, self._wire, self._wishes, self._shown = websocket, parts.wire, parts.wishes, parts.shown
        self._window, self._desk, self._transfer = parts.window, parts.desk, parts.transfer
        self._metrics = parts.metrics
        self._num_bad = 0

    async def run(self) -> None:
        """Receive for ever.

        Raises:
            WebSocketDisconnect: the client is gone.
            ProtocolError: the session must end; carries the close code.
        """
        while True:
            received = await self._websocket.receive()
            received_s = time.perf_counter()
            text = _text_of(received)
            if text is None:
                await self._bad(ProtocolError("messages are JSON text; send text frames", 1003))
                continue
            try:
                message = protocol.CLIENT_MESSAGE.validate_json(text)
            except ValidationError as error:
                await self._bad(message_problem(error))
                continue
            try:
                self._take(message, received_s)
            except RelumeError as error:
                revision = message.revision if isinstance(message, protocol.EditMessage) else None
                await self._wire.refuse(error, revision)
            self._wishes.news.set()

    async def _bad(self, problem: Exception | protocol.Problem) -> None:
        """A message that no client of ours sends: said each time, forgiven a number of times."""
        self._num_bad += 1
        if self._num_bad > MAX_BAD_MESSAGES:
            raise ProtocolError("too many messages that cannot be understood; reload the page", CLOSE_POLICY)
        await self._wire.refuse(problem)

    def _take(self, message: protocol.ClientMessage, received_s: float) -> None:
        match message:
            case protocol.EditMessage():
                self._edit(message, received_s)
            case protocol.AckMessage():
                self._window.acknowledged(message.frame, received_s)
            case protocol.ViewMessage():
                self._show([message.name])
            case protocol.ViewsMessage():
                self._show(message.names)
            case protocol.FocusMessage():
                self._shown.work_in(message.view)
            case protocol.StreamMessage():
                self._wishes.form, self._wishes.quality = message.format, message.quality
            case protocol.ProbeMessage():
                self._shown.check(message.view or self._shown.focus)
                self._wishes.probe = message
            case protocol.BrushMessage():
                find_curve(message.curve, self._desk.document)
                self._wishes.brush = message
            case protocol.TouchMessage():
                self._touch(message)

    def _touch(self, message: protocol.TouchMessage) -> None:
        if message.curve is not None:
            find_curve(message.curve, self._desk.document)
            self._wishes.touch = message.curve
        elif message.parameter is not None:
            check_held(message.parameter, self._desk.document)
            self._wishes.hold = message.parameter

    def _edit(self, message: protocol.EditMessage, received_s: float) -> None:
        try:
            self._wishes.target = self._desk.apply(message, received_s)
        except RelumeError:
            self._metrics.edits.labels("refused").inc()
            raise
        self._metrics.edits.labels("applied").inc()

    def _show(self, names: Sequence[str]) -> None:
        for name in names:
            if name not in self._transfer.views:
                raise ParameterError("view", name, "one of " + ", ".join(sorted(self._transfer.views))[:400])
        self._shown.show(names)


def _text_of(message: Any) -> str | None:
    """The text of a received message; None for a binary one."""
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    text: str | None = message.get("text")
    size_bytes = len(message.get("bytes") or b"") if text is None else len(text.encode(errors="surrogatepass"))
    if size_bytes > protocol.MAX_MESSAGE_BYTES:
        raise ProtocolError(f"messages have at most {protocol.MAX_MESSAGE_BYTES} bytes; send less", CLOSE_TOO_BIG)
    return text
