"""uvicorn's HTTP with limits on request size and time.

uvicorn has no such limits for its fast parser, and only a size limit for its slow one.
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
WRITE_SECONDS = 120.0
MIN_WRITE_BYTES = 1 << 16

_CLOSE = b"Connection: close\r\nContent-Length: 0\r\n\r\n"
_BUSY = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\n" + _CLOSE
_LATE = b"HTTP/1.1 408 Request Timeout\r\n" + _CLOSE
_LARGE_HEAD = b"HTTP/1.1 431 Request Header Fields Too Large\r\n" + _CLOSE


class Connection(HttpToolsProtocol):
    """A connection with limits: size and time of the head, minimum rate of the body and of unsent responses.

    A head may exceed its limit by one read, 256 KiB. A body may take `BODY_SECONDS`, plus one second for each
    `MIN_BODY_BYTES_PER_SECOND` received. Time in which the app does not read is not counted.
    Of a response that waits, at least `MIN_WRITE_BYTES` must be sent within `WRITE_SECONDS`, or all of it.
    """

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._is_in_head, self._num_head_bytes, self._num_header_bytes, self._num_body_bytes = True, 0, 0, 0
        self._deadline: asyncio.TimerHandle | None = None
        self._write_deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """See `asyncio.Protocol`; a connection above the limit gets an error and is closed."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=0)  # writing is paused, and limited in time, by any unsent byte
        if len(self.connections) > MAX_CONNECTIONS:
            self._end(_BUSY)
        else:
            self._expect(HEAD_SECONDS)

    def connection_lost(self, exc: Exception | None) -> None:
        """See `asyncio.Protocol`."""
        self._expect_nothing()
        self._end_write_deadline()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """See `asyncio.Protocol`; a head above the limit is refused."""
        if self.transport.is_closing():
            return
        if self._is_in_head:
            self._num_head_bytes += len(data)
        super().data_received(data)
        if self._is_in_head and self._num_head_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
            self._end(_LARGE_HEAD)

    def on_message_begin(self) -> None:
        """The parser has received the first byte of a request."""
        self._num_header_bytes = 0
        if self._deadline is None:
            self._expect(HEAD_SECONDS)
        super().on_message_begin()

    def on_header(self, name: bytes, value: bytes) -> None:
        """The parser has received a header. Raises ValueError (uvicorn answers 400) if there are too many."""
        self._num_header_bytes += len(name) + len(value)
        if self._num_header_bytes > MAX_HEAD_BYTES or len(self.headers) >= MAX_HEADERS:
            raise ValueError("too many headers")
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """The parser has received a whole head."""
        self._is_in_head = False
        self._num_body_bytes = 0
        self._expect(BODY_SECONDS)
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """The parser has received part of a body."""
        self._num_body_bytes += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """The parser has received a whole request."""
        self._is_in_head, self._num_head_bytes = True, 0
        self._expect_nothing()
        super().on_message_complete()

    def handle_websocket_upgrade(self) -> None:
        """Hand the connection over to the WebSocket protocol."""
        self._expect_nothing()
        self._end_write_deadline()
        self.transport.set_write_buffer_limits()
        super().handle_websocket_upgrade()

    def pause_writing(self) -> None:
        """See `asyncio.Protocol`; the client has `WRITE_SECONDS`."""
        super().pause_writing()
        self._limit_write()

    def resume_writing(self) -> None:
        """See `asyncio.Protocol`."""
        self._end_write_deadline()
        super().resume_writing()

    def _limit_write(self) -> None:
        """Check in `WRITE_SECONDS` that enough has been sent."""
        num_unsent = self.transport.get_write_buffer_size()
        self._write_deadline = self.loop.call_later(WRITE_SECONDS, self._check_write, num_unsent)

    def _end_write_deadline(self) -> None:
        if self._write_deadline is not None:
            self._write_deadline.cancel()
            self._write_deadline = None

    def _check_write(self, num_unsent: int) -> None:
        """Close without sending the rest if too little of so many bytes has been sent."""
        if num_unsent - self.transport.get_write_buffer_size() < MIN_WRITE_BYTES:
            self.transport.abort()
        else:
            self._limit_write()

    def _expect(self, seconds: float) -> None:
        """Check in so many seconds that the expected data has been received."""
        self._expect_nothing()
        self._deadline = self.loop.call_later(seconds, self._late)

    def _expect_nothing(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _late(self) -> None:
        """Handle a missed deadline: extend it for a body by the bytes received, otherwise close."""
        self._deadline = None
        is_answering = self.cycle is not None and not self.cycle.response_complete
        if self.transport.is_closing():
            return
        if self.flow.read_paused or (self._is_in_head and is_answering):  # the app may not be reading
            self._expect(BODY_SECONDS)
        elif self._is_in_head:
            self._end(_LATE)
        elif self._num_body_bytes >= MIN_BODY_BYTES_PER_SECOND:
            worth_s, self._num_body_bytes = self._num_body_bytes / MIN_BODY_BYTES_PER_SECOND, 0
            self._expect(worth_s)
        else:
            self._end(_LATE)

    def _end(self, answer: bytes) -> None:
        """Close, with a response if none has started."""
        has_started = self.cycle is not None and self.cycle.response_started
        if self._is_in_head or not has_started:
            self.transport.write(answer)
        self.transport.close()
