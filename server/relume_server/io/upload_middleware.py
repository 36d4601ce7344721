"""Uploads: space is reserved before the body is read, and uploads per user are limited.

Pure ASGI, behind authentication, which identifies the caller: FastAPI reads the whole body before it calls a route.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated

from anyio import CancelScope
from anyio.to_thread import run_sync
from fastapi import Depends, Request
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relume_server.auth.reservations import Reservation
from relume_server.auth.roles import KEY
from relume_server.auth.services import AuthServices
from relume_server.errors import NearlyFullError, make_problem, problem_response
from relume_server.io.fair_slots import Slots
from relume_server.request_limits import UPLOADS
from relume_worker.jobs.job import QuotaError

MEASURED = "/api/materials/measured"
UPLOADS_AT_ONCE, UPLOADS_EACH = 64, 8
STEP_BYTES = 16 << 20
"""Reserved at a time for a body without a Content-Length."""
_RESERVATION_KEY = "relume.reservation"
_Refusal = QuotaError | NearlyFullError


class UploadMiddleware:
    """Middleware for uploads.

    Args:
        app: application to protect. access: called for each upload, because it is opened after the app is created.
        max_per_user: concurrent uploads of one user; others wait. weights: weights of users in scheduling.
    """

    def __init__(
        self, app: ASGIApp, *, access: Callable[[], AuthServices], max_per_user: int, weights: Mapping[str, float]
    ) -> None:
        self._app, self._access = app, access
        self._slots = Slots(UPLOADS_AT_ONCE, max_per_user, weights)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request; for an upload with a reservation, which is released after the response."""
        if scope["type"] != "http" or scope["method"] != "POST" or scope["path"] not in (*UPLOADS, MEASURED):
            await self._app(scope, receive, send)
            return
        user = scope[KEY].name
        async with self._slots.acquire(user):
            reservation = scope[_RESERVATION_KEY] = Reservation(self._access().quotas, user)
            try:
                await _Upload(reservation, scope).forward(self._app, receive, send)
            finally:
                with CancelScope(shield=True):  # the client is gone
                    await run_sync(reservation.release)


class _Upload:
    """One upload while its body is received."""

    def __init__(self, reservation: Reservation, scope: Scope) -> None:
        self._reservation, self._scope = reservation, scope
        length = Headers(scope=scope).get("content-length", "")
        self._length = int(length) if length.isdecimal() else None
        self._num_bytes, self._is_started = 0, False
        self._refusal: _Refusal | None = None

    async def forward(self, app: ASGIApp, receive: Receive, send: Send) -> None:
        """Forward the upload, unless there is no space; an error on the way overrides the app's response."""

        async def counted() -> Message:
            message = await receive()
            self._num_bytes += len(message.get("body", b""))
            if self._num_bytes > self._reservation.bytes:
                await self._reserve(self._num_bytes + STEP_BYTES)
            return message

        async def unless_refused(message: Message) -> None:
            if self._refusal is None or self._is_started:
                self._is_started = True
                await send(message)

        try:
            await self._reserve(STEP_BYTES if self._length is None else self._length)
            await app(self._scope, counted, unless_refused)
        except (QuotaError, NearlyFullError):
            if self._refusal is None or self._is_started:
                raise
        if self._refusal is not None and not self._is_started:
            close = {"Connection": "close"}  # the rest of the body is not read
            await problem_response(make_problem(self._refusal), close)(self._scope, receive, send)

    async def _reserve(self, num_bytes: int) -> None:
        try:
            await run_sync(self._reservation.reserve, num_bytes)
        except (QuotaError, NearlyFullError) as error:
            self._refusal = error
            raise


def _get_reservation(request: Request) -> Reservation:
    reservation: Reservation = request.scope[_RESERVATION_KEY]
    return reservation


ReservationDep = Annotated[Reservation, Depends(_get_reservation)]
"""Reservation of an upload, for routes."""
