"""The protocol of a transfer method, from plan to frame."""

from __future__ import annotations

from typing import Protocol

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import OpenBake
from relume.store.bake_protocol import BakeMethod, StoreReader


class TransferMethod(BakeMethod, Protocol):
    """Light transport method: bakes scenes and displays its bakes.

    bake (worker, once) → freeze (server, before an edit) → frame (server, per edit). To add a method, write a module
    and a line in `relume.methods.registry`, and inherit the contract suite in tests/contract.
    """

    def open(self, store: StoreReader, key: str, cache: Cache) -> OpenBake:
        """Open a store of this method for freezing and frames.

        Args:
            key: the store's path; identifies this bake's entries in the cache.
            cache: cache of results computed from the bake.
        Raises:
            StoreError: the store's description is invalid.
            ChunkDamagedError: its arrays do not fit each other.
        """
        ...
