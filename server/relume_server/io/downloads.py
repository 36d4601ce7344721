"""Downloaded files: whole or in parts, and under names that every system takes."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fastapi.responses import FileResponse, StreamingResponse
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from relume_server.errors import RangeError

_LONGEST = 120
_CHUNK_BYTES = 1 << 18
_RANGES = re.compile(
    rb"bytes=\s*(\d{1,99}-\d{0,99}|-\d{1,99})(\s*,\s*(\d{1,99}-\d{0,99}|-\d{1,99}))*\s*", re.IGNORECASE
)
_CLOSED_RANGE = re.compile(rb"(\d+)-(\d+)")


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


class ZipStream(StreamingResponse):
    """Files packed while they are sent: nothing of the archive is on the disk, and little of it in memory."""

    media_type = "application/zip"

    def __init__(self, files: Sequence[tuple[Path, str]], name: str) -> None:
        """
        Args:
            files: each with its name in the archive; one that is deleted meanwhile is left out.
            name: of the archive where it is saved.
        """
        disposition = f"attachment; filename*=utf-8''{quote(name)}"
        super().__init__(_zip_chunks(files), headers={"Content-Disposition": disposition, "Cache-Control": "no-store"})


class _ZipBuffer(io.RawIOBase):
    """What was written and not taken yet."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []

    def writable(self) -> bool:
        """It is."""
        return True

    def write(self, data: Any) -> int:
        """Add some."""
        self._chunks.append(bytes(data))
        return len(self._chunks[-1])

    def take(self) -> bytes:
        """Take all."""
        taken, self._chunks = b"".join(self._chunks), []
        return taken


def _zip_chunks(files: Sequence[tuple[Path, str]]) -> Iterator[bytes]:
    buffer = _ZipBuffer()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for path, name in files:
            try:
                file = path.open("rb")
            except FileNotFoundError:
                continue
            with file, archive.open(zipfile.ZipInfo(name), "w", force_zip64=True) as entry:
                while chunk := file.read(_CHUNK_BYTES):
                    entry.write(chunk)
                    yield buffer.take()
            yield buffer.take()
    yield buffer.take()


def _are_ranges(value: bytes) -> bool:
    return _RANGES.fullmatch(value) is not None and all(int(a) <= int(b) for a, b in _CLOSED_RANGE.findall(value))


def safe_stem(text: str) -> str:
    """Letters and digits of any script, dots, dashes and underscores of a text; anything else becomes dashes."""
    return re.sub(r"[^\w.-]+", "-", text)[:_LONGEST].strip(".-") or "picture"
