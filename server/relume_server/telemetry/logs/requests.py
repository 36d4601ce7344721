"""Assign an id to every request, or keep a proxy's, and return and log it.

Pure ASGI. The log has the path without its query, which may contain a resume token.
"""

from __future__ import annotations

import logging
import re
import secrets
import time
from urllib.parse import quote

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume_server.telemetry.logs.context import REQUEST

log = logging.getLogger(__name__)
HEADER = "X-Request-ID"
_FORM = re.compile(r"[A-Za-z0-9._:-]{1,64}")


def quoted(path: str) -> str:
    """Escape line breaks and terminal codes in a path, which clients choose."""
    return quote(path, safe="/:@!$&'()*+,;=~")


class RequestIds:
    """The outermost middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Set the request id while the request is served."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        header_value = Headers(scope=scope).get(HEADER, "")
        identity = header_value if _FORM.fullmatch(header_value) else secrets.token_hex(8)
        reset_token, start_s, status = REQUEST.set(identity), time.perf_counter(), 0

        async def send_with_id(message: Message) -> None:
            nonlocal status
            status = message.get("status", message.get("code", status or 101))
            if message["type"] in ("http.response.start", "websocket.accept", "websocket.http.response.start"):
                MutableHeaders(scope=message)[HEADER] = identity
            await send(message)

        try:
            await self._app(scope, receive, send_with_id)
        finally:
            seconds = time.perf_counter() - start_s
            method = scope.get("method", "WEBSOCKET")
            fields = {"method": method, "path": quoted(scope["path"]), "status": status, "seconds": round(seconds, 4)}
            log.info("%s %s %d in %.4f s", *fields.values(), extra={"fields": fields})
            REQUEST.reset(reset_token)
