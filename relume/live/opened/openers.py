"""The list of openers: how the bakes of each transfer method open for pictures.

To add a method, add its opener here; `relume.methods.registry` lists how it bakes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import cast

from relume.core.cache import Cache
from relume.core.errors import StoreError
from relume.live.fixed_camera.protocols import CameraMode, FixedViewTransfer, OpenBake
from relume.live.opened.fixed_views import BakedFixedViews
from relume.live.opened.fixed_views_indirect import BakedIndirectViews
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.store.bake_protocol import StoreReader
from relume.store.reader import open_store

Opener = Callable[[StoreReader, str, Cache], OpenBake]
"""Opens a store, given the key of its bake in a cache of results.

Raises StoreError if the store's description is invalid, ChunkDamagedError if its arrays do not fit each other.
"""

OPENERS: dict[str, Opener] = {
    "direct": BakedFixedViews.from_store,
    "gather": BakedIndirectViews.from_store,
    "probes": BakedFreeCamera.from_store,
}
"""By the name of the method that baked."""


def open_bake(path: Path, cache: Cache) -> OpenBake:
    """Open a published store for pictures.

    Args:
        cache: of results computed from the bake.
    Raises:
        StoreNotFoundError, SchemaVersionError, ChunkDamagedError, StoreError: see `relume.store.reader.open_store`.
    """
    store = open_store(path)
    opener = OPENERS.get(str(store.attributes.get("method")))
    if opener is None:
        raise StoreError(f"no method of this version can open {path.name}; delete the bake and bake again")
    return opener(store, str(path.resolve()), cache)


def open_transfer(path: Path, cache: Cache) -> FixedViewTransfer:
    """Open a published store of fixed views.

    Args:
        cache: of results computed from the bake.
    Raises:
        StoreError: it has a free camera. Otherwise as `open_bake`.
    """
    bake = open_bake(path, cache)
    if bake.camera_mode is not CameraMode.FIXED:
        raise StoreError(f"{path.name} has no fixed views; bake the scene with another method")
    return cast("FixedViewTransfer", bake)
