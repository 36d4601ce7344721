"""Large responses for many clients: written to a file once, and read at the speed of each client.

A slow client holds one chunk of a file, not a copy of the response.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import AsyncIterator, Callable, Hashable, Mapping
from pathlib import Path
from typing import IO, Any
from weakref import WeakValueDictionary, finalize

import numpy as np
from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from fastapi.responses import StreamingResponse
from numpy.typing import NDArray

from relume_server.runtime.single_flight import SingleFlight

PIECE_BYTES, NUM_READERS = 1 << 17, 4
Content = bytes | NDArray[Any]


class _File:
    """A response in an unnamed file, deleted with its last reader."""

    def __init__(self, folder: Path, content: Content) -> None:
        with np.ascontiguousarray(content).data if isinstance(content, np.ndarray) else memoryview(content) as data:
            self.num_bytes = data.nbytes
            self._file: IO[bytes] = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115  (closed below)
            finalize(self, self._file.close)
            with data.cast("B") as flat:
                written = 0
                while written < self.num_bytes:
                    written += self._file.write(flat[written:])

    async def chunks(self, threads: CapacityLimiter) -> AsyncIterator[bytes]:
        """Yield the content. threads: limits concurrent reads."""
        offset = 0
        while offset < self.num_bytes:
            piece = await run_sync(os.pread, self._file.fileno(), PIECE_BYTES, offset, limiter=threads)
            offset += len(piece)
            yield piece


class StreamedResponses:
    """Large responses of one server. Event loop only.

    Args:
        folder: folder on the disk for the files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._single_flight = folder, SingleFlight(2, "relume-answer")
        self._files: WeakValueDictionary[Hashable, _File] = WeakValueDictionary()
        self._readers = CapacityLimiter(NUM_READERS)

    async def stream(
        self, key: Hashable, make: Callable[[], Content], media_type: str, headers: Mapping[str, str]
    ) -> StreamingResponse:
        """Stream the response for a key, shared by all requests. make: creates the content, in a thread; may raise."""
        file = self._files.get(key)
        if file is None:
            file = await self._single_flight.run(key, lambda: _File(self._folder, make()))
            file = self._files.setdefault(key, file)
        length = {"Content-Length": str(file.num_bytes)}
        return StreamingResponse(file.chunks(self._readers), media_type=media_type, headers={**headers, **length})

    def close(self) -> None:
        """Accept no more requests."""
        self._single_flight.close()
