"""Middleware before any body is read: caller, rate limit, role; and the audit.

Pure ASGI, not a dependency of routes: FastAPI reads the body before it calls dependencies, so the upload of an
unauthorized client would already be here.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume_server.auth.audit import Change
from relume_server.auth.rate_limit import TokenBuckets, bucket_name
from relume_server.auth.roles import KEY, Caller, Role
from relume_server.auth.rules import SOCKET, is_change, is_comment, required_role
from relume_server.auth.services import AuthServices
from relume_server.errors import (
    ForbiddenError,
    LoginError,
    RateError,
    find_close_code,
    make_problem,
    make_problem_headers,
    problem_response,
)
from relume_server.schemas.protocol import SUBPROTOCOL
from relume_server.telemetry.logs.context import USER
from relume_server.telemetry.logs.requests import quoted
from relume_worker.database.failures import DATABASE_ERRORS, describe_error, is_unavailable

if TYPE_CHECKING:
    from relume_server.settings import Settings

log = logging.getLogger(__name__)
_UNCHANGED = 200
"""Status of a dry run, or of a call without effect; changes answer 201, 202 or 204."""


class AuthMiddleware:
    """Middleware between `RequestLimits`, which refuses before callers are known, and the routes.

    Args:
        app: application of the routes. settings: settings of the server.
        access: called for each request, because it is opened after the app is created. clock: monotonic seconds.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        settings: Settings,
        access: Callable[[], AuthServices],
        clock: Callable[[], float],
    ) -> None:
        self._app, self._access, self._viewers_comment = app, access, settings.allow_viewer_comments
        rate = settings.requests_per_second
        self._buckets = None if rate is None else TokenBuckets(rate, settings.requests_at_once, clock)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or forward it with the caller in its scope."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        method = scope.get("method", SOCKET)
        try:
            caller = scope[KEY] = await self._identify_caller(scope)
            USER.set(caller.name)
            self._check(caller, self._required_role(method, scope["path"]))
        except (LoginError, ForbiddenError, RateError) as error:
            await self._audit_refusal(error, scope)
            await self._refuse(error, scope, receive, send)
            return
        except DATABASE_ERRORS as error:
            if not is_unavailable(error):
                log.error("the caller cannot be identified (%s)", describe_error(error))
            await self._refuse(error, scope, receive, send)
            return
        if is_change(method, scope["path"]):
            send = self._with_audit(caller, scope, send)
        await self._app(scope, receive, send)

    async def _identify_caller(self, scope: Scope) -> Caller:
        """Identify the caller, and apply the rate limit."""
        access = self._access()
        try:
            caller = await access.identity.caller(scope, access.tokens)
        except LoginError:
            scope[KEY] = Caller("", Role.ANYONE, access.identity.address(scope), "nobody")
            self._count(_caller_bucket(scope[KEY]))
            raise
        self._count(_caller_bucket(caller))
        return caller

    async def _audit_refusal(self, error: Exception, scope: Scope) -> None:
        """Add an audit row for a refused caller; a request without any token is not a login attempt."""
        caller: Caller | None = scope.get(KEY)
        is_try = Headers(scope=scope).get("authorization", "").lower().startswith("bearer ")
        if caller is not None and (isinstance(error, ForbiddenError) or (isinstance(error, LoginError) and is_try)):
            path = quoted(scope["path"])
            action = f"{scope.get('method', SOCKET)} {path}"
            await self._access().record(Change.by(caller, action, path, make_problem(error).status))

    def _count(self, name: str) -> None:
        wait_s = 0.0 if self._buckets is None else self._buckets.take(name)
        if wait_s > 0.0:
            raise RateError(
                f"you sent too many requests; wait {max(wait_s, 0.1):.1f} s, and send them less often", wait_s
            )

    def _required_role(self, method: str, path: str) -> Role:
        return Role.VIEW if self._viewers_comment and is_comment(method, path) else required_role(method, path)

    @staticmethod
    def _check(caller: Caller, role: Role) -> None:
        if caller.role >= role:
            return
        if caller.role is Role.ANYONE:
            raise LoginError("a login is required; send a token as Authorization: Bearer, or log in in the editor")
        raise ForbiddenError(
            f"{caller.name} has the role {caller.role.label}, this needs {role.label}; ask an admin for such a token"
        )

    def _with_audit(self, caller: Caller, scope: Scope, send: Send) -> Send:
        """Add an audit row for a change before its response is sent."""

        async def send_audited(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = Headers(raw=message["headers"])
                status, location = message["status"], headers.get("location", "")
                is_new = "idempotency-replayed" not in headers
                if is_new and _UNCHANGED < status < 300:  # a redirect has changed nothing yet
                    action = f"{scope['method']} {scope['path']}"
                    change = Change.by(caller, action, location or scope["path"], status)
                    await self._access().record(change)
            await send(message)

        return send_audited

    @staticmethod
    async def _refuse(error: Exception, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the refusal; a WebSocket is accepted first, because browsers show pages only its close code."""
        problem = make_problem(error)
        if scope["type"] == "http":
            await problem_response(problem, make_problem_headers(error))(scope, receive, send)
            return
        await receive()
        subprotocol = SUBPROTOCOL if SUBPROTOCOL in scope["subprotocols"] else None
        await send({"type": "websocket.accept", "subprotocol": subprotocol, "headers": []})
        await send(
            {"type": "websocket.close", "code": find_close_code(error), "reason": _truncate_reason(problem.detail)}
        )


def _caller_bucket(caller: Caller) -> str:
    """Rate-limit bucket of a caller: user and authentication method (a token may be named like an address), or
    address.
    """
    return f"{caller.auth_method} {caller.name}" if caller.name else f"address {bucket_name(caller.address)}"


def _truncate_reason(text: str) -> str:
    """Truncate a WebSocket close reason to its maximum length."""
    return text.encode()[:123].decode(errors="ignore")
