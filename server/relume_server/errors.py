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

from relume.core import errors as relume_errors
from relume.core.errors import ProtocolError, RelumeError, is_disk_full
from relume_server.schemas.protocol import Problem
from relume_server.validation_errors import list_field_errors
from relume_worker.database.failures import describe_error, is_unavailable

log = logging.getLogger(__name__)
MEDIA_TYPE = "application/problem+json"
_MAX_LISTED_FIELDS = 3
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


class DrainingError(RelumeError):
    """The server is being stopped; another, or it itself in a while, serves what was asked."""


class OtherServerError(RelumeError):
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
class ErrorMapping:
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
TABLE: Sequence[tuple[type[Exception], ErrorMapping]] = (
    (relume_errors.NotFoundError, ErrorMapping(404, "not-found", "Not found", CLOSE_NOT_FOUND)),
    (NotReadyError, ErrorMapping(409, "not-ready", "Not ready", CLOSE_NOT_READY)),
    (InProgressError, ErrorMapping(409, "in-progress", "Not answered yet", CLOSE_POLICY)),
    (KeyReusedError, ErrorMapping(422, "key-reused", "Key of another call", CLOSE_POLICY)),
    (InUseError, ErrorMapping(409, "in-use", "In use", CLOSE_NOT_READY)),
    (DrainingError, ErrorMapping(503, "leaving", "Being stopped", CLOSE_RESTART)),
    (OtherServerError, ErrorMapping(404, "elsewhere", "On another server", CLOSE_RESTART)),
    (BusyError, ErrorMapping(503, "busy", "Too busy", CLOSE_BUSY)),
    (NearlyFullError, ErrorMapping(507, "disk", "Disk is nearly full", CLOSE_INTERNAL)),
    (TooLargeError, ErrorMapping(413, "too-large", "Too large", CLOSE_TOO_BIG)),
    (PreconditionFailedError, ErrorMapping(412, "changed", "Changed in the meantime", CLOSE_POLICY)),
    (PreconditionRequiredError, ErrorMapping(428, "precondition-required", "Precondition required", CLOSE_POLICY)),
    (ForbiddenOriginError, ErrorMapping(403, "forbidden-origin", "Origin not allowed", CLOSE_POLICY)),
    (LoginError, ErrorMapping(401, "login", "Log in first", CLOSE_LOGIN)),
    (ForbiddenError, ErrorMapping(403, "forbidden", "Not allowed to you", CLOSE_FORBIDDEN)),
    (RangeError, ErrorMapping(416, "range", "No such bytes", CLOSE_POLICY)),
    (QuotaError, ErrorMapping(429, "quota", "As much as one may have", CLOSE_BUSY)),
    (RateError, ErrorMapping(429, "rate", "Too many calls", CLOSE_BUSY)),
    (relume_errors.SceneError, ErrorMapping(422, "scene", "Scene cannot be used", CLOSE_INTERNAL)),
    (relume_errors.MaterialError, ErrorMapping(422, "material", "Measured material cannot be used", CLOSE_INTERNAL)),
    (relume_errors.ParameterError, ErrorMapping(422, "parameter", "Value not allowed", CLOSE_POLICY)),
    (relume_errors.ShapeMismatchError, ErrorMapping(422, "shape", "Shapes do not fit", CLOSE_POLICY)),
    (relume_errors.MemoryBudgetError, ErrorMapping(422, "memory-budget", "Needs too much memory", CLOSE_INTERNAL)),
    (relume_errors.DiskBudgetError, ErrorMapping(507, "disk", "Disk is too full", CLOSE_INTERNAL)),
    (relume_errors.PlanError, ErrorMapping(422, "plan", "Cannot be planned", CLOSE_INTERNAL)),
    (relume_errors.StoreNotFoundError, ErrorMapping(404, "store-not-found", "No such bake store", CLOSE_NOT_FOUND)),
    (relume_errors.StoreError, ErrorMapping(409, "store", "Bake store cannot be used", CLOSE_DAMAGED)),
    (relume_errors.EditNotSupportedError, ErrorMapping(409, "edit-not-supported", "Edit not supported", CLOSE_POLICY)),
    (relume_errors.ResultUnavailableError, ErrorMapping(409, "not-made", "Cannot be made", CLOSE_INTERNAL)),
    (relume_errors.EditError, ErrorMapping(422, "edit", "Edit cannot be applied", CLOSE_POLICY)),
    (relume_errors.ProtocolError, ErrorMapping(400, "protocol", "Protocol broken", CLOSE_PROTOCOL)),
    (relume_errors.CancelledError, ErrorMapping(409, "cancelled", "Cancelled", CLOSE_GOING_AWAY)),
    (relume_errors.DiskFullError, ErrorMapping(507, "disk", "Disk is full", CLOSE_INTERNAL)),
    (relume_errors.StorageError, ErrorMapping(503, "storage", "Object storage cannot be used", CLOSE_BUSY)),
    (relume_errors.DatabaseDamagedError, ErrorMapping(503, "database", "Database damaged", CLOSE_BUSY)),
    (RelumeError, ErrorMapping(500, "failure", "Failure", CLOSE_INTERNAL)),
    (OperationalError, ErrorMapping(503, "database", "Database not reachable", CLOSE_BUSY)),
    (PoolTimeoutError, ErrorMapping(503, "database", "Database too slow", CLOSE_BUSY)),
    (OSError, ErrorMapping(507, "disk", "Disk cannot be read or written", CLOSE_INTERNAL)),
)
NOT_LOGGED = (BusyError, DrainingError, NearlyFullError)
"""No faults: the log says once when they begin, or metrics how much there is, however often somebody asks meanwhile."""
DEFECT = ErrorMapping(500, "defect", "Defect in the server", CLOSE_INTERNAL)


def find_mapping(error: Exception) -> ErrorMapping:
    """The table's row for an exception; `DEFECT` for what nobody foresaw."""
    return next((mapping for kind, mapping in TABLE if isinstance(error, kind)), DEFECT)


def find_close_code(error: Exception) -> int:
    """The WebSocket close code with which a session ends."""
    return error.close_code if isinstance(error, ProtocolError) else find_mapping(error).close_code


def make_problem(error: Exception) -> Problem:
    """The RFC 9457 body; only messages that relume wrote itself reach the client, never a path or a trace."""
    mapping = find_mapping(error)
    extra: dict[str, Any] = {}
    if isinstance(error, relume_errors.ParameterError):
        extra = {"parameter": error.name, "allowed": error.allowed}
        if _FIELD.fullmatch(error.name):
            extra["errors"] = [{"pointer": "/" + error.name.removeprefix("/"), "detail": str(error)}]
    if isinstance(error, RelumeError):
        detail = str(error)
    elif isinstance(error, OperationalError | PoolTimeoutError):
        detail = "try again in a while; if it stays so, the server's log says why"
    elif isinstance(error, OSError) and is_disk_full(error):
        detail = "the disk is full; free some space, then try again"
    elif isinstance(error, OSError):
        detail = f"{error.strerror or 'the disk failed'}; free some space or look into the server's log"
    else:
        detail = "look into the server's log and report it"
    return Problem(
        type=f"urn:relume:problem:{mapping.slug}", title=mapping.title, status=mapping.status, detail=detail, **extra
    )


def make_problem_headers(error: Exception) -> dict[str, str]:
    """What HTTP wants said beside the body."""
    if isinstance(error, LoginError):
        return {"WWW-Authenticate": "Bearer"}
    if isinstance(error, InProgressError):
        return {"Retry-After": "1"}
    if isinstance(error, RangeError):
        return {"Content-Range": error.has}
    return {"Retry-After": str(math.ceil(error.wait_s))} if isinstance(error, RateError) else {}


def validation_problem(
    errors: Sequence[Any], document: object = None, status: int = 422, *, is_message: bool = False
) -> Problem:
    """The body for a request or message that does not have the declared form; arguments as of `list_field_errors`."""
    fields = list_field_errors(errors, document, is_message=is_message)
    more = f"; and {len(fields) - _MAX_LISTED_FIELDS} more" if len(fields) > _MAX_LISTED_FIELDS else ""
    detail = "; ".join(field["detail"] for field in fields[:_MAX_LISTED_FIELDS]) + more
    return Problem(
        type="urn:relume:problem:form", title="Not of the declared form", status=status, detail=detail, errors=fields
    )


def http_problem(error: HTTPException, method: str, allowed_methods: Sequence[str]) -> Problem:
    """The body for what the framework refuses before a route has it: no such call, or a body that is none.

    Args:
        method: of the call. allowed_methods: methods that its address takes.
    """
    status, detail = error.status_code, str(error.detail)
    if status == HTTPStatus.BAD_REQUEST:
        detail = f"the body cannot be read ({detail.rstrip('.')}); send what /api/openapi.json describes"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"{method} is not taken at this address; use {' or '.join(allowed_methods) or 'another'}"
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
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = None
    return validation_problem(error.errors(include_url=False), document, 400, is_message=True)


OPENAPI_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": said, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, said in (("4XX", "Refused"), ("5XX", "Failed"))
}
"""`relume_server.openapi` adds the component."""


def install(app: FastAPI, methods_at: Callable[[str], Sequence[str]]) -> None:
    """Make every failure of the app an `application/problem+json` response.

    Args:
        methods_at: what a path takes.
    """

    async def on_mapped_error(_: Request, error: Exception) -> Response:
        is_said = is_unavailable(error) or isinstance(error, NOT_LOGGED)
        if find_mapping(error).status >= 500 and not is_said:
            log.error("%s: %s", type(error).__name__, describe_error(error))
        return problem_response(make_problem(error), make_problem_headers(error))

    async def on_defect(_: Request, error: Exception) -> Response:
        return problem_response(make_problem(error))

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
        app.add_exception_handler(kind, on_mapped_error)
    app.add_exception_handler(HTTPException, on_http)
    app.add_exception_handler(RequestValidationError, on_validation)
    app.add_exception_handler(Exception, on_defect)
