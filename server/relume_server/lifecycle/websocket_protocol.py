"""uvicorn's WebSockets, that answer whatever asks for one."""

from __future__ import annotations

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_NO_REQUEST = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


class Socket(WebSocketsSansIOProtocol):
    """A WebSocket whose request, where it cannot be read, is refused.

    Of a line beyond 8 KiB, as the cookies of a login may be, or more than 128 headers, `websockets` makes a refusal
    that uvicorn never sends: who asked waited for ever, and held a connection.
    """

    def data_received(self, data: bytes) -> None:
        """Bytes have come; see `asyncio.Protocol`."""
        super().data_received(data)
        if self.conn.handshake_exc is None or self.handshake_initiated:
            return
        self.handshake_complete = self.close_sent = True
        self.transport.write(b"".join(self.conn.data_to_send()) or _NO_REQUEST)
        self.transport.close()
