"""Encodings of text files."""

from __future__ import annotations

import codecs

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def to_utf8(data: bytes) -> bytes:
    """Convert text in UTF-16, as Windows programs write it, to UTF-8 without a byte order mark; other data stay."""
    if not data.startswith(_UTF_16):
        return data
    try:
        return data.decode("utf-16").encode("utf-8")
    except UnicodeError:  # binary data that begin like it
        return data
