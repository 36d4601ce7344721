"""Dragging clients of many sessions in one process, light enough to leave the cores to the server."""

from __future__ import annotations

import asyncio
import json
import struct
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection

from relume.core.errors import PlanError

_MAX_PENDING_EDITS = 2  # unacknowledged edits, as in the editor: while one is painted the next is there
_NUM_EDITS_PER_PERIOD = 90  # edits from one end of a slider to the other and back


class SliderClient:
    """Drags one slider back and forth, each edit after the frame of the one before the last.

    Args:
        connection: connection of the session. slider: pointer to a parameter. span: range of its value.
        phase: starting point, in
            periods.
    Attributes:
        num_frames: received so far.
    """

    def __init__(self, connection: ClientConnection, slider: str, span: tuple[float, float], phase: float) -> None:
        self._connection, self._slider, self._span, self._phase = connection, slider, span, phase
        self._revision = self.num_frames = 0
        self._is_dragging, self._is_exact, self._has_first_frame = False, asyncio.Event(), asyncio.Event()

    async def run(self) -> None:
        """Acknowledge every frame, until canceled."""
        while True:
            message = await self._connection.recv()
            if isinstance(message, bytes):
                await self._handle_frame(message)
            elif json.loads(message)["type"] == "problem":
                raise PlanError(f"the server refused: {message[:300]}")

    async def _handle_frame(self, message: bytes) -> None:
        (length,) = struct.unpack_from("<I", message)
        header = json.loads(message[4 : 4 + length])
        self.num_frames += 1
        if header["revision"] > 0:
            self._has_first_frame.set()
        if header["exact"] and header["revision"] == self._revision:
            self._is_exact.set()
        await self._send_message(type="ack", frame=header["frame"])
        while self._is_dragging and self._revision < header["revision"] + _MAX_PENDING_EDITS:
            await self._edit()

    async def release(self) -> None:
        """Release the slider, and wait for the exact image."""
        self._is_dragging = False
        await self._edit(0.0)
        await self._is_exact.wait()

    async def drag(self) -> None:
        """Wait for the exact image, announce the drag and start it; returns when a frame shows it."""
        await self._is_exact.wait()
        self._is_dragging = True
        await self._send_message(type="prepare", parameter=self._slider)
        await self._edit()
        await self._has_first_frame.wait()

    async def _edit(self, phase: float | None = None) -> None:
        """Move the slider to its next value, or to a phase in periods from its center."""
        self._revision += 1
        self._is_exact.clear()
        along = 0.5 + 0.5 * np.sin(
            2 * np.pi * (self._phase + self._revision / _NUM_EDITS_PER_PERIOD if phase is None else phase)
        )
        low, high = self._span
        patch = [{"op": "replace", "path": self._slider, "value": round(low + (high - low) * float(along), 5)}]
        await self._send_message(type="edit", revision=self._revision, patch=patch, active_control=self._slider)

    async def _send_message(self, **message: Any) -> None:
        await self._connection.send(json.dumps(message))
