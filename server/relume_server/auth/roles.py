"""Roles, and whoever calls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated, Literal

from fastapi import Depends
from starlette.requests import HTTPConnection


class Role(IntEnum):
    """What somebody may do; who has one may do all that those below it may."""

    ANYONE = 0
    VIEW = 1
    EDIT = 2
    ADMIN = 3

    @property
    def label(self) -> str:
        """As settings, commands and messages write it."""
        return self.name.lower()


ROLES: dict[str, Role] = {"view": Role.VIEW, "edit": Role.EDIT, "admin": Role.ADMIN}


PROXY = "proxy:"


@dataclass(frozen=True)
class Caller:
    """Whoever sent a request.

    Attributes:
        name: by which quotas, turns and the audit know them; empty where nobody logs in. Names that proxies say begin
            with `PROXY`, which no token's name does: whom a proxy calls Ann is not who has Ann's token.
        role: what they may do. address: where the request came from.
        auth_method: how they are known: no login is asked for, they have not logged in, a token, a proxy.
        token: id of the token. watches: they have come by a link that lets nobody edit.
    """

    name: str
    role: Role
    address: str
    auth_method: Literal["open", "nobody", "token", "proxy"]
    token: str | None = None
    watches: bool = False

    def watching(self) -> Caller:
        """The same, who only looks."""
        return replace(self, role=Role.VIEW, watches=True)

    @property
    def may_edit(self) -> bool:
        """Whether they may change what others see."""
        return self.role >= Role.EDIT

    @property
    def person(self) -> str:
        """As other people read it in a room and beside a comment; empty where nobody logs in."""
        return self.name.removeprefix(PROXY) if self.auth_method == "proxy" else self.name

    @property
    def display_name(self) -> str:
        """As logs and the audit call them."""
        return self.name or self.address


KEY = "relume.caller"
"""Under which the gate leaves the caller in the scope of a request."""


def get_caller(connection: HTTPConnection) -> Caller:
    """Who calls, for routes."""
    caller: Caller = connection.scope[KEY]
    return caller


CallerDep = Annotated[Caller, Depends(get_caller)]
