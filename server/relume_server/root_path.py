"""Serve below a path prefix, such as /relume, at which a proxy publishes the server.

Pure ASGI, before all middlewares that compare paths: behind it, paths begin at the root of the server, whether the
proxy has removed the prefix or not. Bodies name paths of the server without the prefix, because only browsers know it
if the proxy sends no header; `Location`, `Link`, the cookie's path and the OpenAPI description have it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume_server.settings import parse_root_path

if TYPE_CHECKING:
    from relume_server.auth.identity import Identity

FORWARDED = "x-forwarded-prefix"


class RootPath:
    """Middleware that removes the prefix from paths and adds it to `Location` and `Link`.

    Args:
        app: application at the root. root_path: prefix of the settings; empty: the one that a trusted proxy sends.
        identity: called for each request, because it is opened after the app is created.
    """

    def __init__(self, app: ASGIApp, *, root_path: str, identity: Callable[[], Identity]) -> None:
        self._app, self._root_path, self._identity = app, root_path, identity

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request with its path at the root, and the prefix as `root_path`."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        prefix, path = self._root_path or await self._forwarded(scope), scope["path"]
        decoded = unquote(prefix)
        if prefix and path == decoded and scope["type"] == "http":  # addresses of the page are relative to its folder
            query = scope["query_string"].decode("latin-1")
            await RedirectResponse(f"{prefix}/" + (f"?{query}" if query else ""), 308)(scope, receive, send)
            return
        if path.startswith(f"{decoded}/"):
            path = path.removeprefix(decoded)
        await self._app({**scope, "path": path, "root_path": prefix}, receive, _with_prefix(prefix, send))

    async def _forwarded(self, scope: Scope) -> str:
        """Prefix that a trusted proxy has removed; an invalid one counts as none."""
        with suppress(ValueError):
            return parse_root_path(await self._identity().forwarded(scope, FORWARDED))
        return ""


def _with_prefix(prefix: str, send: Send) -> Send:
    """Add the prefix to paths of the server in `Location`, also to those with scheme and host, and in `Link`."""

    async def send_with_prefix(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            location = headers.get("location", "")
            path = urlsplit(location)._replace(scheme="", netloc="").geturl()
            if path.startswith("/"):
                headers["location"] = prefix + path
            if (link := headers.get("link", "")).startswith("</"):
                headers["link"] = f"<{prefix}{link[1:]}"
        await send(message)

    return send_with_prefix
