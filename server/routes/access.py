"""/api/me, /api/login, /api/logout: who calls. /api/audit: what was changed, for admins."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from server.access.audit import MAX_LISTED, Change
from server.access.identity import COOKIE, OPENS_NOTHING
from server.access.roles import Caller, Who
from server.errors import LoginError
from server.services import Shared
from server.wire.access import AuditEntry, LoginRequest, MeBody
from server.wire.bodies import moment

router = APIRouter(prefix="/api", tags=["access"])

COOKIE_SECONDS = 30 * 86_400


@router.get("/me", name="get_me")
async def me(caller: Who, services: Shared, response: Response) -> MeBody:
    """Who calls, and what they may do."""
    response.headers["Cache-Control"] = "no-store"
    settings, role = services.settings, caller.role.word
    return MeBody(
        login=settings.login, name=caller.person, role=role, by=caller.by, viewers_comment=settings.viewers_comment
    )


@router.post("/login", status_code=204)
async def login(sent: LoginRequest, request: Request, services: Shared, caller: Who) -> Response:
    """Keep a token in a cookie that no script of a page can read, and no other site can send."""
    access = services.access
    found = await access.identity.by_token(sent.token, caller.address, access.tokens)
    await access.note(_line(found or caller, 401 if found is None else 204))
    if found is None:
        raise LoginError(OPENS_NOTHING)
    response = Response(status_code=204)
    secure = services.settings.https_only or access.identity.is_secure(request.scope)
    response.set_cookie(
        COOKIE, sent.token, max_age=COOKIE_SECONDS, path="/", secure=secure, httponly=True, samesite="strict"
    )
    return response


def _line(caller: Caller, status: int) -> Change:
    return Change.by(caller, "POST /api/login", "", status)


@router.post("/logout", status_code=204)
async def logout() -> Response:
    """Forget the cookie; the token stays what it is."""
    response = Response(status_code=204)
    response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
    return response


@router.get("/audit")
def list_audit(
    services: Shared,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Annotated[int | None, Query(ge=1, le=2**53)] = None,
    who: Annotated[str | None, Query(max_length=80)] = None,
) -> list[AuditEntry]:
    """Changes, newest first; older ones by the `number` of the last as `before`."""
    return [
        AuditEntry(**{**vars(entry), "at": moment(entry.at)})
        for entry in services.access.audit.list(limit, before, who)
    ]
