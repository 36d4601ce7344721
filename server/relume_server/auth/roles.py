"""Roles and callers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated, Literal

from fastapi import Depends
from starlette.requests import HTTPConnection


class Role(IntEnum):
    """Role of a user; each includes those before it."""

    ANYONE = 0
    VIEW = 1
    EDIT = 2
    ADMIN = 3

    @property
    def label(self) -> str:
        """Name in settings, commands and messages."""
        return self.name.lower()


ROLES: dict[str, Role] = {"view": Role.VIEW, "edit": Role.EDIT, "admin": Role.ADMIN}


PROXY = "proxy:"


@dataclass(frozen=True)
class Caller:
    """The sender of a request.

    Attributes:
        name: name for quotas, scheduling and audit; empty without login. Names from proxies begin with `PROXY`, which
            no token's name does: a proxy's Ann is not the owner of Ann's token.
        role: role of the caller. address: address of the client.
        auth_method: no login required, not logged in, by token, or by proxy.
        token: id of the token. watches: joined by a view-only link.
    """

    name: str
    role: Role
    address: str
    auth_method: Literal["open", "nobody", "token", "proxy"]
    token: str | None = None
    watches: bool = False

    def watching(self) -> Caller:
        """This caller as view-only."""
        return replace(self, role=Role.VIEW, watches=True)

    @property
    def may_edit(self) -> bool:
        """True if the caller may change the look."""
        return self.role >= Role.EDIT

    @property
    def person(self) -> str:
        """Display name in rooms and comments; empty without login."""
        return self.name.removeprefix(PROXY) if self.auth_method == "proxy" else self.name

    @property
    def display_name(self) -> str:
        """Name in logs and audit."""
        return self.name or self.address


KEY = "relume.caller"
"""Key of the caller in the scope of a request."""


def get_caller(connection: HTTPConnection) -> Caller:
    """Return the caller, for routes."""
    caller: Caller = connection.scope[KEY]
    return caller


CallerDep = Annotated[Caller, Depends(get_caller)]
