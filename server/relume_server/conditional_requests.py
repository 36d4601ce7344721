"""HEAD for every GET, and 304 Not Modified (RFC 9110, section 13).

A middleware, so that routes handle neither: it forwards a HEAD as a GET and drops the body, and compares the response's
validators with those of the request. JSON responses get an ETag here.
"""

from __future__ import annotations

import hashlib
from email.utils import parsedate_to_datetime

from anyio import CancelScope
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_CONTENT = (b"content-length", b"content-type", b"content-encoding", b"content-range", b"content-disposition")
_MAX_HASHED_BYTES = 4 << 20


class Conditional:
    """Middleware for HEAD and conditional requests; the app sees GET only."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request, and drop the body if the client does not need it."""
        if scope["type"] != "http" or scope["method"] not in ("GET", "HEAD"):
            await self._app(scope, receive, send)
            return
        answer = _ConditionalResponse(scope, send)
        with CancelScope() as running:
            answer.running = running
            await self._app({**scope, "method": "GET"}, receive, answer.send)


class _ConditionalResponse:
    """One response; its start is held until the first part of its body."""

    running: CancelScope

    def __init__(self, scope: Scope, send: Send) -> None:
        self._is_head, self._request_headers, self._send = scope["method"] == "HEAD", Headers(scope=scope), send
        self._start: Message | None = None
        self._is_over = False

    async def send(self, message: Message) -> None:
        """Receive an ASGI message of the app."""
        if self._is_over:
            return
        if message["type"] == "http.response.start":
            self._start = message
            if self._is_head and _is_stream(message):  # the first part may take long
                await self._end(message, is_not_modified=False)
                self.running.cancel()
            return
        if (start := self._start) is not None:
            self._start = None
            _add_etag(start, message)
            if (is_not_modified := self._is_not_modified(start)) or self._is_head:
                await self._end(start, is_not_modified=is_not_modified)
                if message.get("more_body", False):
                    self.running.cancel()
                return
            await self._send(start)
        await self._send(message)

    async def _end(self, start: Message, *, is_not_modified: bool) -> None:
        """Send the response without a body."""
        self._is_over = True
        if is_not_modified:
            headers = [(name, value) for name, value in start["headers"] if name.lower() not in _CONTENT]
            start = {**start, "status": 304, "headers": headers}
        await self._send(start)
        await self._send({"type": "http.response.body", "body": b"", "more_body": False})

    def _is_not_modified(self, start: Message) -> bool:
        """True if the client already has this version."""
        headers = Headers(raw=start["headers"])
        if start["status"] != 200:
            return False
        if (tags := self._request_headers.get("if-none-match")) is not None:
            etag = headers.get("etag", "").removeprefix("W/")
            etags = [tag.strip().removeprefix("W/") for tag in tags.split(",")]
            return bool(etag) and ("*" in etags or etag in etags)
        if (since := self._request_headers.get("if-modified-since")) is not None and "last-modified" in headers:
            try:
                return parsedate_to_datetime(headers["last-modified"]) <= parsedate_to_datetime(since)
            except (ValueError, TypeError):  # not a date, or without time zone: ignored
                return False
        return False


def _is_stream(start: Message) -> bool:
    return "content-length" not in Headers(raw=start["headers"])


def _add_etag(start: Message, body: Message) -> None:
    """Add an ETag to a complete JSON response that has none."""
    headers = MutableHeaders(raw=start["headers"])
    content = body.get("body", b"")
    is_json = headers.get("content-type", "").partition(";")[0] == "application/json"
    is_whole = not body.get("more_body", False) and len(content) <= _MAX_HASHED_BYTES
    if start["status"] == 200 and is_json and is_whole and "etag" not in headers:
        headers["ETag"] = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
        start["headers"] = headers.raw
