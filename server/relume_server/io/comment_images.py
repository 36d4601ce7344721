"""Snapshots of comments: decoded, scaled down, and encoded again."""

from __future__ import annotations

import base64
import binascii
import io
import warnings

from PIL import Image

from relume.core.errors import Description, ParameterError

MAX_SIDE = 1024
STORED_SIDE = 320
_FORMATS = ("PNG", "JPEG", "WEBP")


def small_picture(text: str) -> bytes:
    """Convert an image to a stored snapshot: WebP, at most `STORED_SIDE` pixels a side.

    Args:
        text: PNG, JPEG or WebP in Base64, or as the data URL of a canvas.
    Raises:
        ParameterError: it is not such an image, or larger than `MAX_SIDE`.
    """
    try:
        data = base64.b64decode(text.partition("base64,")[2] or text, validate=True)
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                if max(image.size) > MAX_SIDE:  # read from the header, before decoding
                    raise ParameterError("picture", list(image.size), f"at most {MAX_SIDE} pixels a side")
                small = image.convert("RGB")
    except (binascii.Error, OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError("picture", Description("not a readable image"), "a PNG, JPEG or WebP in Base64") from None
    small.thumbnail((STORED_SIDE, STORED_SIDE))
    written = io.BytesIO()
    small.save(written, "WEBP", quality=82)
    return written.getvalue()
