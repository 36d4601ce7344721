"""`Idempotency-Key`: a call that creates something runs once; retries get the same response.

A middleware behind authentication, so that it knows the caller. Responses are stored in the database, so that any
server can replay them. Form bodies are compared without the boundary between parts, which clients choose anew for each
request.
"""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable

from anyio.to_thread import run_sync
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume.core.errors import ParameterError
from relume_server.auth.roles import KEY as CALLER
from relume_server.auth.rules import is_change
from relume_server.errors import InProgressError, KeyReusedError, make_problem, make_problem_headers, problem_response
from relume_server.persistence.idempotency import Answer, EarlierCall, IdempotencyStore
from relume_worker.database.failures import DATABASE_ERRORS, describe_error, is_unavailable

log = logging.getLogger(__name__)
HEADER, REPLAYED = "Idempotency-Key", "Idempotency-Replayed"
_FORM = re.compile(r"[\x21-\x7e]{1,200}")
_BOUNDARY = re.compile(r'boundary="?([^";,]{1,200})', re.IGNORECASE)


class _OverError(Exception):
    """The call was answered without the app."""


class Idempotency:
    """Middleware for idempotency keys.

    Args:
        app: application to protect.
        store: called for each request, because the store is opened after the app is created.
    """

    def __init__(self, app: ASGIApp, *, store: Callable[[], IdempotencyStore]) -> None:
        self._app, self._store = app, store

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the call, or replay the stored response."""
        key = Headers(scope=scope).get(HEADER) if scope["type"] == "http" else None
        if key is None or scope["method"] != "POST" or not is_change("POST", scope["path"]):
            await self._app(scope, receive, send)
        elif _FORM.fullmatch(key) is None:
            error = ParameterError(HEADER, key, "1 to 200 printable ASCII characters without spaces")
            await problem_response(make_problem(error))(scope, receive, send)
        else:
            call = _Call(self._store(), scope, key, receive, send)
            await call.run(self._app)


class _Call:
    """One call with a key, from its first byte to its response."""

    def __init__(self, store: IdempotencyStore, scope: Scope, key: str, receive: Receive, send: Send) -> None:
        self._store, self._scope, self._receive, self._send = store, scope, receive, send
        self._client_and_key = scope[CALLER].name, key
        boundary = _BOUNDARY.search(Headers(scope=scope).get("content-type", ""))
        self._digest = _Digest(b"" if boundary is None else boundary[1].encode("latin-1"))
        self._digest.add(f"{scope['path']}?".encode() + scope["query_string"] + b"\n")
        self._is_form, self._early = boundary is not None, list[Message]()
        self._has_claim, self._is_answered = False, False
        self._status, self._headers, self._body = 0, Headers(), bytearray()

    async def run(self, app: ASGIApp) -> None:
        """Run the call, or replay the stored response."""
        try:
            if not self._is_form:  # small; routes without a body would not read it
                messages = [await self._receive_hashed()]
                while messages[-1].get("more_body", False):
                    messages.append(await self._receive_hashed())
                self._early = messages
            await app(self._scope, self._receive_hashed, self._send_and_store)
        except _OverError:
            return
        finally:
            if self._has_claim and self._status // 100 != 2:
                await run_sync(self._store.drop, *self._client_and_key)

    async def _receive_hashed(self) -> Message:
        """Pass the body to the app while hashing it; the app gets the last part only if the call is to run."""
        if self._early:
            return self._early.pop(0)
        message = await self._receive()
        if message["type"] == "http.request":
            self._digest.add(message.get("body", b""))
            if not message.get("more_body", False) and not self._has_claim:
                await self._claim_key()
        return message

    async def _claim_key(self) -> None:
        """Claim the key. Raises _OverError if the call is already answered: replayed, or rejected."""
        try:
            before = await run_sync(self._store.claim, *self._client_and_key, self._digest.hex())
        except DATABASE_ERRORS as error:
            if not is_unavailable(error):
                log.error("an idempotency key cannot be stored (%s)", describe_error(error))
            response = problem_response(make_problem(error))
        else:
            if before is None:
                self._has_claim = True
                return
            response = self._response(before)
        self._is_answered = True
        await response(self._scope, self._receive, self._send)
        raise _OverError

    def _response(self, before: EarlierCall) -> Response:
        if before.digest != self._digest.hex():
            error: Exception = KeyReusedError(f"this {HEADER} was used for another call; give each call its own key")
        elif before.answer is None:
            error = InProgressError(f"a call with this {HEADER} is not answered yet; try again later")
        else:
            return _replay_answer(before.answer)
        return problem_response(make_problem(error), make_problem_headers(error))

    async def _send_and_store(self, message: Message) -> None:
        """Pass the response to the client; the last part waits until the response is stored."""
        if self._is_answered:  # the app reports an unreadable body
            return
        if message["type"] == "http.response.start":
            self._status, self._headers = message["status"], Headers(raw=message["headers"])
        else:
            self._body += message.get("body", b"")
            if not message.get("more_body", False) and self._has_claim and self._status // 100 == 2:
                headers = self._headers
                answer = Answer(self._status, headers.get("location"), headers.get("content-type"), bytes(self._body))
                await self._store_answer(answer)
        await self._send(message)

    async def _store_answer(self, answer: Answer) -> None:
        try:
            await run_sync(self._store.end, *self._client_and_key, answer)
        except DATABASE_ERRORS as error:  # the call has taken effect anyway
            log.error("the response to a call with an idempotency key could not be stored (%s)", describe_error(error))


def _replay_answer(answer: Answer) -> Response:
    """Replay a stored response; if it was too large to store, redirect to the created resource."""
    has_body = answer.body is not None
    response = Response(answer.body or b"", answer.status if has_body or answer.location is None else 303)
    headers = MutableHeaders(raw=response.raw_headers)
    headers[REPLAYED] = "true"
    if answer.location is not None:
        headers["Location"] = answer.location
    if has_body and answer.media_type is not None:
        headers["Content-Type"] = answer.media_type
    return response


class _Digest:
    """SHA-256 of a streamed form body, without the boundaries between its parts."""

    def __init__(self, boundary: bytes) -> None:
        self._hash, self._boundary, self._tail = hashlib.sha256(), boundary, b""

    def add(self, data: bytes) -> None:
        """Add the next bytes."""
        if not self._boundary:
            self._hash.update(data)
            return
        *pieces, remainder = (self._tail + data).split(self._boundary)
        for piece in pieces:
            self._hash.update(piece + b"\0")
        num_pending = len(self._boundary) - 1  # a boundary may continue in the next part
        self._tail = remainder[len(remainder) - num_pending :] if len(remainder) > num_pending else remainder
        self._hash.update(remainder[: len(remainder) - len(self._tail)])

    def hex(self) -> str:
        """Digest of all bytes so far."""
        whole = self._hash.copy()
        whole.update(self._tail)
        return whole.hexdigest()
