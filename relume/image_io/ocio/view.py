"""OpenColorIO names in a look."""

from __future__ import annotations

from dataclasses import dataclass

MAX_NAME = 256


@dataclass(frozen=True)
class OcioView:
    """A view of a display of the server's OpenColorIO config, instead of a tone map."""

    display: str
    view: str
