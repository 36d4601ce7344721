"""HTTP calls: addresses, token, repetition while the server is away, problems as exceptions."""

from __future__ import annotations

import asyncio
import os
import random
import re
import tempfile
import time
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import httpx

from relume_client.errors import (
    AccessError,
    ProblemError,
    RelumeClientError,
    ServerUnavailableError,
    ServerVersionError,
)

DEFAULT_URL = "http://127.0.0.1:8420"
PROBLEM = "application/problem+json"
_MAX_WAIT_S = 4.0
_ACCESS_STATUS = frozenset({401, 403})
_BUSY_STATUS = frozenset({429, 502, 503, 504})


def backoff_s(attempt: int) -> float:
    """Time before the next attempt: from a quarter second, doubled each time, with jitter."""
    return min(_MAX_WAIT_S, 0.25 * 2.0 ** min(attempt, 10)) * random.uniform(0.8, 1.2)


def normalize_url(url: str | None) -> str:
    """Address of a server without a slash at its end: given, or RELUME_URL, or the default of `relume serve`."""
    text = (url or os.environ.get("RELUME_URL") or DEFAULT_URL).strip().rstrip("/")
    text = text if "://" in text else f"http://{text}"
    parsed = httpx.URL(text)
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise ValueError(f"{url!r} is not the address of a server, such as {DEFAULT_URL}")
    return text


def rejection(response: httpx.Response) -> RelumeClientError:
    """The exception for a response that is no success."""
    if response.headers.get("content-type", "").partition(";")[0] != PROBLEM:
        return ServerVersionError(
            f"{response.url} answered {response.status_code}: there is no relume server, or one of another version"
        )
    problem = response.json()
    kind = str(problem["type"]).rsplit(":", 1)[-1]
    error = AccessError if response.status_code in _ACCESS_STATUS else ProblemError
    return error(response.status_code, kind, problem["detail"], problem.get("errors", ()))


class Transport:
    """Calls of one server. Each is repeated while the server is away or busy; calls that create something have an
    idempotency key, so that a repetition has no further effect.

    Args:
        url: address of the server, with the path of a proxy if there is one.
        token: access token, if the server requires login.
        timeout: seconds that one call may take.
        retry_seconds: time for which a server that is away is tried again.
    """

    def __init__(self, url: str, token: str | None, *, timeout: float, retry_seconds: float) -> None:
        self.url, self.timeout, self.retry_seconds = url, timeout, retry_seconds
        self.headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._http = httpx.AsyncClient(
            base_url=url,
            headers=self.headers,
            follow_redirects=True,
            timeout=httpx.Timeout(timeout, connect=min(timeout, 10.0)),
        )

    async def close(self) -> None:
        """Close all connections."""
        await self._http.aclose()

    async def json(
        self,
        method: str,
        path: str,
        *,
        body: Mapping[str, Any] | None = None,
        data: Mapping[str, Any] | None = None,
        files: Sequence[tuple[str, Any]] | None = None,
    ) -> Any:
        """Call the server; returns the decoded response.

        Args:
            method: of HTTP. path: below the address of the server.
            body: JSON of the request. data, files: fields and files of a form.
        Raises:
            ProblemError, AccessError: the server rejected the call.
            ServerUnavailableError: it was away for longer than `retry_seconds`.
            ServerVersionError: the response is not one of relume.
            TimeoutError: the call took longer than `timeout`.
        """
        response = await self._call(method, path, json=body, data=data, files=files)
        try:
            return response.json() if response.content else None
        except ValueError:
            raise ServerVersionError(f"{response.url} did not answer with JSON: is it a relume server?") from None

    async def read(self, path: str) -> bytes:
        """Download a file into memory."""
        return (await self._call("GET", path)).content

    async def download(
        self,
        path: str,
        target: Path | None,
        folder: Path | None = None,
        *,
        body: Mapping[str, Any] | None = None,
    ) -> Path:
        """Download a file; an incomplete one never has the name of the target.

        Args:
            path: below the address of the server. target: file to write; None: the server's name in `folder`.
            body: JSON of a POST that returns the file; None for GET.
        Raises:
            ServerVersionError: the name is missing, or is a path.
        """
        response = await self._call("GET" if body is None else "POST", path, json=body)
        target = (folder or Path()) / file_name(response) if target is None else target
        target.parent.mkdir(parents=True, exist_ok=True)
        content = response.content
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False) as file:
            try:
                file.write(content)
                file.close()
                Path(file.name).replace(target)
            except BaseException:
                Path(file.name).unlink(missing_ok=True)
                raise
        return target

    async def _call(self, method: str, path: str, **content: Any) -> httpx.Response:
        headers = {"Idempotency-Key": uuid.uuid4().hex} if method == "POST" else {}
        start_s, attempt = time.monotonic(), 0
        while True:
            failure, wait_s = await self._attempt(method, path, headers=headers, **content), backoff_s(attempt)
            if isinstance(failure, httpx.Response):
                return failure
            error, retry_after_s, limit_s = failure
            wait_s = max(wait_s, retry_after_s)
            if time.monotonic() + wait_s - start_s > limit_s:
                raise error
            await asyncio.sleep(wait_s)
            attempt += 1

    async def _attempt(
        self, method: str, path: str, **content: Any
    ) -> httpx.Response | tuple[RelumeClientError, float, float]:
        """The response of a success; or the error of an attempt that may be repeated, the time until then, and for how
        long such errors may last.
        """
        try:
            response = await self._http.request(method, path, **content)
        except httpx.ReadTimeout:
            raise TimeoutError(f"{method} {path} took longer than {self.timeout:g} s") from None
        except httpx.TransportError as error:
            return self.unavailable(str(error) or type(error).__name__), 0.0, self.retry_seconds
        if response.is_success:
            return response
        refusal = rejection(response)
        if response.status_code in _BUSY_STATUS:
            sentence = str(refusal) if isinstance(refusal, ProblemError) else f"status {response.status_code}"
            retry_after = response.headers.get("retry-after", "")
            return self.unavailable(sentence), float(retry_after if retry_after.isdigit() else 0), self.retry_seconds
        if isinstance(refusal, ProblemError) and refusal.kind == "in-progress":
            return refusal, 0.0, self.timeout
        raise refusal

    def unavailable(self, reason: str) -> ServerUnavailableError:
        """The error of a server that does not answer."""
        return ServerUnavailableError(
            f"the server at {self.url} is not available ({reason}); start it or check the URL"
        )


def file_name(response: httpx.Response) -> str:
    """Name of a download, without folders. Raises ServerVersionError."""
    disposition = response.headers.get("content-disposition", "")
    plain, encoded = (
        re.search(pattern, disposition) for pattern in (r'filename="([^"]+)"', r"filename\*=utf-8''(\S+)")
    )
    name = unquote(encoded[1]) if encoded is not None else "" if plain is None else plain[1]
    if not name.isprintable() or name.startswith(".") or set("/\\:") & set(name) or not name:
        raise ServerVersionError(f"the server sent a file with the name {name[:80]!r}, which is none for a file here")
    return name
