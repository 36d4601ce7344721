"""What a look names of an OpenColorIO config."""

from __future__ import annotations

from dataclasses import dataclass

MAX_NAME = 256


@dataclass(frozen=True)
class OcioView:
    """A view of a display of the server's OpenColorIO config, in the place of a tone map."""

    display: str
    view: str
