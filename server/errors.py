"""The one table from exceptions to HTTP status and WebSocket close code, and the RFC 9457 bodies made from it."""

from __future__ import annotations

import json
import logging
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from starlette.exceptions import HTTPException

from relume import errors as relume_errors
from relume.errors import ProtocolError, RelumeError, is_no_room
from server.form_errors import places_of
from server.wire.protocol import Problem
from worker.database.faults import database_away, is_away, told

log = logging.getLogger(__name__)
MEDIA_TYPE = "application/problem+json"
_MOST_SAID = 3
_FIELD = re.compile(r"/.*|[a-z_]+(/\w+)*")

CLOSE_NORMAL = 1000
CLOSE_GOING_AWAY = 1001
CLOSE_PROTOCOL = 1002
CLOSE_POLICY = 1008
CLOSE_TOO_BIG = 1009
CLOSE_INTERNAL = 1011
CLOSE_RESTART = 1012
CLOSE_BUSY = 1013
CLOSE_LOGIN = 4401
CLOSE_FORBIDDEN = 4403
CLOSE_NOT_FOUND = 4404
CLOSE_NO_ACKNOWLEDGEMENT = 4408
CLOSE_NOT_READY = 4409
CLOSE_DAMAGED = 4410


class NotReadyError(RelumeError):
    """It is here, but it is not in the state that the call needs."""


class InUseError(RelumeError):
    """Something else names it, and would be broken without it."""


class BusyError(RelumeError):
    """The server has all it can take; later it may have room."""


class NearlyFullError(RelumeError):
    """The disk has less room than the server is to leave."""


class TooLargeError(RelumeError):
    """More was sent than is taken."""


class PreconditionFailedError(RelumeError):
    """Somebody else changed it in the meantime."""


class PreconditionRequiredError(RelumeError):
    """A change must say which version it changes."""


class ForbiddenOriginError(RelumeError):
    """A page of another site called."""


class RangeError(RelumeError):
    """The file has nothing of the bytes that are asked for; `has` says how many there are, as HTTP does."""

    def __init__(self, has: str) -> None:
        super().__init__(f"the file has {has.rpartition('/')[2]} bytes, and none of those; ask for fewer, or for all")
        self.has = has


class LoginError(RelumeError):
    """Who calls has to say who they are."""


class ForbiddenError(RelumeError):
    """Who calls may not do that."""


class QuotaError(RelumeError):
    """Who calls has as much as one may."""


class LeavingError(RelumeError):
    """The server is being stopped; another, or it itself in a while, serves what was asked."""


class ElsewhereError(RelumeError):
    """Another server has the room; a balancer finds it by trying one after the other."""


class InProgressError(RelumeError):
    """The same call came before, and is not answered yet."""


class KeyReusedError(RelumeError):
    """Another call had the same key."""


class OpennessError(RelumeError):
    """A server would let in more people than its settings sound like."""


class RateError(RelumeError):
    """Who calls calls too often; `wait_s` from now there is room."""

    def __init__(self, message: str, wait_s: float) -> None:
        super().__init__(message)
        self.wait_s = wait_s


@dataclass(frozen=True)
class Row:
    """What a client is told about one kind of exception.

    Attributes:
        slug: last part of the problem's `type`.
        close_code: how a session ends that cannot go on because of it.
    """

    status: int
    slug: str
    title: str
    close_code: int


# The first row whose exception fits is taken: subclasses stand before their bases.
TABLE: Sequence[tuple[type[Exception], Row]] = (
    (relume_errors.NotFoundError, Row(404, "not-found", "Not found", CLOSE_NOT_FOUND)),
    (NotReadyError, Row(409, "not-ready", "Not ready", CLOSE_NOT_READY)),
    (InProgressError, Row(409, "in-progress", "Not answered yet", CLOSE_POLICY)),
    (KeyReusedError, Row(422, "key-reused", "Key of another call", CLOSE_POLICY)),
    (InUseError, Row(409, "in-use", "In use", CLOSE_NOT_READY)),
    (LeavingError, Row(503, "leaving", "Being stopped", CLOSE_RESTART)),
    (ElsewhereError, Row(404, "elsewhere", "On another server", CLOSE_RESTART)),
    (BusyError, Row(503, "busy", "Too busy", CLOSE_BUSY)),
    (NearlyFullError, Row(507, "disk", "Disk is nearly full", CLOSE_INTERNAL)),
    (TooLargeError, Row(413, "too-large", "Too large", CLOSE_TOO_BIG)),
    (PreconditionFailedError, Row(412, "changed", "Changed in the meantime", CLOSE_POLICY)),
    (PreconditionRequiredError, Row(428, "precondition-required", "Precondition required", CLOSE_POLICY)),
    (ForbiddenOriginError, Row(403, "forbidden-origin", "Origin not allowed", CLOSE_POLICY)),
    (LoginError, Row(401, "login", "Log in first", CLOSE_LOGIN)),
    (ForbiddenError, Row(403, "forbidden", "Not allowed to you", CLOSE_FORBIDDEN)),
    (RangeError, Row(416, "range", "No such bytes", CLOSE_POLICY)),
    (QuotaError, Row(429, "quota", "As much as one may have", CLOSE_BUSY)),
    (RateError, Row(429, "rate", "Too many calls", CLOSE_BUSY)),
    (relume_errors.SceneError, Row(422, "scene", "Scene cannot be used", CLOSE_INTERNAL)),
    (relume_errors.MaterialError, Row(422, "material", "Measured material cannot be used", CLOSE_INTERNAL)),
    (relume_errors.ParameterError, Row(422, "parameter", "Value not allowed", CLOSE_POLICY)),
    (relume_errors.ShapeMismatchError, Row(422, "shape", "Shapes do not fit", CLOSE_POLICY)),
    (relume_errors.MemoryBudgetError, Row(422, "memory-budget", "Needs too much memory", CLOSE_INTERNAL)),
    (relume_errors.DiskBudgetError, Row(507, "disk", "Disk is too full", CLOSE_INTERNAL)),
    (relume_errors.PlanError, Row(422, "plan", "Cannot be planned", CLOSE_INTERNAL)),
    (relume_errors.StoreNotFoundError, Row(404, "store-not-found", "No such bake store", CLOSE_NOT_FOUND)),
    (relume_errors.StoreError, Row(409, "store", "Bake store cannot be used", CLOSE_DAMAGED)),
    (relume_errors.EditNotSupportedError, Row(409, "edit-not-supported", "Edit not supported", CLOSE_POLICY)),
    (relume_errors.NotMadeError, Row(409, "not-made", "Cannot be made", CLOSE_INTERNAL)),
    (relume_errors.EditError, Row(422, "edit", "Edit cannot be applied", CLOSE_POLICY)),
    (relume_errors.ProtocolError, Row(400, "protocol", "Protocol broken", CLOSE_PROTOCOL)),
    (relume_errors.CancelledError, Row(409, "cancelled", "Cancelled", CLOSE_GOING_AWAY)),
    (relume_errors.DiskFullError, Row(507, "disk", "Disk is full", CLOSE_INTERNAL)),
    (relume_errors.StorageError, Row(503, "storage", "Object storage cannot be used", CLOSE_BUSY)),
    (relume_errors.DatabaseDamagedError, Row(503, "database", "Database damaged", CLOSE_BUSY)),
    (RelumeError, Row(500, "failure", "Failure", CLOSE_INTERNAL)),
    (OperationalError, Row(503, "database", "Database not reachable", CLOSE_BUSY)),
    (PoolTimeoutError, Row(503, "database", "Database too slow", CLOSE_BUSY)),
    (OSError, Row(507, "disk", "Disk cannot be read or written", CLOSE_INTERNAL)),
)
SAID = (BusyError, LeavingError, NearlyFullError)
"""No faults: the log says once when they begin, or metrics how much there is, however often somebody asks meanwhile."""
DEFECT = Row(500, "defect", "Defect in the server", CLOSE_INTERNAL)


def row_of(error: Exception) -> Row:
    """The table's row for an exception; `DEFECT` for what nobody foresaw."""
    return next((row for kind, row in TABLE if isinstance(error, kind)), DEFECT)


def close_code_of(error: Exception) -> int:
    """The WebSocket close code with which a session ends."""
    return error.close_code if isinstance(error, ProtocolError) else row_of(error).close_code


def problem_of(error: Exception) -> Problem:
    """The RFC 9457 body; only messages that relume wrote itself reach the client, never a path or a trace."""
    row = row_of(error)
    extra: dict[str, Any] = {}
    if isinstance(error, relume_errors.ParameterError):
        extra = {"parameter": error.name, "allowed": error.allowed}
        if _FIELD.fullmatch(error.name):
            extra["errors"] = [{"pointer": "/" + error.name.removeprefix("/"), "detail": str(error)}]
    if isinstance(error, RelumeError):
        detail = str(error)
    elif isinstance(error, OperationalError | PoolTimeoutError):
        detail = "try again in a while; if it stays so, the server's log says why"
    elif isinstance(error, OSError) and is_no_room(error):
        detail = "the disk is full; free some space, then try again"
    elif isinstance(error, OSError):
        detail = f"{error.strerror or 'the disk failed'}; free some space or look into the server's log"
    else:
        detail = "look into the server's log and report it"
    return Problem(type=f"urn:relume:problem:{row.slug}", title=row.title, status=row.status, detail=detail, **extra)


def headers_of(error: Exception) -> dict[str, str]:
    """What HTTP wants said beside the body."""
    if isinstance(error, LoginError):
        return {"WWW-Authenticate": "Bearer"}
    if isinstance(error, InProgressError):
        return {"Retry-After": "1"}
    if isinstance(error, RangeError):
        return {"Content-Range": error.has}
    return {"Retry-After": str(math.ceil(error.wait_s))} if isinstance(error, RateError) else {}


def validation_problem(
    errors: Sequence[Any], sent: object = None, status: int = 422, *, is_message: bool = False
) -> Problem:
    """The body for a request or message that does not have the declared form; arguments as of `places_of`."""
    places = places_of(errors, sent, is_message=is_message)
    more = f"; and {len(places) - _MOST_SAID} more" if len(places) > _MOST_SAID else ""
    detail = "; ".join(place["detail"] for place in places[:_MOST_SAID]) + more
    return Problem(
        type="urn:relume:problem:form", title="Not of the declared form", status=status, detail=detail, errors=places
    )


def http_problem(error: HTTPException, method: str, able: Sequence[str]) -> Problem:
    """The body for what the framework refuses before a route has it: no such call, or a body that is none.

    Args:
        method: of the call. able: methods that its address takes.
    """
    status, detail = error.status_code, str(error.detail)
    if status == HTTPStatus.BAD_REQUEST:
        detail = f"the body cannot be read ({detail.rstrip('.')}); send what /api/openapi.json describes"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"{method} is not taken at this address; use {' or '.join(able) or 'another'}"
    slug = {400: "form", 405: "method"}.get(status, "not-found")
    title = HTTPStatus(status).phrase
    return Problem(type=f"urn:relume:problem:{slug}", title=title, status=status, detail=detail)


def problem_response(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    """A problem as an HTTP response; half a surrogate pair that it repeats is no UTF-8, and becomes its number."""
    document = json.dumps(problem.model_dump(), ensure_ascii=False, separators=(",", ":"))
    return Response(document.encode(errors="backslashreplace"), problem.status, dict(headers or {}), MEDIA_TYPE)


def message_problem(error: ValidationError, text: str) -> Problem:
    """The body for a session message that does not have the declared form. text: of the message."""
    try:
        sent = json.loads(text)
    except (ValueError, RecursionError):
        sent = None
    return validation_problem(error.errors(include_url=False), sent, 400, is_message=True)


OPENAPI_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": said, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, said in (("4XX", "Refused"), ("5XX", "Failed"))
}
"""`server.openapi` adds the component."""


def install(app: FastAPI, methods_at: Callable[[str], Sequence[str]]) -> None:
    """Make every failure of the app an `application/problem+json` response.

    Args:
        methods_at: what a path takes.
    """

    async def on_known(_: Request, error: Exception) -> Response:
        if is_away(error):
            database_away.meet(error)
        elif row_of(error).status >= 500 and not isinstance(error, SAID):
            log.error("%s: %s", type(error).__name__, told(error))
        return problem_response(problem_of(error), headers_of(error))

    async def on_defect(_: Request, error: Exception) -> Response:
        return problem_response(problem_of(error))

    async def on_http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        able = methods_at(request.url.path)
        allowed = ", ".join([*able, "HEAD"] if "GET" in able else able)
        headers = {"Allow": allowed} if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED else error.headers
        return problem_response(http_problem(error, request.method, able), headers)

    async def on_validation(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return problem_response(validation_problem(error.errors(), error.body))

    for kind in (RelumeError, OperationalError, PoolTimeoutError, OSError):
        app.add_exception_handler(kind, on_known)
    app.add_exception_handler(HTTPException, on_http)
    app.add_exception_handler(RequestValidationError, on_validation)
    app.add_exception_handler(Exception, on_defect)
