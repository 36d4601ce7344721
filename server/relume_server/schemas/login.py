"""Bodies of the calls about who calls, and what was changed."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.base import Body

AnyRoleName = Literal["anyone", "view", "edit", "admin"]


class LoginRequest(Body):
    """The token that somebody was given."""

    token: Annotated[str, Field(min_length=1, max_length=200)]


class MeBody(Body):
    """Who calls. `login`: whether people log in here; `auth_method`: how this one is known (`open`: nobody is asked).
    `allow_viewer_comments`: whether those who only look may write comments."""

    login: bool
    name: str
    role: AnyRoleName
    auth_method: Literal["open", "nobody", "token", "proxy"]
    allow_viewer_comments: bool


class AuditEntry(Body):
    """A change that somebody made; `at` in ISO 8601, `who` a name, or an address where nobody logs in."""

    number: int
    at: str
    who: str
    role: AnyRoleName
    address: str
    what: str
    object: str
    status: int
    request: str
