"""uvicorn's WebSockets, with a response to malformed requests."""

from __future__ import annotations

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_NO_REQUEST = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


class Socket(WebSocketsSansIOProtocol):
    """A WebSocket that refuses unreadable requests.

    For a line above 8 KiB, such as a login's cookies, or more than 128 headers, `websockets` creates a refusal that
    uvicorn never sends: the client would wait forever, and hold a connection.
    """

    def data_received(self, data: bytes) -> None:
        """See `asyncio.Protocol`."""
        super().data_received(data)
        if self.conn.handshake_exc is None or self.handshake_initiated:
            return
        self.handshake_complete = self.close_sent = True
        self.transport.write(b"".join(self.conn.data_to_send()) or _NO_REQUEST)
        self.transport.close()
