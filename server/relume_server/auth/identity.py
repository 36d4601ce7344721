"""Identify the caller: by a token in header or cookie, or by a trusted proxy; without login everyone is admin."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from anyio.to_thread import run_sync
from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.types import Scope

from relume_server.auth.proxies import Proxies
from relume_server.auth.rate_limit import TokenBuckets, bucket_name
from relume_server.auth.roles import PROXY, ROLES, Caller, Role
from relume_server.auth.tokens import TokenStore
from relume_server.errors import LoginError, RateError

if TYPE_CHECKING:
    from relume_server.settings import Settings

COOKIE = "relume_token"
MAX_NAME = 80
OPENS_NOTHING = "this token is not valid: it is misspelled, expired or revoked; ask for a new one"
UNKNOWN_PER_SECOND = 20.0
"""Token lookups per second for an address that has shown no valid token, without a setting."""


class Identity:
    """Identifies callers by the settings. Event loop only."""

    def __init__(self, settings: Settings) -> None:
        self._requires_login = settings.login
        self._header, self._roles, self._role = settings.user_header, settings.proxy_roles, settings.proxy_role
        self._proxies = Proxies(settings.trusted_proxies, time.monotonic)
        rate = settings.requests_per_second or UNKNOWN_PER_SECOND
        self._unknown = TokenBuckets(rate, settings.requests_at_once, time.monotonic)

    async def caller(self, scope: Scope, tokens: TokenStore) -> Caller:
        """Return the caller. A token in the header takes precedence over a proxy, and a proxy over a cookie.

        Raises:
            LoginError: the token in the header is not valid.
            RateError: too many invalid tokens were sent from this address.
        """
        await self._proxies.resolve(_peer(scope))
        headers, address = Headers(scope=scope), self.address(scope)
        if not self._requires_login:
            return Caller("", Role.ADMIN, address, "open")
        scheme, _, credentials = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            token_caller = await self.by_token(credentials.strip(), address, tokens)
            if token_caller is None:
                raise LoginError(OPENS_NOTHING)
            return token_caller
        if self._proxies.has(_peer(scope)) and (proxy_caller := self._by_proxy(headers, address)) is not None:
            return proxy_caller
        if (cookie := read_token_cookie(headers)) and (
            token_caller := await self.by_token(cookie, address, tokens)
        ) is not None:
            return token_caller
        return Caller("", Role.ANYONE, address, "nobody")

    def address(self, scope: Scope) -> str:
        """Address of the client: the peer, or for a trusted proxy the last one it has forwarded."""
        return self._proxy_header(scope, "x-forwarded-for")[:64] or _peer(scope)

    def is_secure(self, scope: Scope) -> bool:
        """True if the browser uses TLS, to the server or to a trusted proxy."""
        return "https" in (scope["scheme"], self._proxy_header(scope, "x-forwarded-proto"))

    async def forwarded(self, scope: Scope, name: str) -> str:
        """Header of a trusted proxy: the last of its values; empty for any other peer."""
        await self._proxies.resolve(_peer(scope))
        return self._proxy_header(scope, name)

    async def by_token(self, text: str, address: str, tokens: TokenStore) -> Caller | None:
        """Return the caller of a token; asks the database, unless the result is cached.

        Lookups per address are limited, so that guessing tokens cannot keep the database busy. A client with a token
        that was valid before is not delayed by guesses from its address.

        Raises:
            RateError: too many lookups.
        """
        is_guess, bucket = not tokens.is_cached(text), bucket_name(address)
        wait_s = self._unknown.take(bucket) if is_guess else 0.0
        if wait_s > 0.0:
            raise RateError(
                f"you sent too many wrong tokens; wait {max(wait_s, 0.1):.1f} s, then send a right one", wait_s
            )
        token = await run_sync(tokens.authenticate, text)
        if token is None:
            return None
        if is_guess:
            self._unknown.refund(bucket)
        return Caller(token.name, token.role, address, "token", token.id)

    def _by_proxy(self, headers: Headers, address: str) -> Caller | None:
        """Return the caller that the proxy names, if it may; None for an invalid name."""
        name = _as_utf8(_last(headers, self._header)).strip() if self._header else ""
        if not name or not name.isprintable() or len(PROXY + name) > MAX_NAME:
            return None
        return Caller(PROXY + name, ROLES[self._roles.get(name, self._role)], address, "proxy")

    def _proxy_header(self, scope: Scope, name: str) -> str:
        """Last value of a trusted proxy's header; empty for any other peer."""
        if not self._proxies.has(_peer(scope)):
            return ""
        return _last(Headers(scope=scope), name).split(",")[-1].strip()


def _peer(scope: Scope) -> str:
    """Address of the peer; empty if it has none."""
    return scope["client"][0] if scope.get("client") else ""


def _last(headers: Headers, name: str) -> str:
    """Last line of a header, which the proxy has added; lines before may come from the client."""
    return (headers.getlist(name) or [""])[-1]


def _as_utf8(value: str) -> str:
    """Decode a header value as UTF-8, as proxies write names; ASGI reads it as Latin-1."""
    try:
        return value.encode("latin-1").decode()
    except UnicodeDecodeError:  # not UTF-8
        return value


def read_token_cookie(headers: Headers) -> str:
    """Token in the cookie; empty if there is none.

    Parsed like browsers write it: `http.cookies` finds nothing next to another program's cookie that violates RFC 6265.
    """
    return cookie_parser(headers.get("cookie", "")).get(COOKIE, "")
