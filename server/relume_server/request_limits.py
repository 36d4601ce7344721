"""First middleware: known host name, no foreign origin, limited body size; adds the security headers.

Pure ASGI, so that streams and WebSockets pass without buffering. A page of another site must neither open a session
(WebSockets have no same-origin policy) nor send a form; a DNS name that an attacker points here is rejected by its Host
header.

Starlette's middleware cannot replace it: TrustedHostMiddleware answers in plain text instead of a problem document and
ignores Origin; CORSMiddleware adds headers for browsers, but lets foreign requests and WebSockets through. Neither
limits the body.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume.assets.measured.merl import FILE_BYTES
from relume.core.errors import Description, ParameterError, bytes_text
from relume_server.auth.roles import KEY, Caller
from relume_server.errors import ForbiddenOriginError, TooLargeError, make_problem, problem_response

# up to the setting: a 4K environment is 25 MB, an 8K one about 100
UPLOADS = (
    "/api/scenes", "/api/environments", "/api/ies", "/api/images", "/api/luts", "/api/materials/imported",
    "/api/materials/btf/jobs", "/api/materials/btf/jobs/geometry",
)  # fmt: skip
MAX_MATERIAL_BYTES = FILE_BYTES + 64 * 1024  # the file and its form
# documents with many looks, and reference pictures, of those who may render
LARGER = ("/api/renders", "/api/renders/looks", "/api/solve")
MAX_JSON_BYTES = 1024**2
"""Limit of all other bodies. JSON is parsed on the event loop at about 40 MB per second, which blocks all others."""
MAX_LOGIN_BYTES = 4 * 1024
LOGINS = ("/api/login", "/api/logout")
PRIVATE = ("/api/", "/metrics")
HTTPS_ONLY = {"Strict-Transport-Security": "max-age=31536000"}
_NULL = re.compile(rb"%00|\0")  # not in any valid name, and PostgreSQL rejects text with it
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; worker-src 'self' blob:; "
        "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


def host_is_allowed(host: str, allowed_hosts: Sequence[str]) -> bool:
    """True if a Host header names this server."""
    return "*" in allowed_hosts or (urlsplit(f"//{host}").hostname or "") in {h.lower() for h in allowed_hosts}


def origin_is_allowed(headers: Headers, allowed_origins: Sequence[str]) -> bool:
    """True if the calling page, if any, is ours: its origin's host and port equal those of the request."""
    origin = headers.get("origin")
    if origin is None or origin in allowed_origins:
        return True
    origin_url = urlsplit(origin)
    return origin_url.scheme in ("http", "https") and origin_url.netloc.lower() == headers.get("host", "").lower()


class RequestLimits:
    """Middleware for host, origin and body size; adds the security headers."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        allowed_hosts: Sequence[str],
        allowed_origins: Sequence[str],
        max_body_bytes: int,
        max_upload_bytes: int,
        https_only: bool,
        count: Callable[[str, int, float], None],
    ) -> None:
        self._app, self._count = app, count
        self._allowed_hosts, self._allowed_origins = allowed_hosts, allowed_origins
        self._max_body_bytes, self._max_upload_bytes = max_body_bytes, max_upload_bytes
        self._headers = SECURITY_HEADERS | (HTTPS_ONLY if https_only else {})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or forward it with a counted body and security headers."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] == "http":
            send = self._with_safe_headers(scope, send)
        refusal = self._refusal(scope)
        if refusal is not None:
            await _refuse(refusal, scope, receive, send)
        elif scope["type"] == "websocket":
            await self._app(scope, receive, send)
        else:
            await self._pass(scope, receive, send)

    def _refusal(self, scope: Scope) -> Exception | None:
        headers = Headers(scope=scope)
        try:
            if not host_is_allowed(headers.get("host", ""), self._allowed_hosts):
                return ForbiddenOriginError("this host name is not allowed; add it to RELUME_ALLOWED_HOSTS")
            is_safe = scope["type"] == "http" and scope["method"] in SAFE_METHODS
            if not is_safe and not origin_is_allowed(headers, self._allowed_origins):
                return ForbiddenOriginError("requests from other origins are not allowed; see RELUME_ALLOWED_ORIGINS")
            if "\0" in scope["path"] or _NULL.search(scope["query_string"]) is not None:
                return ParameterError(
                    "the address", Description("a text with a null character"), "an address without %00"
                )
            length = headers.get("content-length", "0")
            if not length.isdecimal() or int(length[:20]) > self._limit(scope):
                return self._too_large(scope)
        except ValueError:  # raised by urlsplit for a malformed host or origin
            return ForbiddenOriginError("the Host or Origin header is malformed; send a valid one")
        return None

    def _with_safe_headers(self, scope: Scope, send: Send) -> Send:
        """Add the security headers to every response, and count it."""

        start_s = time.perf_counter()

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._count(scope["method"], message["status"], time.perf_counter() - start_s)
                headers = MutableHeaders(scope=message)
                for name, value in self._headers.items():
                    headers.setdefault(name, value)
                if scope["path"].startswith(PRIVATE):  # shared caches must not serve it to others
                    headers.setdefault("Cache-Control", "private")
                    headers.add_vary_header("Cookie, Authorization")
            await send(message)

        return send_with_headers

    def _limit(self, scope: Scope) -> int:
        path = scope["path"]
        if path in UPLOADS:
            return self._max_upload_bytes
        if path == "/api/materials/measured":
            return MAX_MATERIAL_BYTES
        caller: Caller | None = scope.get(KEY)  # known once the body is read
        if path in LARGER and (caller is None or caller.may_edit):
            return self._max_body_bytes
        return min(MAX_LOGIN_BYTES if path in LOGINS else MAX_JSON_BYTES, self._max_body_bytes)

    def _too_large(self, scope: Scope) -> TooLargeError:
        return TooLargeError(f"the request is larger than {bytes_text(self._limit(scope))}; send less")

    async def _pass(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Count the body while it streams in; exceeding the limit ends in 413 whatever the app does with it."""
        num_bytes, is_over, is_started = 0, False, False

        async def counted() -> Message:
            nonlocal num_bytes, is_over
            message = await receive()
            num_bytes += len(message.get("body", b""))
            if num_bytes > self._limit(scope):
                is_over = True
                raise self._too_large(scope)
            return message

        async def unless_over(message: Message) -> None:
            nonlocal is_started
            if is_over and not is_started:
                return
            is_started = True
            await send(message)

        try:
            await self._app(scope, counted, unless_over)
        except TooLargeError:
            if is_started:
                raise
        if is_over and not is_started:
            await _refuse(self._too_large(scope), scope, receive, send)


async def _refuse(error: Exception, scope: Scope, receive: Receive, send: Send) -> None:
    problem = make_problem(error)
    response = problem_response(problem, {"Connection": "close"} if problem.status == 413 else None)
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008, "reason": problem.detail})
    else:
        await response(scope, receive, send)
