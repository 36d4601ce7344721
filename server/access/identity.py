"""Who sends a request: a token in its header or cookie, or what a trusted proxy says; without a login, anyone."""

from __future__ import annotations

import ipaddress
from typing import TYPE_CHECKING

from anyio.to_thread import run_sync
from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.types import Scope

from server.access.roles import ROLES, Caller, Role
from server.access.tokens import TokenStore
from server.errors import LoginError

if TYPE_CHECKING:
    from server.settings import Settings

COOKIE = "relume_token"
MAX_NAME = 80
OPENS_NOTHING = "this token opens nothing: it is misspelt, has run out or was revoked; ask for another"


class Identity:
    """Tells who calls, as the settings say."""

    def __init__(self, settings: Settings) -> None:
        self._is_asked = settings.login
        self._header, self._roles, self._role = settings.user_header, settings.proxy_roles, settings.proxy_role
        self._proxies = [ipaddress.ip_network(each, strict=False) for each in settings.trusted_proxies]

    async def caller(self, scope: Scope, tokens: TokenStore) -> Caller:
        """Who calls. A token in the header goes before what a proxy says, and that before a cookie.

        Raises:
            LoginError: a token was sent in the header that opens nothing.
        """
        headers, address = Headers(scope=scope), self.address(scope)
        if not self._is_asked:
            return Caller("", Role.ADMIN, address, "open")
        scheme, _, sent = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            found = await self._by_token(sent.strip(), address, tokens)
            if found is None:
                raise LoginError(OPENS_NOTHING)
            return found
        if self._is_trusted(_peer(scope)) and (named := self._by_proxy(headers, address)) is not None:
            return named
        if (cookie := cookie_of(headers)) and (found := await self._by_token(cookie, address, tokens)) is not None:
            return found
        return Caller("", Role.ANYONE, address, "nobody")

    def address(self, scope: Scope) -> str:
        """Of the client: who has connected, or where that is a trusted proxy whom it has added last."""
        peer = _peer(scope)
        told = Headers(scope=scope).get("x-forwarded-for", "") if self._is_trusted(peer) else ""
        return told.split(",")[-1].strip()[:64] or peer

    def is_secure(self, scope: Scope) -> bool:
        """Whether the browser speaks TLS, to the server or to a trusted proxy."""
        told = Headers(scope=scope).get("x-forwarded-proto", "") if self._is_trusted(_peer(scope)) else ""
        return "https" in (scope["scheme"], told.split(",")[-1].strip())

    async def _by_token(self, text: str, address: str, tokens: TokenStore) -> Caller | None:
        token = await run_sync(tokens.find, text)
        return None if token is None else Caller(token.name, token.role, address, "token", token.id)

    def _by_proxy(self, headers: Headers, address: str) -> Caller | None:
        """Whom the proxy names; a name that is none is nobody's."""
        name = _as_utf8(headers.get(self._header, "")).strip()
        if not name or not name.isprintable() or len(name) > MAX_NAME:
            return None
        return Caller(name, ROLES[self._roles.get(name, self._role)], address, "proxy")

    def _is_trusted(self, peer: str) -> bool:
        try:
            address = ipaddress.ip_address(peer)
        except ValueError:  # a socket file, or a test
            return False
        return any(address in network for network in self._proxies)


def _peer(scope: Scope) -> str:
    """Address of whoever has connected; empty where it has none."""
    return scope["client"][0] if scope.get("client") else ""


def _as_utf8(value: str) -> str:
    """A header's value, which is read as Latin-1: proxies write names in UTF-8, as settings have them."""
    try:
        return value.encode("latin-1").decode()
    except UnicodeDecodeError:  # it is Latin-1
        return value


def cookie_of(headers: Headers) -> str:
    """The token in the cookie; empty where there is none.

    Read as browsers write them: `http.cookies` reads none beside one of another program on the host that is not as
    RFC 6265 wants it.
    """
    return cookie_parser(headers.get("cookie", "")).get(COOKIE, "")
