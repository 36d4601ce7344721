"""The list of transfer methods. To add one: write its module beside this one and add it here."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from relume.core.cache import Cache
from relume.core.errors import StoreError
from relume.live.fixed_camera.protocols import CameraMode, FixedViewTransfer, OpenBake
from relume.methods.base import TransferMethod
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.methods.probes import ProbesMethod
from relume.store import open_store

METHODS: dict[str, TransferMethod] = {
    method.name: method for method in (DirectMethod(), GatherMethod(), ProbesMethod())
}


def open_bake(path: Path, cache: Cache) -> OpenBake:
    """Open a published store by the method that baked it.

    Args:
        cache: cache of results computed from the bake.
    Raises:
        StoreNotFoundError, SchemaVersionError, ChunkDamagedError, StoreError: see `relume.store.open_store`.
    """
    store = open_store(path)
    method = METHODS.get(str(store.attributes.get("method")))
    if method is None:
        raise StoreError(f"no method of this version can open {path.name}; delete the bake and bake again")
    return method.open(store, str(path.resolve()), cache)


def open_transfer(path: Path, cache: Cache) -> FixedViewTransfer:
    """Open a published store of fixed views.

    Args:
        cache: cache of results computed from the bake.
    Raises:
        StoreError: it has a free camera. Otherwise as `open_bake`.
    """
    bake = open_bake(path, cache)
    if bake.camera_mode is not CameraMode.FIXED:
        raise StoreError(f"{path.name} has no fixed views; bake the scene with another method")
    return cast("FixedViewTransfer", bake)
