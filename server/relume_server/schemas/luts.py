"""Body of display LUTs."""

from __future__ import annotations

from relume_server.schemas.base import Body


class LutBody(Body):
    """A LUT of display values for looks, as their `display.lut`.

    `size`: nodes per channel of its table. `warnings`: changes made when its file was read.
    """

    id: str
    lut: str
    name: str
    created: str
    size: int
    warnings: list[str]
