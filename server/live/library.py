"""The real library behind sessions: opened transfers, live pictures over one shared cache, exact renders."""

from __future__ import annotations

from server.live.ports import Library


def open_library(cache_bytes: int) -> Library:
    """relume's own, with a frozen cache of so many bytes for all sessions together."""
    # Imported here because they load compiled kernels, which a process that only describes the API can do without.
    from relume.transfer.cache import FrozenCache
    from relume.transfer.opened import open_transfer
    from relume.transfer.picture import Picture
    from relume.transfer.render import render_image

    cache = FrozenCache(cache_bytes)
    return Library(
        open_transfer=open_transfer,
        make_picture=lambda transfer, view: Picture(transfer, view, cache),
        render=render_image,
        cache_used_bytes=lambda: cache.used_bytes,
    )
