"""Bodies of light mixes."""

from __future__ import annotations

from typing import Any

from relume_server.schemas.base import Body


class MixRequest(Body):
    """A look, which may be partial, and a light mix for it."""

    look: dict[str, Any]
    mix: dict[str, Any]


class MixedLookBody(Body):
    """The complete look with the light mix, and a sentence for each thing that it does not have."""

    look: dict[str, Any]
    warnings: list[str]
