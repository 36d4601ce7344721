"""The real library behind sessions: opened transfers, live pictures over one shared cache, exact renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from server.live.ports import Library


def open_library(cache_bytes: int, floor_bytes: int) -> Library:
    """relume's own, with a frozen cache for all sessions together.

    Args:
        cache_bytes: that it holds at most. floor_bytes: of them, of bakes that nobody uses.
    """
    # Imported here because they load compiled kernels, which a process that only describes the API can do without.
    from relume.reference import reference_image
    from relume.scene.archive import load_scene
    from relume.transfer.cache import FrozenCache
    from relume.transfer.opened import open_transfer
    from relume.transfer.picture import Picture
    from relume.transfer.render import render_image, render_small

    def reference(scene: Path, *args: Any, reflects: bool) -> Any:
        return reference_image(load_scene(scene), *args, reflects=reflects)

    cache = FrozenCache(cache_bytes)
    return Library(
        open_transfer=open_transfer,
        make_picture=lambda transfer, view: Picture(transfer, view, cache, is_watched=True),
        render=render_image,
        render_small=render_small,
        reference=reference,
        cache_used_bytes=lambda: cache.used_bytes,
        shrink_cache=lambda stores: cache.shrink(floor_bytes, {str(store.resolve()) for store in stores}),
    )
