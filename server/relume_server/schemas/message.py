"""Base class of all session messages."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Pointer = Annotated[str, Field(min_length=1, max_length=512, pattern=r"^/")]
Name = Annotated[str, Field(min_length=1, max_length=256)]
Revision = Annotated[int, Field(ge=0, le=2**53)]
RoleName = Literal["view", "edit", "admin"]


class Message(BaseModel):
    """Base of all messages: immutable, without undeclared fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PatchOperation(Message):
    """One operation of a JSON Patch (RFC 6902) on the look."""

    op: Literal["replace", "add", "remove", "test"]
    path: Annotated[str, Field(max_length=512)]
    value: Any = None
