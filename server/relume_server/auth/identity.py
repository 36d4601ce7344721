"""Who sends a request: a token in its header or cookie, or what a trusted proxy says; without a login, anyone."""

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
OPENS_NOTHING = "this token opens nothing: it is misspelt, has run out or was revoked; ask for another"
UNKNOWN_PER_SECOND = 20.0
"""How many tokens that are not known to be right are looked up for an address, where the settings do not say."""


class Identity:
    """Tells who calls, as the settings say; on the event loop."""

    def __init__(self, settings: Settings) -> None:
        self._requires_login = settings.login
        self._header, self._roles, self._role = settings.user_header, settings.proxy_roles, settings.proxy_role
        self._proxies = Proxies(settings.trusted_proxies, time.monotonic)
        rate = settings.requests_per_second or UNKNOWN_PER_SECOND
        self._unknown = TokenBuckets(rate, settings.requests_at_once, time.monotonic)

    async def caller(self, scope: Scope, tokens: TokenStore) -> Caller:
        """Who calls. A token in the header goes before what a proxy says, and that before a cookie.

        Raises:
            LoginError: a token was sent in the header that opens nothing.
            RateError: too many such were sent from there.
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
        """Of the client: who has connected, or where that is a trusted proxy whom it has added last."""
        return self._proxy_header(scope, "x-forwarded-for").split(",")[-1].strip()[:64] or _peer(scope)

    def is_secure(self, scope: Scope) -> bool:
        """Whether the browser speaks TLS, to the server or to a trusted proxy."""
        return "https" in (scope["scheme"], self._proxy_header(scope, "x-forwarded-proto").split(",")[-1].strip())

    async def by_token(self, text: str, address: str, tokens: TokenStore) -> Caller | None:
        """Whose token a text is; asks the database, unless it has just done so.

        Only so many guesses of an address are looked up: whoever may guess at will keeps the database busy for all. Who
        has shown a right token before is not held up by others' guesses from there.

        Raises:
            RateError: enough have been looked up for now.
        """
        is_guess, bucket = not tokens.is_cached(text), bucket_name(address)
        wait_s = self._unknown.take(bucket) if is_guess else 0.0
        if wait_s > 0.0:
            raise RateError(f"too many wrong tokens; wait {max(wait_s, 0.1):.1f} s, then send a right one", wait_s)
        token = await run_sync(tokens.authenticate, text)
        if token is None:
            return None
        if is_guess:
            self._unknown.refund(bucket)
        return Caller(token.name, token.role, address, "token", token.id)

    def _by_proxy(self, headers: Headers, address: str) -> Caller | None:
        """Whom the proxy names, where it may; a name that is none is nobody's."""
        name = _as_utf8(_last(headers, self._header)).strip() if self._header else ""
        if not name or not name.isprintable() or len(PROXY + name) > MAX_NAME:
            return None
        return Caller(PROXY + name, ROLES[self._roles.get(name, self._role)], address, "proxy")

    def _proxy_header(self, scope: Scope, name: str) -> str:
        """What a trusted proxy says in a header; empty where nobody is trusted."""
        return _last(Headers(scope=scope), name) if self._proxies.has(_peer(scope)) else ""


def _peer(scope: Scope) -> str:
    """Address of whoever has connected; empty where it has none."""
    return scope["client"][0] if scope.get("client") else ""


def _last(headers: Headers, name: str) -> str:
    """The last line of a header, which the proxy has added where it adds lines; those before may be the client's."""
    return (headers.getlist(name) or [""])[-1]


def _as_utf8(value: str) -> str:
    """A header's value, which is read as Latin-1: proxies write names in UTF-8, as settings have them."""
    try:
        return value.encode("latin-1").decode()
    except UnicodeDecodeError:  # it is Latin-1
        return value


def read_token_cookie(headers: Headers) -> str:
    """The token in the cookie; empty where there is none.

    Read as browsers write them: `http.cookies` reads none beside one of another program on the host that is not as
    RFC 6265 wants it.
    """
    return cookie_parser(headers.get("cookie", "")).get(COOKIE, "")
