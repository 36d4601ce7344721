"""PNG responses, and cache lifetimes."""

from __future__ import annotations

from fastapi import Response

A_DAY = {"Cache-Control": "private, max-age=86400"}
FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}


class PngResponse(Response):
    """PNG image; names its media type in the OpenAPI description."""

    media_type = "image/png"
