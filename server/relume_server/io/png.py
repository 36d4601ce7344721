"""PNG answers, and how long a browser may keep them."""

from __future__ import annotations

from fastapi import Response

A_DAY = {"Cache-Control": "private, max-age=86400"}
FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}


class PngResponse(Response):
    """An image; names its media type in the API's description."""

    media_type = "image/png"
