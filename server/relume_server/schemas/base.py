"""Base class of all REST bodies."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field

Id = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
MAX_NAME = 256
Name = Annotated[str, Field(min_length=1, max_length=MAX_NAME)]


class Body(BaseModel):
    """Base of all bodies."""

    model_config = ConfigDict(extra="forbid")

    @classmethod
    def from_object(cls, source: object, **more: Any) -> Self:
        """Build a body from the attributes of `source` with the same names, and `more`."""
        values = {name: getattr(source, name) for name in cls.model_fields if name not in more}
        return cls(**values, **more)
