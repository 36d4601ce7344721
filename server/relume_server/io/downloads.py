"""Downloads: whole files or ranges, with portable names."""

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

_CHUNK_BYTES = 1 << 18
_RANGES = re.compile(
    rb"bytes=\s*(\d{1,99}-\d{0,99}|-\d{1,99})(\s*,\s*(\d{1,99}-\d{0,99}|-\d{1,99}))*\s*", re.IGNORECASE
)
_CLOSED_RANGE = re.compile(rb"(\d+)-(\d+)")


class Download(FileResponse):
    """A file, or a range of it (RFC 9110, section 14.2).

    An invalid `Range`, such as one that ends before it starts, is ignored: the response is the whole file.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the response. Raises RangeError if the range is outside the file."""

        async def send_unless_refused(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == 416:
                raise RangeError(Headers(raw=message["headers"])["content-range"])
            await send(message)

        headers = [(name, value) for name, value in scope["headers"] if name != b"range" or _are_ranges(value)]
        await super().__call__({**scope, "headers": headers}, receive, send_unless_refused)


class ZipStream(StreamingResponse):
    """A ZIP that is packed while it is sent: nothing on the disk, little in memory."""

    media_type = "application/zip"

    def __init__(self, files: Sequence[tuple[Path, str]], name: str) -> None:
        """
        Args:
            files: each with its name in the archive; files deleted meanwhile are skipped.
            name: download name of the archive.
        """
        disposition = f"attachment; filename*=utf-8''{quote(name)}"
        super().__init__(_zip_chunks(files), headers={"Content-Disposition": disposition, "Cache-Control": "no-store"})


class _ZipBuffer(io.RawIOBase):
    """Written bytes that have not been taken yet."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []

    def writable(self) -> bool:
        """True."""
        return True

    def write(self, data: Any) -> int:
        """Append bytes."""
        self._chunks.append(bytes(data))
        return len(self._chunks[-1])

    def take(self) -> bytes:
        """Take all bytes."""
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
