"""`Idempotency-Key`: a call that makes something makes it once, however often a client that has lost the answer asks.

Middleware behind the gate, which knows who calls; the answers lie in the database, so that any server gives them. A
form's bytes are compared without the boundary between its parts, which clients choose anew each time.
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
    """The middleware.

    Args:
        store: asked for with each request, because it is opened after the app is made.
    """

    def __init__(self, app: ASGIApp, *, store: Callable[[], IdempotencyStore]) -> None:
        self._app, self._store = app, store

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on, or answer as before."""
        key = Headers(scope=scope).get(HEADER) if scope["type"] == "http" else None
        if key is None or scope["method"] != "POST" or not is_change("POST", scope["path"]):
            await self._app(scope, receive, send)
        elif _FORM.fullmatch(key) is None:
            error = ParameterError(HEADER, key, "1 to 200 printable ASCII characters without blanks")
            await problem_response(make_problem(error))(scope, receive, send)
        else:
            call = _Call(self._store(), scope, key, receive, send)
            await call.run(self._app)


class _Call:
    """One call that has a key, from its first byte to its answer."""

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
        """Do it, or answer as before."""
        try:
            if not self._is_form:  # small, and routes that take none would not ask for it
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
        """The body on its way to the app, which gets the end of it only where the call is to be done."""
        if self._early:
            return self._early.pop(0)
        message = await self._receive()
        if message["type"] == "http.request":
            self._digest.add(message.get("body", b""))
            if not message.get("more_body", False) and not self._has_claim:
                await self._claim_key()
        return message

    async def _claim_key(self) -> None:
        """Take the key. Raises _OverError where the call is answered already: as before, or by a refusal."""
        try:
            before = await run_sync(self._store.claim, *self._client_and_key, self._digest.hex())
        except DATABASE_ERRORS as error:
            if not is_unavailable(error):
                log.error("a key cannot be claimed (%s)", describe_error(error))
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
            error: Exception = KeyReusedError(f"this {HEADER} was used for another call; give each call its own")
        elif before.answer is None:
            error = InProgressError(f"a call with this {HEADER} is not answered yet; ask again in a while")
        else:
            return _replay_answer(before.answer)
        return problem_response(make_problem(error), make_problem_headers(error))

    async def _send_and_store(self, message: Message) -> None:
        """The answer on its way to the client, which gets the end of it when it is kept."""
        if self._is_answered:  # the app says that it could not read the body
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
        except DATABASE_ERRORS as error:  # it was made all the same
            log.error("the answer to a call with a key could not be kept (%s)", describe_error(error))


def _replay_answer(answer: Answer) -> Response:
    """What was answered before; where that was too large to be kept, the way to what was made."""
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
    """SHA-256 of bytes that come in parts, without what stands between the parts of a form."""

    def __init__(self, boundary: bytes) -> None:
        self._hash, self._boundary, self._tail = hashlib.sha256(), boundary, b""

    def add(self, data: bytes) -> None:
        """The next bytes."""
        if not self._boundary:
            self._hash.update(data)
            return
        *pieces, remainder = (self._tail + data).split(self._boundary)
        for piece in pieces:
            self._hash.update(piece + b"\0")
        num_pending = len(self._boundary) - 1  # a boundary may go on in the next part
        self._tail = remainder[len(remainder) - num_pending :] if len(remainder) > num_pending else remainder
        self._hash.update(remainder[: len(remainder) - len(self._tail)])

    def hex(self) -> str:
        """Of all so far."""
        whole = self._hash.copy()
        whole.update(self._tail)
        return whole.hexdigest()
