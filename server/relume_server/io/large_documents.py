"""Large JSON documents: a few of one user at a time.

FastAPI parses a body on the event loop. A large one takes tenths of a second; between two, the loop serves others.
"""

from __future__ import annotations

from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from relume_server.auth.roles import KEY
from relume_server.io.fair_slots import Slots
from relume_server.request_limits import LARGER, MAX_JSON_BYTES

DOCUMENTS_AT_ONCE = 16


class LargeDocumentMiddleware:
    """Middleware behind authentication, for documents that may be larger than others.

    Args:
        app: application to protect. max_per_user: concurrent documents of one user; others wait.
        weights: weights of users in scheduling.
    """

    def __init__(self, app: ASGIApp, *, max_per_user: int, weights: Mapping[str, float]) -> None:
        self._app = app
        self._slots = Slots(DOCUMENTS_AT_ONCE, max_per_user, weights)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request; a large document, or one of unknown length, in a slot."""
        if scope["type"] == "http" and scope["method"] == "POST" and scope["path"] in LARGER and _may_be_large(scope):
            async with self._slots.acquire(scope[KEY].name):
                await self._app(scope, receive, send)
        else:
            await self._app(scope, receive, send)


def _may_be_large(scope: Scope) -> bool:
    length = Headers(scope=scope).get("content-length", "")
    return not length.isdecimal() or int(length) > MAX_JSON_BYTES
