"""Map exceptions to HTTP status, WebSocket close code and RFC 9457 problem, in one table."""

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
from relume_worker.jobs.job import BusyError, NotReadyError, QuotaError

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


class InUseError(RelumeError):
    """Another object uses the resource."""


class NearlyFullError(RelumeError):
    """The disk has less free space than the configured minimum."""


class TooLargeError(RelumeError):
    """The request is larger than the limit."""


class PreconditionFailedError(RelumeError):
    """The resource changed since the version in If-Match."""


class PreconditionRequiredError(RelumeError):
    """A change must name the version that it replaces."""


class ForbiddenOriginError(RelumeError):
    """The request comes from a page of another site."""


class RangeError(RelumeError):
    """No requested byte is in the file; `has` is the Content-Range header."""

    def __init__(self, has: str) -> None:
        super().__init__(
            f"the file has {has.rpartition('/')[2]} bytes, none in this range; request another one, or the whole file"
        )
        self.has = has


class LoginError(RelumeError):
    """The caller must log in."""


class ForbiddenError(RelumeError):
    """The caller's role does not allow the call."""


class DrainingError(RelumeError):
    """The server is stopping; another server, or this one after its restart, can take the request."""


class OtherServerError(RelumeError):
    """Another server has the room; a load balancer finds it by trying each server."""


class InProgressError(RelumeError):
    """An earlier call with the same idempotency key is not answered yet."""


class KeyReusedError(RelumeError):
    """The idempotency key was used for a different call."""


class UnsafeAccessError(RelumeError):
    """The settings would give access to more people than they suggest."""


class RateError(RelumeError):
    """The caller exceeds the rate limit; a call is accepted `wait_s` seconds from now."""

    def __init__(self, message: str, wait_s: float) -> None:
        super().__init__(message)
        self.wait_s = wait_s


@dataclass(frozen=True)
class ErrorMapping:
    """HTTP and WebSocket response to one kind of exception.

    Attributes:
        slug: last part of the problem's `type`.
        close_code: close code of a session that the exception ends.
    """

    status: int
    slug: str
    title: str
    close_code: int


# The first matching row is taken: subclasses come before their bases.
TABLE: Sequence[tuple[type[Exception], ErrorMapping]] = (
    (relume_errors.NotFoundError, ErrorMapping(404, "not-found", "Not found", CLOSE_NOT_FOUND)),
    (NotReadyError, ErrorMapping(409, "not-ready", "Not ready", CLOSE_NOT_READY)),
    (InProgressError, ErrorMapping(409, "in-progress", "In progress", CLOSE_POLICY)),
    (KeyReusedError, ErrorMapping(422, "key-reused", "Idempotency key reused", CLOSE_POLICY)),
    (InUseError, ErrorMapping(409, "in-use", "In use", CLOSE_NOT_READY)),
    (DrainingError, ErrorMapping(503, "draining", "Server is stopping", CLOSE_RESTART)),
    (OtherServerError, ErrorMapping(404, "other-server", "On another server", CLOSE_RESTART)),
    (BusyError, ErrorMapping(503, "busy", "Server is busy", CLOSE_BUSY)),
    (NearlyFullError, ErrorMapping(507, "disk", "Disk is nearly full", CLOSE_INTERNAL)),
    (TooLargeError, ErrorMapping(413, "too-large", "Too large", CLOSE_TOO_BIG)),
    (PreconditionFailedError, ErrorMapping(412, "changed", "Changed since", CLOSE_POLICY)),
    (PreconditionRequiredError, ErrorMapping(428, "precondition-required", "Precondition required", CLOSE_POLICY)),
    (ForbiddenOriginError, ErrorMapping(403, "forbidden-origin", "Origin not allowed", CLOSE_POLICY)),
    (LoginError, ErrorMapping(401, "login", "Login required", CLOSE_LOGIN)),
    (ForbiddenError, ErrorMapping(403, "forbidden", "Forbidden", CLOSE_FORBIDDEN)),
    (RangeError, ErrorMapping(416, "range", "Range not satisfiable", CLOSE_POLICY)),
    (QuotaError, ErrorMapping(429, "quota", "Quota exceeded", CLOSE_BUSY)),
    (RateError, ErrorMapping(429, "rate", "Too many requests", CLOSE_BUSY)),
    (relume_errors.SceneError, ErrorMapping(422, "scene", "Scene cannot be used", CLOSE_INTERNAL)),
    (relume_errors.MaterialError, ErrorMapping(422, "material", "Measured material cannot be used", CLOSE_INTERNAL)),
    (relume_errors.ParameterError, ErrorMapping(422, "parameter", "Value not allowed", CLOSE_POLICY)),
    (relume_errors.ShapeMismatchError, ErrorMapping(422, "shape", "Array shapes do not match", CLOSE_POLICY)),
    (relume_errors.MemoryBudgetError, ErrorMapping(422, "memory-budget", "Not enough memory", CLOSE_INTERNAL)),
    (relume_errors.DiskBudgetError, ErrorMapping(507, "disk", "Not enough disk space", CLOSE_INTERNAL)),
    (relume_errors.PlanError, ErrorMapping(422, "plan", "Cannot be planned", CLOSE_INTERNAL)),
    (relume_errors.StoreNotFoundError, ErrorMapping(404, "store-not-found", "No such bake store", CLOSE_NOT_FOUND)),
    (relume_errors.StoreError, ErrorMapping(409, "store", "Bake store cannot be used", CLOSE_DAMAGED)),
    (relume_errors.EditNotSupportedError, ErrorMapping(409, "edit-not-supported", "Edit not supported", CLOSE_POLICY)),
    (relume_errors.ResultUnavailableError, ErrorMapping(409, "generation-failed", "Generation failed", CLOSE_INTERNAL)),
    (relume_errors.EditError, ErrorMapping(422, "edit", "Edit cannot be applied", CLOSE_POLICY)),
    (relume_errors.ProtocolError, ErrorMapping(400, "protocol", "Protocol error", CLOSE_PROTOCOL)),
    (relume_errors.CancelledError, ErrorMapping(409, "canceled", "Canceled", CLOSE_GOING_AWAY)),
    (relume_errors.DiskFullError, ErrorMapping(507, "disk", "Disk is full", CLOSE_INTERNAL)),
    (relume_errors.StorageError, ErrorMapping(503, "storage", "Object storage cannot be used", CLOSE_BUSY)),
    (relume_errors.DatabaseDamagedError, ErrorMapping(503, "database", "Database damaged", CLOSE_BUSY)),
    (RelumeError, ErrorMapping(500, "failure", "Failure", CLOSE_INTERNAL)),
    (OperationalError, ErrorMapping(503, "database", "Database not reachable", CLOSE_BUSY)),
    (PoolTimeoutError, ErrorMapping(503, "database", "Database too slow", CLOSE_BUSY)),
    (OSError, ErrorMapping(507, "disk", "Disk cannot be read or written", CLOSE_INTERNAL)),
)
NOT_LOGGED = (BusyError, DrainingError, NearlyFullError)
"""No faults: a log line marks the start of such a period, and metrics count the refusals."""
DEFECT = ErrorMapping(500, "defect", "Internal error", CLOSE_INTERNAL)


def find_mapping(error: Exception) -> ErrorMapping:
    """Return the table's row for an exception, `DEFECT` for an unexpected one."""
    return next((mapping for kind, mapping in TABLE if isinstance(error, kind)), DEFECT)


def find_close_code(error: Exception) -> int:
    """Return the WebSocket close code for an exception."""
    return error.close_code if isinstance(error, ProtocolError) else find_mapping(error).close_code


def make_problem(error: Exception) -> Problem:
    """Build the RFC 9457 body. Only relume's own messages reach the client, never a path or a traceback."""
    mapping = find_mapping(error)
    extra: dict[str, Any] = {}
    if isinstance(error, relume_errors.ParameterError):
        extra = {"parameter": error.name, "allowed": error.allowed}
        if _FIELD.fullmatch(error.name):
            extra["errors"] = [{"pointer": "/" + error.name.removeprefix("/"), "detail": str(error)}]
    if isinstance(error, RelumeError):
        detail = str(error)
    elif isinstance(error, OperationalError | PoolTimeoutError):
        detail = "try again later; if it persists, the server's log has the cause"
    elif isinstance(error, OSError) and is_disk_full(error):
        detail = "the disk is full; free some space, then try again"
    elif isinstance(error, OSError):
        detail = f"{error.strerror or 'the disk failed'}; free some space, or see the server's log"
    else:
        detail = "internal error; see the server's log, and report it"
    return Problem(
        type=f"urn:relume:problem:{mapping.slug}", title=mapping.title, status=mapping.status, detail=detail, **extra
    )


def make_problem_headers(error: Exception) -> dict[str, str]:
    """Return the HTTP headers that belong to the problem."""
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
    """Build the problem for an invalid request or message; arguments as for `list_field_errors`."""
    fields = list_field_errors(errors, document, is_message=is_message)
    more = f"; and {len(fields) - _MAX_LISTED_FIELDS} more" if len(fields) > _MAX_LISTED_FIELDS else ""
    detail = "; ".join(field["detail"] for field in fields[:_MAX_LISTED_FIELDS]) + more
    return Problem(
        type="urn:relume:problem:invalid-request",
        title="Invalid request",
        status=status,
        detail=detail,
        errors=fields,
    )


def http_problem(error: HTTPException, method: str, allowed_methods: Sequence[str]) -> Problem:
    """Build the problem for a request that the framework rejected: unknown address, wrong method, unreadable body.

    Args:
        error: error of the framework. method: method of the request. allowed_methods: allowed methods of the address.
    """
    status, detail = error.status_code, str(error.detail)
    if status == HTTPStatus.BAD_REQUEST:
        detail = f"the body cannot be read ({detail.rstrip('.')}); send the format of /api/openapi.json"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"{method} is not allowed here; use {' or '.join(allowed_methods) or 'another'}"
    slug = {400: "invalid-request", 405: "method"}.get(status, "not-found")
    title = HTTPStatus(status).phrase
    return Problem(type=f"urn:relume:problem:{slug}", title=title, status=status, detail=detail)


def problem_response(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    """Make the HTTP response of a problem; unpaired surrogates, which UTF-8 cannot encode, are escaped."""
    document = json.dumps(problem.model_dump(), ensure_ascii=False, separators=(",", ":"))
    return Response(document.encode(errors="backslashreplace"), problem.status, dict(headers or {}), MEDIA_TYPE)


def message_problem(error: ValidationError, text: str) -> Problem:
    """Build the problem for an invalid session message; `text` is the message."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        document = None
    return validation_problem(error.errors(include_url=False), document, 400, is_message=True)


OPENAPI_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
    for status, description in (("4XX", "Refused"), ("5XX", "Failed"))
}
"""The component is added by `relume_server.openapi`."""


def install(app: FastAPI, methods_at: Callable[[str], Sequence[str]]) -> None:
    """Turn every exception of the app into an `application/problem+json` response.

    Args:
        app: application to install the handlers in. methods_at: allowed methods of a path.
    """

    async def on_mapped_error(_: Request, error: Exception) -> Response:
        is_logged = is_unavailable(error) or isinstance(error, NOT_LOGGED)
        if find_mapping(error).status >= 500 and not is_logged:
            log.error("%s: %s", type(error).__name__, describe_error(error))
        return problem_response(make_problem(error), make_problem_headers(error))

    async def on_defect(_: Request, error: Exception) -> Response:
        return problem_response(make_problem(error))

    async def on_http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        methods = methods_at(request.url.path)
        allowed = ", ".join([*methods, "HEAD"] if "GET" in methods else methods)
        headers = {"Allow": allowed} if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED else error.headers
        return problem_response(http_problem(error, request.method, methods), headers)

    async def on_validation(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return problem_response(validation_problem(error.errors(), error.body))

    for kind in (RelumeError, OperationalError, PoolTimeoutError, OSError):
        app.add_exception_handler(kind, on_mapped_error)
    app.add_exception_handler(HTTPException, on_http)
    app.add_exception_handler(RequestValidationError, on_validation)
    app.add_exception_handler(Exception, on_defect)
