"""IES files in memory."""

from __future__ import annotations

from typing import NamedTuple


class IesFile(NamedTuple):
    """An IES file that a scene's lights use. name: shown to users."""

    name: str
    data: bytes
