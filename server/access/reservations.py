"""Bytes that count as somebody's while an upload is taken in and read."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from relume.errors import bytes_text
from server.errors import NearlyFullError, QuotaError
from server.library.disk import free_bytes

if TYPE_CHECKING:
    from server.access.quotas import Kind, Quotas

RESERVED_S = 3600
"""How long what a killed server has reserved still counts."""
IMPORTS_AT_ONCE = 2
"""Among which the room that is left on the disk is shared."""


class Reservation:
    """What one upload takes. It is a row beside those of things, written before anything is checked: whatever comes at
    the same time, to another server too, counts it. Used by one thread at a time.

    Args:
        quotas: of all. who: whose it is.
    """

    def __init__(self, quotas: Quotas, who: str) -> None:
        self.who = who
        self._quotas = quotas
        self._row = f"{int(time.time()) + RESERVED_S:012d}-{uuid.uuid4().hex}"
        self.bytes = 0

    def hold(self, num_bytes: int) -> None:
        """Count so many bytes from now on.

        Raises:
            QuotaError, NearlyFullError: there is no room for so many; what was held before is held on.
        """
        with self._quotas.deciding:  # of one server none is refused for another that is refused
            before, self.bytes = self.bytes, num_bytes
            self._quotas.put_reserved(self.who, self._row, num_bytes)
            try:
                self._quotas.check_reserved(self.who, num_bytes)
            except (QuotaError, NearlyFullError):
                self.bytes = before
                self._quotas.put_reserved(self.who, self._row, before)
                raise

    def most_bytes(self) -> int:
        """How large what is made of the upload may be, now."""
        left, settings = self._quotas.left_bytes(self.who), self._quotas.settings
        on_disk = (free_bytes(settings.data) - settings.least_free_bytes) // IMPORTS_AT_ONCE
        return max(0, on_disk if left is None else min(on_disk, left + self.bytes))

    def outgrown(self, most: int) -> QuotaError | NearlyFullError:
        """The error of a file that unpacks to more than `most_bytes` said."""
        if self._quotas.left_bytes(self.who) is None:
            return NearlyFullError(f"the file unpacks to more than {bytes_text(most)}, and the disk has no more room")
        return QuotaError(
            f"the file unpacks to more than the {bytes_text(most)} that you may still have; delete a scene, a bake, a "
            "material or a render of yours first (RELUME_MAX_BYTES_EACH)"
        )

    def become(self, kind: Kind, thing: str, num_bytes: int) -> None:
        """What was reserved is a thing of so many bytes from now on, unless it is somebody's already."""
        self._quotas.become(("upload", self._row), (kind, thing), num_bytes)

    @contextmanager
    def owning(self, kind: Kind, thing: str, num_bytes: int) -> Iterator[None]:
        """What is queued inside is somebody's before anybody works on it; nobody's where that fails."""
        self.become(kind, thing, num_bytes)
        try:
            yield
        except BaseException:
            self._quotas.disown(kind, thing)
            raise

    def release(self) -> None:
        """Count nothing any more."""
        self._quotas.drop_reserved(self._row)
