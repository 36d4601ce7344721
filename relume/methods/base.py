"""The protocol of a transfer method, from plan to frame."""

from __future__ import annotations

from typing import Protocol

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import OpenBake
from relume.store.bake_protocol import BakeMethod, StoreReader


class TransferMethod(BakeMethod, Protocol):
    """One paper's light transport: how it is baked, and how its bakes are shown.

    bake (worker, once) → freeze (server, on touch) → frame (server, per edit). A method joins by one module and one
    line in `relume.methods.registry`, and inherits the contract suite in tests/contract.
    """

    def open(self, store: StoreReader, key: str, cache: Cache) -> OpenBake:
        """A store of this method, opened for freezing and frames.

        Args:
            key: tells what is made from this bake from what is made from others in the cache: the store's path.
            cache: of all that is made from the bake and may be made again.
        Raises:
            StoreError: the store's description is not of this form.
            ChunkDamagedError: its arrays do not fit each other.
        """
        ...
