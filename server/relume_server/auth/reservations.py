"""Bytes that count as a user's while an upload is received and imported."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from relume.core.errors import bytes_text
from relume_server.errors import NearlyFullError
from relume_server.runtime.disk_space import free_bytes
from relume_worker.jobs.job import QuotaError

if TYPE_CHECKING:
    from relume_server.auth.quotas import OwnedKind, Quotas

RESERVATION_TTL_S = 3600
"""Lifetime of a killed server's reservations."""
MAX_CONCURRENT_IMPORTS = 2
"""Number of concurrent uploads that share the free disk space."""


class Reservation:
    """Bytes of one upload, stored as a row before anything is checked, so that concurrent uploads, on other servers as
    well, count it. Used by one thread at a time.

    Args:
        quotas: quotas of all users. owner: user who uploads.
    """

    def __init__(self, quotas: Quotas, owner: str) -> None:
        self.owner = owner
        self._quotas = quotas
        self._row = f"{int(time.time()) + RESERVATION_TTL_S:012d}-{uuid.uuid4().hex}"
        self.bytes = 0

    def reserve(self, num_bytes: int) -> None:
        """Reserve so many bytes.

        Raises:
            QuotaError, NearlyFullError: there is not enough space; the previous reservation stays.
        """
        with self._quotas.deciding:  # within one server a refused upload must not make another one fail
            before, self.bytes = self.bytes, num_bytes
            self._quotas.put_reserved(self.owner, self._row, num_bytes)
            try:
                self._quotas.check_reserved(self.owner, num_bytes)
            except (QuotaError, NearlyFullError):
                self.bytes = before
                self._quotas.put_reserved(self.owner, self._row, before)
                raise

    def max_import_bytes(self) -> int:
        """Current maximum size of the imported result."""
        remaining_bytes, settings = self._quotas.remaining_bytes(self.owner), self._quotas.settings
        disk_bytes = (free_bytes(settings.data) - settings.min_free_bytes) // MAX_CONCURRENT_IMPORTS
        return max(0, disk_bytes if remaining_bytes is None else min(disk_bytes, remaining_bytes + self.bytes))

    def too_large_error(self, limit_bytes: int) -> QuotaError | NearlyFullError:
        """Return the error for a file that unpacks to more than `max_import_bytes`."""
        if self._quotas.remaining_bytes(self.owner) is None:
            return NearlyFullError(
                f"the file unpacks to more than {bytes_text(limit_bytes)}, and the disk has no more; free some space"
            )
        return QuotaError(
            f"the file unpacks to more than the {bytes_text(limit_bytes)} left in your quota; delete a scene, a "
            "bake, a material, a comparison or a render of yours first (RELUME_MAX_BYTES_PER_USER)"
        )

    def convert(self, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """Turn the reservation into an object of so many bytes, unless it has an owner already."""
        self._quotas.convert(("upload", self._row), (kind, object_id), num_bytes)

    @contextmanager
    def owner_assigned(self, kind: OwnedKind, object_id: str, num_bytes: int) -> Iterator[None]:
        """Assign the owner of an object before it is queued inside; undone if queuing fails."""
        self.convert(kind, object_id, num_bytes)
        try:
            yield
        except BaseException:
            self._quotas.disown(kind, object_id)
            raise

    def release(self) -> None:
        """Delete the reservation."""
        self._quotas.drop_reserved(self._row)
