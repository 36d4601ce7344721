"""What all messages of a live session have in common."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Pointer = Annotated[str, Field(min_length=1, max_length=512, pattern=r"^/")]
Name = Annotated[str, Field(min_length=1, max_length=256)]
Revision = Annotated[int, Field(ge=0, le=2**53)]
RoleName = Literal["view", "edit", "admin"]


class Message(BaseModel):
    """The base of all messages: immutable, nothing beyond what is declared."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PatchOperation(Message):
    """One operation of a JSON Patch (RFC 6902) on the look."""

    op: Literal["replace", "add", "remove", "test"]
    path: Annotated[str, Field(max_length=512)]
    value: Any = None
