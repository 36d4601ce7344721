"""Serve the built editor: hashed assets are cached forever, the page never; unknown paths lead to the page."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketClose

FOR_EVER = "public, max-age=31536000, immutable"
NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>relume</title>
<p>The server is running, but the editor is not built. Build it and reload:</p>
<pre>cd client_web &amp;&amp; npm ci &amp;&amp; npm run build</pre></html>"""


class Client(StaticFiles):
    """Files of the editor under /; a path without suffix that is no file leads to the page."""

    def __init__(self, folder: Path) -> None:
        super().__init__(directory=folder, check_dir=False)
        self._index = folder / "index.html"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse WebSockets of unknown addresses."""
        if scope["type"] == "websocket":
            await WebSocketClose(1008, "there is no such session")(scope, receive, send)
        else:
            await super().__call__(scope, receive, send)

    async def check_config(self) -> None:
        """Accept a missing folder: the page explains it."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file, or the page."""
        if path == "api" or path.startswith("api/"):
            raise HTTPException(404, "there is no such call; see /api/openapi.json")
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(405, "only GET is allowed here", {"Allow": "GET, HEAD"})
        if not self._index.is_file():
            return HTMLResponse(NOT_BUILT, status_code=503, headers={"Cache-Control": "no-store"})
        try:
            if "\0" in path:
                raise HTTPException(404)
            response = await super().get_response("index.html" if path == "." else path, scope)
        except HTTPException as error:
            if error.status_code != 404 or PurePosixPath(path).suffix:
                raise
            return _redirect_to_page(scope)
        is_asset = path.startswith("assets/") and response.status_code in (200, 304)
        response.headers["Cache-Control"] = FOR_EVER if is_asset else "no-cache"
        return response


def _redirect_to_page(scope: Scope) -> Response:
    """Redirect to the page, which finds its files beside itself; relative: a proxy may have removed a prefix."""
    query = scope["query_string"].decode("latin-1")
    page = "../" * (scope["path"].count("/") - 1) or "./"
    return RedirectResponse(f"{page}?{query}" if query else page)
