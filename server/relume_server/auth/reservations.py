"""Bytes that count as somebody's while an upload is taken in and read."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from relume.core.errors import bytes_text
from relume_server.errors import NearlyFullError, QuotaError
from relume_server.runtime.disk_space import free_bytes

if TYPE_CHECKING:
    from relume_server.auth.quotas import OwnedKind, Quotas

RESERVATION_TTL_S = 3600
"""How long what a killed server has reserved still counts."""
MAX_CONCURRENT_IMPORTS = 2
"""Among which the room that is left on the disk is shared."""


class Reservation:
    """What one upload takes. It is a row beside those of things, written before anything is checked: whatever comes at
    the same time, to another server too, counts it. Used by one thread at a time.

    Args:
        quotas: of all. owner: whose it is.
    """

    def __init__(self, quotas: Quotas, owner: str) -> None:
        self.owner = owner
        self._quotas = quotas
        self._row = f"{int(time.time()) + RESERVATION_TTL_S:012d}-{uuid.uuid4().hex}"
        self.bytes = 0

    def reserve(self, num_bytes: int) -> None:
        """Count so many bytes from now on.

        Raises:
            QuotaError, NearlyFullError: there is no room for so many; what was held before is held on.
        """
        with self._quotas.deciding:  # of one server none is refused for another that is refused
            before, self.bytes = self.bytes, num_bytes
            self._quotas.put_reserved(self.owner, self._row, num_bytes)
            try:
                self._quotas.check_reserved(self.owner, num_bytes)
            except (QuotaError, NearlyFullError):
                self.bytes = before
                self._quotas.put_reserved(self.owner, self._row, before)
                raise

    def max_import_bytes(self) -> int:
        """How large what is made of the upload may be, now."""
        remaining_bytes, settings = self._quotas.remaining_bytes(self.owner), self._quotas.settings
        disk_bytes = (free_bytes(settings.data) - settings.min_free_bytes) // MAX_CONCURRENT_IMPORTS
        return max(0, disk_bytes if remaining_bytes is None else min(disk_bytes, remaining_bytes + self.bytes))

    def too_large_error(self, limit_bytes: int) -> QuotaError | NearlyFullError:
        """The error of a file that unpacks to more than `max_import_bytes` said."""
        if self._quotas.remaining_bytes(self.owner) is None:
            return NearlyFullError(
                f"the file unpacks to more than {bytes_text(limit_bytes)}, and the disk has no more room"
            )
        return QuotaError(
            f"the file unpacks to more than the {bytes_text(limit_bytes)} that you may still have; delete a scene, a "
            f"bake, a "
            "material or a render of yours first (RELUME_MAX_BYTES_PER_USER)"
        )

    def convert(self, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """What was reserved is a thing of so many bytes from now on, unless it is somebody's already."""
        self._quotas.convert(("upload", self._row), (kind, object_id), num_bytes)

    @contextmanager
    def owner_assigned(self, kind: OwnedKind, object_id: str, num_bytes: int) -> Iterator[None]:
        """What is queued inside is somebody's before anybody works on it; nobody's where that fails."""
        self.convert(kind, object_id, num_bytes)
        try:
            yield
        except BaseException:
            self._quotas.disown(kind, object_id)
            raise

    def release(self) -> None:
        """Count nothing any more."""
        self._quotas.drop_reserved(self._row)
