"""/api/me, /api/login, /api/logout: the caller. /api/audit: changes, for admins."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from relume_server.auth.audit import MAX_LISTED, Change
from relume_server.auth.identity import COOKIE, OPENS_NOTHING
from relume_server.auth.roles import Caller, CallerDep
from relume_server.errors import LoginError
from relume_server.schemas.bodies import format_timestamp
from relume_server.schemas.login import AuditEntry, LoginRequest, MeBody
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api", tags=["access"])

COOKIE_SECONDS = 30 * 86_400


@router.get("/me", name="get_me")
async def me(caller: CallerDep, services: ServicesDep, response: Response) -> MeBody:
    """The caller, with name and role."""
    response.headers["Cache-Control"] = "no-store"
    settings, role = services.settings, caller.role.label
    return MeBody(
        login=settings.login,
        name=caller.person,
        role=role,
        auth_method=caller.auth_method,
        allow_viewer_comments=settings.allow_viewer_comments,
    )


@router.post("/login", status_code=204)
async def login(credentials: LoginRequest, request: Request, services: ServicesDep, caller: CallerDep) -> Response:
    """Store a token in a cookie that no script can read, and no other site can send."""
    access = services.access
    token_caller = await access.identity.by_token(credentials.token, caller.address, access.tokens)
    await access.record(_line(token_caller or caller, 401 if token_caller is None else 204))
    if token_caller is None:
        raise LoginError(OPENS_NOTHING)
    response = Response(status_code=204)
    secure = services.settings.https_only or access.identity.is_secure(request.scope)
    response.set_cookie(
        COOKIE,
        credentials.token,
        max_age=COOKIE_SECONDS,
        path=_cookie_path(request),
        secure=secure,
        httponly=True,
        samesite="strict",
    )
    return response


def _cookie_path(request: Request) -> str:
    """Path prefix of the server, so that other servers of this host have cookies of their own."""
    return request.scope["root_path"] or "/"


def _line(caller: Caller, status: int) -> Change:
    return Change.by(caller, "POST /api/login", "", status)


@router.post("/logout", status_code=204)
async def logout(request: Request) -> Response:
    """Delete the cookie; the token stays valid."""
    response = Response(status_code=204)
    response.delete_cookie(COOKIE, path=_cookie_path(request), httponly=True, samesite="strict")
    return response


@router.get("/audit")
def list_audit(
    services: ServicesDep,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Annotated[int | None, Query(ge=1, le=2**53)] = None,
    who: Annotated[str | None, Query(max_length=80)] = None,
) -> list[AuditEntry]:
    """List changes, newest first; pass the `number` of the last one as `before` for older ones."""
    return [
        AuditEntry(**{**vars(entry), "at": format_timestamp(entry.at)})
        for entry in services.access.audit.list(limit, before, who)
    ]
