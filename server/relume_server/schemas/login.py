"""Bodies of login, caller and audit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.base import Body

AnyRoleName = Literal["anyone", "view", "edit", "admin"]


class LoginRequest(Body):
    """An access token."""

    token: Annotated[str, Field(min_length=1, max_length=200)]


class MeBody(Body):
    """The caller. `login`: whether this server has a login; `auth_method`: how the caller was identified (`open`: no
    login). `allow_viewer_comments`: whether the role view may write comments.
    """

    login: bool
    name: str
    role: AnyRoleName
    auth_method: Literal["open", "nobody", "token", "proxy"]
    allow_viewer_comments: bool


class AuditEntry(Body):
    """A change; `at` in ISO 8601, `who` a name, or an address without login."""

    number: int
    at: str
    who: str
    role: AnyRoleName
    address: str
    what: str
    object: str
    status: int
    request: str
