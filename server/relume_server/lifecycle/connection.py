"""uvicorn's HTTP, with bounds on what a connection may send and how long it may take before its request is whole.

uvicorn has no such bounds for its fast parser, and for its slow one of bytes alone.
"""

from __future__ import annotations

import asyncio
import resource
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

MAX_CONNECTIONS = max(100, min(1_000, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2))
MAX_HEAD_BYTES = 64 * 1024
MAX_HEADERS = 200
HEAD_SECONDS = 10.0
BODY_SECONDS = 30.0
MIN_BODY_BYTES_PER_SECOND = 10_000

_CLOSE = b"Connection: close\r\nContent-Length: 0\r\n\r\n"
_BUSY = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\n" + _CLOSE
_LATE = b"HTTP/1.1 408 Request Timeout\r\n" + _CLOSE
_LARGE_HEAD = b"HTTP/1.1 431 Request Header Fields Too Large\r\n" + _CLOSE


class Connection(HttpToolsProtocol):
    """A connection whose requests are bounded: the head in bytes and seconds, the body in how slowly it may come.

    A head may be longer by what one read brings, 256 KiB. A body may take `BODY_SECONDS`, and a second
    more for each `MIN_BODY_BYTES_PER_SECOND` that have come. While the app does not take what has come, the client is
    not at fault.
    """

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._is_in_head, self._num_head_bytes, self._num_header_bytes, self._num_body_bytes = True, 0, 0, 0
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """See `asyncio.Protocol`; one too many is told so and closed."""
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
            self._end(_BUSY)
        else:
            self._expect(HEAD_SECONDS)

    def connection_lost(self, exc: Exception | None) -> None:
        """See `asyncio.Protocol`."""
        self._expect_nothing()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """See `asyncio.Protocol`; a head that grows beyond its bound is refused."""
        if self.transport.is_closing():
            return
        if self._is_in_head:
            self._num_head_bytes += len(data)
        super().data_received(data)
        if self._is_in_head and self._num_head_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
            self._end(_LARGE_HEAD)

    def on_message_begin(self) -> None:
        """The parser has the first byte of a request."""
        self._num_header_bytes = 0
        if self._deadline is None:
            self._expect(HEAD_SECONDS)
        super().on_message_begin()

    def on_header(self, name: bytes, value: bytes) -> None:
        """The parser has a header. Raises ValueError, which uvicorn answers with 400: there are too many."""
        self._num_header_bytes += len(name) + len(value)
        if self._num_header_bytes > MAX_HEAD_BYTES or len(self.headers) >= MAX_HEADERS:
            raise ValueError("too many headers")
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """The parser has a whole head."""
        self._is_in_head = False
        self._num_body_bytes = 0
        self._expect(BODY_SECONDS)
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """The parser has some of a body."""
        self._num_body_bytes += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """The parser has a whole request."""
        self._is_in_head, self._num_head_bytes = True, 0
        self._expect_nothing()
        super().on_message_complete()

    def handle_websocket_upgrade(self) -> None:
        """Another protocol goes on with the connection."""
        self._expect_nothing()
        super().handle_websocket_upgrade()

    def _expect(self, seconds: float) -> None:
        """Look whether what is awaited has come after so many seconds."""
        self._expect_nothing()
        self._deadline = self.loop.call_later(seconds, self._late)

    def _expect_nothing(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _late(self) -> None:
        """A deadline has passed: give a body as long as its bytes are worth, else end."""
        self._deadline = None
        is_answering = self.cycle is not None and not self.cycle.response_complete
        if self.transport.is_closing():
            return
        if self.flow.read_paused or (self._is_in_head and is_answering):  # the client may have to wait for the app
            self._expect(BODY_SECONDS)
        elif self._is_in_head:
            self._end(_LATE)
        elif self._num_body_bytes >= MIN_BODY_BYTES_PER_SECOND:
            worth_s, self._num_body_bytes = self._num_body_bytes / MIN_BODY_BYTES_PER_SECOND, 0
            self._expect(worth_s)
        else:
            self._end(_LATE)

    def _end(self, answer: bytes) -> None:
        """Close, with an answer where none has begun."""
        has_started = self.cycle is not None and self.cycle.response_started
        if self._is_in_head or not has_started:
            self.transport.write(answer)
        self.transport.close()
