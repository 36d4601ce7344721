"""Downloaded files: whole or in parts, and under names that every system takes."""

from __future__ import annotations

import re

from fastapi.responses import FileResponse
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from server.errors import RangeError

_LONGEST = 120
_RANGES = re.compile(
    rb"bytes=\s*(\d{1,99}-\d{0,99}|-\d{1,99})(\s*,\s*(\d{1,99}-\d{0,99}|-\d{1,99}))*\s*", re.IGNORECASE
)
_BOTH_ENDS = re.compile(rb"(\d+)-(\d+)")


class Download(FileResponse):
    """A file, or the part of it that a client goes on with (RFC 9110, section 14.2).

    A `Range` that is none, as one that ends before it begins, is passed over: the answer is the whole file.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer. Raises RangeError where the file has nothing of what is asked for."""

        async def send_unless_refused(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == 416:
                raise RangeError(Headers(raw=message["headers"])["content-range"])
            await send(message)

        headers = [(name, value) for name, value in scope["headers"] if name != b"range" or _are_ranges(value)]
        await super().__call__({**scope, "headers": headers}, receive, send_unless_refused)


def _are_ranges(value: bytes) -> bool:
    return _RANGES.fullmatch(value) is not None and all(int(a) <= int(b) for a, b in _BOTH_ENDS.findall(value))


def safe_stem(text: str) -> str:
    """Letters and digits of any script, dots, dashes and underscores of a text; anything else becomes dashes."""
    return re.sub(r"[^\w.-]+", "-", text)[:_LONGEST].strip(".-") or "picture"
